"""The folders on disk, the import names and the packaging list say the same thing."""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINKS = {"runtime": "../runtime", "export": "../export", "models_def": "../models_def"}
ASK = (
    "import setuptools; from distutils.core import run_setup; "
    "print(*run_setup('setup.py', stop_after='config').packages)"
)


def _packages_on_disk() -> set[str]:
    names = set()
    for top in ("camkit", "runtime", "export", "models_def"):
        for init in (ROOT / top).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT).parts
            if top == "camkit" and len(parts) > 1 and parts[1] in LINKS:
                continue
            names.add(".".join(parts if top == "camkit" else ("camkit", *parts)))
    return names


def _packages_of_the_wheel(root: Path) -> set[str]:
    """Ask setuptools, in a fresh process, what it would pack."""
    told = subprocess.run(
        [sys.executable, "-c", ASK], cwd=root, capture_output=True, text=True, check=True
    )
    return set(told.stdout.split())


def _copy_settings(folder: Path) -> None:
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)


def test_packages_of_the_wheel_equal_the_folders_on_disk() -> None:
    assert _packages_of_the_wheel(ROOT) == _packages_on_disk()


def test_packages_are_found_without_the_links(tmp_path: Path) -> None:
    """An sdist and a zip of the repository hold no links."""
    _copy_settings(tmp_path)
    for package in _packages_on_disk():
        top, *rest = package.split(".")
        folder = tmp_path.joinpath(*rest if rest and rest[0] in LINKS else (top, *rest))
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "__init__.py").touch()
    assert _packages_of_the_wheel(tmp_path) == _packages_on_disk()


def test_a_new_package_folder_is_found(tmp_path: Path) -> None:
    _copy_settings(tmp_path)
    for folder in ("camkit/plates", "runtime/plates/rules"):
        (tmp_path / folder).mkdir(parents=True)
        for inner in (folder, str(Path(folder).parent)):
            (tmp_path / inner / "__init__.py").touch()
    found = _packages_of_the_wheel(tmp_path)
    assert {"camkit.plates", "camkit.runtime.plates", "camkit.runtime.plates.rules"} <= found


def test_links_are_relative_and_lead_to_the_real_folders() -> None:
    for name, target in LINKS.items():
        link = ROOT / "camkit" / name
        assert link.is_symlink()
        assert str(link.readlink()) == target


def test_folders_hold_at_most_twenty_modules() -> None:
    for top in ("camkit", "runtime", "export", "models_def"):
        for folder in {p.parent for p in (ROOT / top).rglob("*.py")}:
            modules = [p for p in folder.glob("*.py") if p.name != "__init__.py"]
            assert len(modules) <= 20, folder
