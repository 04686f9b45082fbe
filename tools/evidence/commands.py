"""The commands with `--json` of a record, and the files that they write."""

import shutil
from collections.abc import Iterator
from typing import Any, Final

from tools.evidence.captures import SCENES, Capture
from tools.evidence.checkout import Checkout
from tools.evidence.samples import file_samples
from tools.evidence.scrubbed import printed_values

Words = tuple[str, ...]

OUT: Final = "out"
FORMATS: Final[tuple[Words, ...]] = (
    *(("--format", name) for name in ("tiff", "png", "jpeg", "dng")),
    ("--format", "tiff", "--linear", "--color", "acescg"),
    ("--format", "png", "--strip-metadata", "--preview"),
    ("--bundle", "none"),
)
FORMATS_OF_PHOTONS: Final[tuple[Words, ...]] = (
    *(("--format", name) for name in ("exr", "tiff")),
    ("--product", "transient", "--format", "exr"),
    ("--bundle", "none"),
)
WITH_FORMATS: Final = {
    **dict.fromkeys(("duet", "streak-hdr"), ("photo", FORMATS)),
    "spad-sr": ("scan", FORMATS_OF_PHOTONS),
}
"""Bundle -> capture that is written in every format; writers know no bundle."""
DARK: Final = (
    *("simulate", str(SCENES / "coffee.png"), "--bundle", "duet", "--exposure", "0.25"),
    *("--out", "duet-dark.dng"),
)
FURTHER: Final[dict[str, tuple[Words, ...]]] = {
    "duet": (
        DARK,
        ("merge", "duet-dark.dng", "duet-photo.dng", "--times", "0.25,1", "--out", f"{OUT}/m.exr"),
    ),
}
"""Of single bundles."""
JUDGED: Final[dict[str, tuple[Words, ...]]] = {
    "duet": (
        ("stress", "duet", "--quick"),
        ("bench", "duet", "--quick"),
        ("analyse", "field", "duet"),
        ("analyse", "hallucination", "duet", "--data", str(SCENES), "--pictures", "2"),
    ),
    **{name: (("stress", name, "--quick"),) for name in ("streak-hdr", "spad-sr", "thin-plate")},
}


def run_commands(
    checkout: Checkout, bundle: str, captures: list[Capture], *, is_judged: bool
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield what commands told and wrote, by their words.

    Args:
        checkout: Whose commands.
        bundle: Name of a built-in bundle.
        captures: Its captures.
        is_judged: Whether to run also what takes minutes: all of `check`, and `JUDGED`.
    """
    lines = list(_usual(bundle, captures))
    lines.append(("check", bundle, *(() if is_judged else ("--level", "graph"))))
    lines += JUDGED.get(bundle, ()) if is_judged else ()
    for line in lines:
        where = ("--out-dir", OUT) if line[0] in {"plan", "process"} else ()
        process, seconds = checkout.command([*line, *where, "--json"])
        values = printed_values(process, checkout.folders)
        folder = checkout.work / OUT
        files = {path.name: file_samples(path) for path in sorted(folder.glob("*"))}
        shutil.rmtree(folder, ignore_errors=True)
        name = " ".join(line).replace(f"{SCENES}", "SCENES")
        yield f"camkit {name}", {**values, "files": files, "seconds": seconds}


def _usual(bundle: str, captures: list[Capture]) -> Iterator[Words]:
    """Yield the commands that take seconds."""
    names = [capture.path.name for capture in captures]
    force = ("--force-bundle",) if captures[0].options else ()
    yield ("info", bundle)
    yield from (("info", name) for name in names)
    for command in ("plan", "process"):
        yield (command, *names, "--bundle", bundle, *force)
    name, formats = WITH_FORMATS.get(bundle, ("", ()))
    yield from (
        ("process", c.path.name, *some) for c in captures if c.name == name for some in formats
    )
    yield from FURTHER.get(bundle, ())
