"""The gain of a bank that works from the samples of the mosaic, and its cost.

    python -m tools.comparison.mosaic_gain --data VALID_OPEN -o docs/results/mosaic.json

The bundle's bank with all colours together, from demosaicked planes and, with `[wiener.mosaic]` of
the recipe, from samples: the same captures through fabricated copies traced afresh, picture i
through copy i, restored by the runtime. PSNR on sRGB values; gains are paired, their error is that
over pictures. `everywhere` lets the samples count at every place, to show where they pay. The CPU
time of a block and of a place on the axis is measured in turn, medians.
"""

import argparse
import json
import statistics
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.bundle.stages import Mosaic, Together, Wiener
from camkit.errors import ContractError
from camkit.report.bench.machine import describe_machine
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import FIELD_SHARES, Shot, inner_srgb, list_set, psnr, read_picture
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.bank.wiener import place_knowledge, wiener_filter
from tools.capture.simulated import color_sensor
from tools.comparison.paired import mean_and_error
from tools.comparison.photograph import Restorer, bundle_restorer, photograph
from tools.tables.records import to_compact_json

ISOS: Final = (100.0, 400.0, 1600.0)
PLACES: Final = (0, 1, 2, 3)
"""Of `FIELD_SHARES`: from the axis to three quarters."""
RECIPE: Final = Path("models_def/recipes/duet.toml")
TODAY, NEAR_AXIS, EVERYWHERE = "together", "mosaic", "everywhere"
RED: Final = (0, 0)
ROUNDS: Final = 60
DIGITS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One capture.

    Attributes:
        picture: Name of the file.
        position: Index into `FIELD_SHARES`.
        iso: Sensitivity.
        psnr_db: Way -> dB.
    """

    picture: str
    position: int
    iso: float
    psnr_db: Mapping[str, float]


def main(words: Sequence[str] | None = None) -> None:
    """Measure and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--recipe", type=Path, default=RECIPE, help="with [wiener.mosaic]")
    parser.add_argument("--bundle", default="duet", help="NAME or PATH")
    parser.add_argument("--size", help="judge behind this network, as it ships; without, the bank")
    parser.add_argument("--data", type=Path, required=True, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, help="the first of them by name")
    parser.add_argument("--work-dir", type=Path, default=Path("runs/quality"), help="traced PSFs")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    bundle = open_bundle(find_bundle(arguments.bundle))
    ways = ways_of(bundle, arguments.recipe)
    pictures = list_set(arguments.data, arguments.pictures)
    choice = {"size": arguments.size} if arguments.size else {"method": "wiener"}
    captures = judge(
        {way: bundle_restorer(camera, **choice) for way, camera in ways.items()},
        bundle,
        pictures,
        arguments.work_dir / "psf",
    )
    record = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "behind": arguments.size,
        "captures": len(captures),
        "psnr_db": {way: statistics.fmean(one.psnr_db[way] for one in captures) for way in ways},
        "gain_db": gains(captures),
        "by_place": {
            f"{FIELD_SHARES[position]:g}": {
                f"{iso:g}": gains([x for x in captures if (x.position, x.iso) == (position, iso)])
                for iso in ISOS
            }
            for position in PLACES
        },
        "cpu_ms": cpu_ms({way: ways[way] for way in (TODAY, EVERYWHERE)}),
    }
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")


def ways_of(bundle: Bundle, recipe: Path) -> dict[str, Bundle]:
    """Return the bundle with each of the banks.

    Raises:
        ContractError: If the recipe does not say where the mosaic counts.
    """
    table = tomllib.loads(recipe.read_text(encoding="utf-8")).get("wiener", {})
    if "mosaic" not in table or "together" not in table:
        raise ContractError(f"{recipe.name} has no tables [wiener.together] and [wiener.mosaic]")
    together = Together.model_validate(table["together"])
    mosaic = Mosaic.model_validate(table["mosaic"])
    everywhere = mosaic.model_copy(update={"within_mm": 1e6})
    return {
        way: _with_bank(bundle, {"together": together, "mosaic": samples})
        for way, samples in ((TODAY, None), (NEAR_AXIS, mosaic), (EVERYWHERE, everywhere))
    }


