"""A record: what a checkout computes, entry by entry.

{"commit": ..., "entries": {"BUNDLE CAPTURE WAY": {hashes, plan, warnings, ..., "seconds"}}}
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from tools.evidence.captures import Capture, simulate_captures
from tools.evidence.checkout import Checkout, Worker
from tools.evidence.commands import run_commands
from tools.evidence.real import real_jobs
from tools.evidence.scrubbed import scrubbed
from tools.evidence.ways import FIRST_PHOTOGRAPH, PHOTOGRAPHS, PHOTONS, Options, way_name

Entry = tuple[str, dict[str, Any]]

WITHOUT_BUNDLE: Final = ("duet", "spad-sr")
"""Bundles whose captures are processed without one too."""


def make_record(
    root: Path,
    bundles: list[str] | None = None,
    *,
    data: Path | None = None,
    is_judged: bool = False,
) -> dict[str, Any]:
    """Return the record of a checkout.

    Args:
        root: The checkout.
        bundles: Names of built-in bundles; None for all.
        data: A folder with real captures.
        is_judged: Whether to run also the commands that take minutes.
    """
    with tempfile.TemporaryDirectory() as work:
        checkout = Checkout(root=root.resolve(), work=Path(work).resolve())
        entries: dict[str, Any] = {}
        with Worker(checkout) as worker:
            for bundle in bundles or checkout.bundles:
                captures, simulated = simulate_captures(checkout, bundle)
                entries |= simulated
                entries |= dict(_processed(worker, bundle, captures))
                if captures[0].is_photograph:
                    entries |= dict(_golden(worker, bundle, checkout.manifest(bundle)))
                if bundle in WITHOUT_BUNDLE:
                    entries |= dict(_processed(worker, None, captures))
                entries |= dict(run_commands(checkout, bundle, captures, is_judged=is_judged))
                print(f"{bundle}: {len(entries)} entries so far", flush=True)
            for job in real_jobs(data, checkout.work) if data is not None else ():
                options = {k: v for k, v in job["options"].items() if k != "timing"}
                capture = Path(job["capture"]).name
                name = f"{job['bundle'] or 'none'} {capture} {way_name(options)}"
                entries[name] = worker.ask(job)
        folders = (*checkout.folders, f"{data}/") if data is not None else checkout.folders
        scrubbed_entries = {
            name: _scrubbed_entry(entry, folders) for name, entry in sorted(entries.items())
        }
        return {"commit": checkout.commit, "entries": scrubbed_entries}


def job_of(bundle: str | None, capture: Capture, way: Options) -> dict[str, Any]:
    """Return the job of processing a capture by a way."""
    return {
        "bundle": bundle,
        "kind": None if capture.is_photograph or bundle is not None else "spad",
        "capture": str(capture.path),
        "is_photograph": capture.is_photograph,
        "options": {**(capture.options if bundle is not None else {}), **way},
    }


def _scrubbed_entry(entry: dict[str, Any], folders: tuple[str, ...]) -> dict[str, Any]:
    return {**scrubbed(entry, folders), "seconds": entry.get("seconds")}


def _processed(worker: Worker, bundle: str | None, captures: list[Capture]) -> Iterator[Entry]:
    """Process every capture by every way."""
    first, *_ = captures
    ways = [(way, captures) for way in (PHOTOGRAPHS if first.is_photograph else PHOTONS)]
    ways += [(way, [first]) for way in (FIRST_PHOTOGRAPH if first.is_photograph else ())]
    for way, some in ways:
        for capture in some:
            # without a bundle, the file's name says whose capture it is
            name = f"{bundle} {capture.name}" if bundle else f"none {capture.path.stem}"
            yield f"{name} {way_name(way)}", worker.ask(job_of(bundle, capture, way))


def _golden(worker: Worker, bundle: str, manifest: dict[str, Any]) -> Iterator[Entry]:
    """Process the arrays of golden cases with every size of network."""
    sizes = {size for sizes in manifest["networks"].values() for size in sizes}
    for way in [{}, *({"size": size} for size in sorted(sizes))]:
        for case in manifest["golden"]:
            words = {"bundle": bundle, "case": case["name"], "options": way}
            yield f"{bundle} golden-{case['name']} {way_name(way)}", worker.ask(words)
