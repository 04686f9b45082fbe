"""A record: what a checkout computes, entry by entry.

{"commit": ..., "entries": {"BUNDLE CAPTURE WAY": {hashes, plan, warnings, ..., "seconds"}}}
"""

import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from tools.evidence.captures import Capture, simulate_captures
from tools.evidence.checkout import Checkout, Worker
from tools.evidence.samples import file_samples
from tools.evidence.scrubbed import scrubbed, told_values
from tools.evidence.ways import FIRST_PHOTOGRAPH, PHOTOGRAPHS, PHOTONS, Options, way_name

Entry = tuple[str, dict[str, Any]]

WITH_FORMATS: Final = ("duet", "streak-hdr", "spad-sr")
"""Bundles whose pictures are written in every format; writers know no bundle."""
FORMATS: Final = (
    *(("--format", name) for name in ("tiff", "png", "jpeg", "dng")),
    ("--format", "tiff", "--linear", "--color", "acescg"),
    ("--format", "png", "--strip-metadata", "--preview"),
)
FORMATS_OF_PHOTONS: Final = (
    *(("--format", name) for name in ("exr", "tiff")),
    ("--product", "transient", "--format", "exr"),
)


def make_record(root: Path, bundles: list[str] | None = None) -> dict[str, Any]:
    """Return the record of a checkout.

    Args:
        root: The checkout.
        bundles: Names of built-in bundles; None for all.
    """
    with tempfile.TemporaryDirectory() as work:
        checkout = Checkout(root=root.resolve(), work=Path(work).resolve())
        entries: dict[str, Any] = {}
        with Worker(checkout) as worker:
            for bundle in bundles or checkout.bundles:
                captures, entries_of_captures = simulate_captures(checkout, bundle)
                entries |= entries_of_captures
                entries |= dict(_processed(worker, bundle, captures))
                entries |= dict(_golden(worker, bundle, checkout.manifest(bundle)))
                entries |= dict(_commands(checkout, bundle, captures))
                print(f"{bundle}: {len(entries)} entries so far", flush=True)
        return {"commit": checkout.commit, "entries": scrubbed_entries(entries, checkout)}


def scrubbed_entries(entries: dict[str, Any], checkout: Checkout) -> dict[str, Any]:
    """Return entries of which only the seconds differ from run to run."""
    return {
        name: scrubbed(entry, checkout.folders) | {"seconds": entry.get("seconds")}
        for name, entry in sorted(entries.items())
    }


def _processed(worker: Worker, bundle: str, captures: list[Capture]) -> Iterator[Entry]:
    """Process every capture by every way."""
    is_photograph = captures[0].is_photograph
    first = captures[0]
    ways = [(way, captures) for way in (PHOTOGRAPHS if is_photograph else PHOTONS)]
    ways += [(way, [first]) for way in (FIRST_PHOTOGRAPH if is_photograph else ())]
    for way, some in ways:
        for capture in some:
            yield f"{bundle} {capture.name} {way_name(way)}", worker.ask(job(bundle, capture, way))


def job(bundle: str | None, capture: Capture, way: Options) -> dict[str, Any]:
    """Return the job of processing a capture by a way."""
    return {
        "bundle": bundle,
        "capture": str(capture.path),
        "is_photograph": capture.is_photograph,
        "options": {**capture.options, **way},
    }


def _golden(worker: Worker, bundle: str, manifest: dict[str, Any]) -> Iterator[Entry]:
    """Process the arrays of golden cases with every size of network."""
    sizes = {size for sizes in manifest["networks"].values() for size in sizes}
    for case in manifest["golden"]:
        for way in [{}, *({"size": size} for size in sorted(sizes))]:
            words = {"bundle": bundle, "case": case["name"], "options": way}
            yield f"{bundle} golden-{case['name']} {way_name(way)}", worker.ask(words)


def _commands(checkout: Checkout, bundle: str, captures: list[Capture]) -> Iterator[Entry]:
    """Run commands with `--json`, and read what they write."""
    names = [capture.path.name for capture in captures]
    is_forced = any(capture.options for capture in captures)
    with_bundle = ["--bundle", bundle, *(["--force-bundle"] if is_forced else [])]
    lines = [
        ["info", bundle],
        *(["info", name] for name in names),
        ["check", bundle, "--level", "graph"],
        ["plan", *names, *with_bundle],
        ["process", *names, *with_bundle],
    ]
    if bundle in WITH_FORMATS:
        is_photograph = captures[0].is_photograph
        formats = FORMATS if is_photograph else FORMATS_OF_PHOTONS
        lines += [["process", names[0 if is_photograph else 1], *some] for some in formats]
        lines.append(["process", names[0], "--bundle", "none"])
    for line in lines:
        out = checkout.work / "out"
        where = ["--out-dir", str(out)] if line[0] in {"plan", "process"} else []
        told, seconds = checkout.command([*line, *where, "--json"])
        files = {path.name: file_samples(path) for path in sorted(out.glob("*"))}
        found = told_values(told, checkout.folders)
        yield f"camkit {' '.join(line)}", {**found, "files": files, "seconds": seconds}
        shutil.rmtree(out, ignore_errors=True)
