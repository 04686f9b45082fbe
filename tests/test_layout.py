"""The folders on disk, the import names and the packaging list say the same thing."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINKS = {"runtime": "../runtime", "export": "../export", "models_def": "../models_def"}


def _packages_on_disk() -> set[str]:
    names = set()
    for top in ("camkit", "runtime", "export", "models_def"):
        for init in (ROOT / top).rglob("__init__.py"):
            parts = init.parent.relative_to(ROOT).parts
            if top == "camkit" and len(parts) > 1 and parts[1] in LINKS:
                continue
            names.add(".".join(parts if top == "camkit" else ("camkit", *parts)))
    return names


def test_packaging_list_equals_the_folders_on_disk() -> None:
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]
    assert set(settings["packages"]) == _packages_on_disk()


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