def _with_bank(bundle: Bundle, changed: Mapping[str, Any]) -> Bundle:
    """Return a bundle with other numbers in its bank; its hash stays."""
    stages = tuple(
        stage.model_copy(update=changed) if isinstance(stage, Wiener) else stage
        for stage in bundle.manifest.stages
    )
    return replace(bundle, manifest=bundle.manifest.model_copy(update={"stages": stages}))


def judge(
    restorers: Mapping[str, Restorer], bundle: Bundle, pictures: Sequence[Path], cache: Path
) -> list[Judged]:
    """Photograph pictures and judge what every way makes of them."""

    @lru_cache
    def lens(copy: int) -> FrozenOptics:
        return fabricated_optics(bundle, copy, cache_folder=cache)

    captures = []
    for number, picture in enumerate(pictures):
        for position in PLACES:
            for iso in ISOS:
                shot = Shot(
                    set_name=picture.parent.name,
                    picture=picture,
                    number=number,
                    position=position,
                    iso=iso,
                    psf="fresh",
                )
                capture = photograph(
                    shot, read_picture(picture), bundle, lens(shot.fabrication_seed)
                )
                judged = {
                    way: psnr(*inner_srgb(restore(capture), capture.sharp))
                    for way, restore in restorers.items()
                }
                captures.append(
                    Judged(picture=picture.name, position=position, iso=iso, psnr_db=judged)
                )
        print(picture.name, json.dumps(gains(captures)), flush=True)
    return captures


def gains(captures: Sequence[Judged]) -> dict[str, dict[str, float | None]]:
    """Return mean, error and least gain over demosaicked planes, by way."""
    entries: dict[str, dict[str, float | None]] = {}
    for way in (NEAR_AXIS, EVERYWHERE):
        differences = [one.psnr_db[way] - one.psnr_db[TODAY] for one in captures]
        mean, error = mean_and_error(differences, [one.picture for one in captures])
        entries[way] = {"mean": mean, "se": error, "least": min(differences)}
    return entries


def cpu_ms(ways: Mapping[str, Bundle]) -> dict[str, dict[str, float]]:
    """Return CPU-milliseconds of a block, tapered and filtered, and of a place on the axis."""
    calls = {(way, part): c for way, one in ways.items() for part, c in _work_of(one).items()}
    times: dict[tuple[str, str], list[float]] = {key: [] for key in calls}
    for _ in range(ROUNDS):
        for key, call in calls.items():
            began = time.process_time()
            call()
            times[key].append(time.process_time() - began)
    medians: dict[str, dict[str, float]] = {way: {} for way in ways}
    for (way, part), seconds in times.items():
        medians[way][part] = 1e3 * statistics.median(seconds)
    return medians


def _work_of(bundle: Bundle) -> dict[str, Callable[[], object]]:
    """Return what makes a place on the axis, and what restores a block there."""
    entry, sensor = bundle.manifest.stage(Wiener), color_sensor(bundle)
    know = None if entry is None else place_knowledge(entry, RED)
    if entry is None or know is None:
        raise ContractError(f"{bundle.manifest.name} has no bank that restores colours together")
    ring, restore = entry.overlap_px // 4, wiener_filter(entry, sensor.noise_at(ISOS[0]))
    kernels = color_kernels(bundle.psf, *sensor.response_arrays()).at(0.0, 0.0)
    side = max(entry.block_px, *kernels.shape[1:])
    planes = np.random.default_rng(0).random((3, side, side), dtype=np.float32)
    otf = to_otf(kernels, side)
    knowledge = know(otf, 0.0)

    def block() -> object:
        tapered = taper_edges(planes, otf, ring)
        return restore(Block(samples=tapered, otf=otf, knowledge=knowledge, red=RED))

    return {"block": block, "place": lambda: know(to_otf(kernels, side), 0.0)}


if __name__ == "__main__":
    main()
