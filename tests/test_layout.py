"""The folders on disk, the import names, the packaging list and who uses what say the same."""

import ast
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LINKS = {"runtime": "../runtime", "export": "../export", "models_def": "../models_def"}
ASK = (
    "import setuptools; from distutils.core import run_setup; "
    "print(*run_setup('setup.py', stop_after='config').packages)"
)
MAPPED = r"`?[a-z][a-z0-9_]*/?`?"
SHIPPED = ("camkit", "runtime", "export", "models_def")
FOUND_BY_PLACE = (
    "camkit.report.bench.metrics",
    "camkit.report.stress.scenarios",
    "camkit.report.kinds",
    "camkit.models_def.kinds",
    "camkit.runtime.kinds",
    "camkit.runtime.plan.rules",
    "camkit.runtime.stages",
)
DATA = {
    "camkit.bundles",
    "camkit.models_def.plates",
    "camkit.models_def.prescriptions",
    "camkit.models_def.recipes",
}


def _modules(top: str) -> Iterator[tuple[str, Path]]:
    """Give import name and file of every module below a top folder, the links left out."""
    for path in (ROOT / top).rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        if top == "camkit" and parts[1] in LINKS:
            continue
        named = parts[:-1] if parts[-1] == "__init__" else parts
        yield ".".join(named if top in {"camkit", "tools"} else ("camkit", *named)), path


def _named(path: Path) -> set[str]:
    """Give the modules that a file may import or run: by import, or by a string."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            found.add(node.value)
    return found


def _packages_on_disk() -> set[str]:
    return {n for top in SHIPPED for n, path in _modules(top) if path.name == "__init__.py"}


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
    for top in (*SHIPPED, "tools"):
        for folder in {path.parent for path in (ROOT / top).rglob("*.py")}:
            modules = [path for path in folder.glob("*.py") if path.name != "__init__.py"]
            assert len(modules) <= 20, folder


def test_modules_hold_at_most_400_lines_of_code() -> None:
    """A docstring counts one line; blank lines and comments count none."""
    for top in (*SHIPPED, "tools"):
        for path in (ROOT / top).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            lines = {
                number
                for number, line in enumerate(text.splitlines(), 1)
                if line.strip() and not line.strip().startswith("#")
            }
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                    lines -= set(range(node.lineno + 1, (node.end_lineno or 0) + 1))
            assert len(lines) <= 400, path


def test_a_file_of_tools_is_a_command_and_its_folders_hold_commands_or_what_they_use() -> None:
    modules = dict(_modules("tools"))
    used = {name for path in modules.values() for name in _named(path)}
    for name, path in modules.items():
        is_command = '\nif __name__ == "__main__":\n' in path.read_text(encoding="utf-8")
        if path.name != "__init__.py":
            assert is_command or (path.parent.name != "tools" and name in used), name


def test_nothing_that_ships_imports_tools_or_tests() -> None:
    for top in SHIPPED:
        for name, path in _modules(top):
            assert not {n.partition(".")[0] for n in _named(path)} & {"tools", "tests"}, name


def test_nothing_that_ships_serves_the_tools_alone() -> None:
    """A command uses it, or a document tells people to import it."""
    modules = dict(pair for top in SHIPPED for pair in _modules(top))
    pages = [p for s in ("start", "guides", "reference") for p in (ROOT / "docs" / s).glob("*.md")]
    told = "\n".join(path.read_text(encoding="utf-8") for path in pages)
    ahead = {n for n in modules if re.fullmatch(r"camkit(\.__main__|\.cli(\..+)?)?", n)}
    ahead |= {n for n in modules if n.startswith(FOUND_BY_PLACE)}
    ahead |= {n for n in modules if f"from {n} import" in told}
    ahead |= {n for n in modules if f"`{n.rpartition('.')[2]}." in told}
    reached: set[str] = set()
    while ahead:
        name = ahead.pop()
        reached |= {name}
        package = name.rpartition(".")[0]
        ahead |= ((_named(modules[name]) | {package}) & modules.keys()) - reached
    assert set(modules) - reached <= DATA


def _mapped(package: Path) -> set[str]:
    """Return the names that lines "name, name   what" or "- `name`: what" of a map begin with."""
    docstring = ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) or ""
    head = rf"^ *(?:.*-> |- )?({MAPPED}(?:, {MAPPED})*)(?: {{2,}}|: )"
    heads = re.findall(head, docstring.partition("\n")[2], re.M)
    return {name.strip("`/ ") for head in heads for name in head.split(",")}


def test_maps_of_packages_name_what_is_there() -> None:
    packages = [path for top in (*SHIPPED, "tools") for _, path in _modules(top)]
    wrong, mapped = {}, 0
    for package in (path for path in packages if path.name == "__init__.py"):
        names, there = _mapped(package), {path.stem for path in package.parent.iterdir()}
        mapped += len(names)
        wrong[str(package.relative_to(ROOT))] = names - there
    assert mapped > 600
    assert not {package: names for package, names in wrong.items() if names}


def test_an_editable_install_puts_a_folder_of_one_link_on_the_path(tmp_path: Path) -> None:
    """Type checkers follow paths and no import hooks; the checkout itself stays off the path."""
    _copy_settings(tmp_path)
    for top in SHIPPED:
        (tmp_path / top).mkdir()
        (tmp_path / top / "__init__.py").write_text("")
    for name, target in LINKS.items():
        (tmp_path / "camkit" / name).symlink_to(target)
    build = "from setuptools.build_meta import build_editable; print(build_editable('dist'))"
    done = subprocess.run(
        [sys.executable, "-c", build], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    with zipfile.ZipFile(tmp_path / "dist" / done.stdout.split()[-1]) as wheel:
        paths = [name for name in wheel.namelist() if name.endswith(".pth")]
        assert not [name for name in wheel.namelist() if name.endswith(".py")]
        folder = Path(wheel.read(paths[0]).decode().strip())
    assert [path.name for path in folder.iterdir()] == ["camkit"]
    assert (folder / "camkit" / "runtime" / "__init__.py").is_file()
