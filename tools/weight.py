"""Refuse what makes the repository heavy: other bytes under one version, checkpoints, big pictures.

    python -m tools.weight                     check; part of `make check`
    python -m tools.weight --update duet ...   write the lines of bundles with a new version

`camkit/bundles/bundles.toml` has a line for every built-in bundle: version, SHA-256 and bytes. A
bundle may change with its version alone, so that the history grows by one commit per version.
"""

import argparse
import hashlib
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from camkit.bundle.reader import open_bundle

ROOT: Final = Path(__file__).resolve().parents[1]
BUNDLES: Final = Path("camkit", "bundles")
LIST: Final = BUNDLES / "bundles.toml"
HEAD: Final = "# The built-in bundles. `python -m tools.weight --update NAME` writes a line.\n"
CHECKPOINTS: Final = frozenset({".pt", ".pth", ".ckpt"})
MOST_TENSOR_BYTES: Final = 100_000
"""Of a .safetensors outside tests: a plate, not the weights of a network."""
PICTURES: Final = frozenset({".png", ".jpg", ".jpeg", ".gif", ".webp", ".svg", ".tif", ".tiff"})
MOST_PICTURE_BYTES: Final = 300_000
LARGER_PICTURES: Final = {
    "docs/results/lens-table/edof.png": 403_534,
    "docs/results/lens-table/lfov.png": 550_068,
    "tools/scenes/coffee.png": 439_524,
}
"""Pictures that were larger before there was a limit, as small as they are without loss."""

Line = dict[str, Any]


def main(words: Sequence[str] | None = None) -> int:
    """Check, or write lines; return the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--update", nargs="+", metavar="NAME", help="bundles with a new version")
    arguments = parser.parse_args(words)
    if arguments.update:
        update_lines(ROOT, arguments.update)
        return 0
    faults = [*bundle_faults(ROOT), *file_faults(ROOT, _tracked_files(ROOT))]
    print(*faults, sep="\n", end="\n" if faults else "")
    return int(bool(faults))


def bundle_faults(root: Path) -> Iterator[str]:
    """Yield what is wrong between the bundles of a checkout and their list."""
    lines, bundle_lines = read_lines(root), _bundle_lines(root)
    for name in sorted(lines.keys() - bundle_lines.keys()):
        yield f"{LIST}: there is no bundle {name}; take its line out"
    for name, line in bundle_lines.items():
        listed = lines.get(name)
        if listed is None:
            yield f"{LIST} lacks {name}: {_hint(name)}"
        elif listed["version"] != line["version"]:
            yield (
                f"{LIST} knows {name} {listed['version']}, the bundle is {line['version']}: "
                f"{_hint(name)}"
            )
        elif listed != line:
            yield _same_version(name, line)


def file_faults(root: Path, tracked: Iterable[str]) -> Iterator[str]:
    """Yield the checkpoints and large pictures among files of a checkout."""
    for name in tracked:
        path = root / name
        size = path.stat().st_size if path.is_file() else 0
        suffix, limit = path.suffix.lower(), LARGER_PICTURES.get(name, MOST_PICTURE_BYTES)
        if suffix in CHECKPOINTS:
            yield f"{name}: checkpoints are not committed; export a bundle"
        elif suffix == ".safetensors" and size > MOST_TENSOR_BYTES and not name.startswith("tests"):
            yield f"{name}: {size} bytes of tensors, more than {MOST_TENSOR_BYTES}"
        elif suffix in PICTURES and size > limit:
            yield f"{name}: a picture of {size} bytes, more than {limit}; make it smaller"


def update_lines(root: Path, names: Sequence[str]) -> None:
    """Write the lines of some bundles anew.

    Raises:
        SystemExit: If one is no bundle, or its bytes changed and its version did not.
    """
    lines, bundle_lines = read_lines(root), _bundle_lines(root)
    for name in names:
        if name not in bundle_lines:
            raise SystemExit(f"there is no bundle {name}; there are {', '.join(bundle_lines)}")
        listed = lines.get(name)
        if listed is not None and listed["version"] == bundle_lines[name]["version"]:
            if listed != bundle_lines[name]:
                raise SystemExit(_same_version(name, bundle_lines[name]))
            continue
        lines[name] = bundle_lines[name]
    text = "".join(
        f'{name} = {{version = "{line["version"]}", sha256 = "{line["sha256"]}", '
        f"bytes = {line['bytes']}}}\n"
        for name, line in sorted(lines.items())
    )
    (root / LIST).write_text(HEAD + text, encoding="utf-8")


def read_lines(root: Path) -> dict[str, Line]:
    """Read the list of a checkout; empty where there is none."""
    path = root / LIST
    return tomllib.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _bundle_lines(root: Path) -> dict[str, Line]:
    """Return the lines that the bundles of a checkout should have."""
    lines = {}
    for path in sorted((root / BUNDLES).glob("*.camkit")):
        content = path.read_bytes()
        lines[path.stem] = {
            "version": open_bundle(path).manifest.version,
            "sha256": hashlib.sha256(content).hexdigest(),
            "bytes": len(content),
        }
    return lines


def _hint(name: str) -> str:
    return f"run `python -m tools.weight --update {name}`"


def _same_version(name: str, line: Line) -> str:
    return (
        f"{name} {line['version']} has other bytes than its line in {LIST}: give the bundle a new "
        "version, or take the old bytes back"
    )


def _tracked_files(root: Path) -> list[str]:
    """Return the names of the files that git tracks."""
    words = ["git", "-C", str(root), "ls-files", "-z"]
    listing = subprocess.run(words, capture_output=True, text=True, check=True)
    return [name for name in listing.stdout.split("\0") if name]


if __name__ == "__main__":
    sys.exit(main())
