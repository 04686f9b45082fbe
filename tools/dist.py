"""Build the packages of a release: `python -m tools.dist -o dist`.

    camkit           the product with the camera duet: wheel and sdist
    camkit-bundles   the other cameras: wheel and sdist

Both are built from a copy of the files that git tracks, in a fresh environment each, so that a
package holds nothing of a working tree. Needs the package `build`.
"""

import argparse
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any, Final

ROOT: Final = Path(__file__).resolve().parents[1]
SHIPPED: Final = ("camkit", "runtime", "export", "models_def")
FILES: Final = ("pyproject.toml", "setup.py", "README.md", "LICENSE", "CHANGELOG.md")
BUNDLES: Final = Path("camkit", "bundles")
IN_CAMKIT: Final = "duet.camkit"
MORE: Final = "camkit_bundles"
_SETTINGS: Final = """[build-system]
requires = ["setuptools>=77"]
build-backend = "setuptools.build_meta"

[project]
name = "camkit-bundles"
version = "{version}"
description = "The built-in cameras of camkit beside duet."
readme = "README.md"
license = "{license}"
license-files = ["LICENSE"]
requires-python = "{python}"
dependencies = ["camkit=={version}"]

[tool.setuptools]
packages = ["camkit_bundles"]

[tool.setuptools.package-data]
camkit_bundles = ["*.camkit"]
"""


def main() -> None:
    """Build both into a folder."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("-o", "--out-dir", type=Path, default=Path("dist"))
    out = parser.parse_args().out_dir
    with tempfile.TemporaryDirectory() as folder:
        product, bundles = Path(folder, "product"), Path(folder, "bundles")
        export_product(product)
        export_bundles(bundles)
        for package in (product, bundles):
            command = [sys.executable, "-m", "build", "--outdir", str(out.resolve())]
            subprocess.run([*command, str(package)], check=True, stdout=subprocess.DEVNULL)
    for path in sorted(out.iterdir()):
        print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


def export_product(folder: Path) -> None:
    """Write the tree of the package camkit, with one camera."""
    for name in tracked_files(*SHIPPED, *FILES):
        source, target = ROOT / name, folder / name
        if source.is_symlink() or (name.suffix == ".camkit" and name.name != IN_CAMKIT):
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(source, target)


def export_bundles(folder: Path) -> None:
    """Write the tree of the package camkit-bundles, with all other cameras."""
    package = folder / MORE
    package.mkdir(parents=True)
    project: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    names = [n for n in tracked_files(str(BUNDLES)) if n.suffix == ".camkit"]
    others = [name for name in names if name.name != IN_CAMKIT]
    for name in others:
        shutil.copyfile(ROOT / name, package / name.name)
    cameras = ", ".join(f"`{name.stem}`" for name in others)
    summary = f"The built-in cameras of camkit beside `duet`: {cameras}."
    (package / "__init__.py").write_text(f'"""{summary}"""\n', encoding="utf-8")
    (folder / "README.md").write_text(
        f"# camkit-bundles\n\n{summary} camkit finds them by name: `camkit info {others[0].stem}` "
        "states what each is for, its licence and what its networks were trained on.\n",
        encoding="utf-8",
    )
    shutil.copyfile(ROOT / "LICENSE", folder / "LICENSE")
    settings = _SETTINGS.format(
        version=project["version"], license=project["license"], python=project["requires-python"]
    )
    (folder / "pyproject.toml").write_text(settings, encoding="utf-8")


def tracked_files(*places: str) -> list[Path]:
    """Return the files below some places that git tracks."""
    command = ["git", "ls-files", "-z", "--", *places]
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    return [Path(name) for name in listed.stdout.split("\0") if name]


if __name__ == "__main__":
    main()
