"""What the focus of a unit is worth: measured on a target, used by the bank, copy by copy.

    python -m tools.comparison.unit_focus --data PICTURES -o docs/results/unit-focus.json

With `--recipe RECIPE`, whose `[wiener.together]` is of `camkit fit-bank`, also by the bank that
restores colours together.

Kernels with the sensor moved are traced for the bundle's lens and added to it. Freshly traced
copies of the lens photograph dark squares at four places of the field (ISO 100); their focus is
measured on that (`camkit freeze --unit`). Then they photograph the pictures at five places in
turn, at ISO 100 and 1600, and the bank alone restores them, with the unit's focus and without.
Copies of `--outliers` are chosen for their large error. For each copy: the relative RMS error of
the transfer of the kernels below 0.3 cycles/px over five heights, and PSNR on sRGB values, paired,
with the standard error over captures. `blend` says how far from kernels traced there those are
that are blended, linearly as in use or by a parabola: the same error, at a half of their reach.
"""

import argparse
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import format_of
from camkit.bundle.optics import PSF
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import PRESCRIPTION, Bundle, bundle_from_bytes, find_bundle, open_bundle
from camkit.bundle.writer import bundle_to_bytes
from camkit.calibration.focus import EdgeCamera, MeasuredFocus, measure_focus
from camkit.contracts import FloatArray, FrozenPsf
from camkit.errors import ContractError
from camkit.models_def.optics.frozen import with_focus
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import parse_prescription
from camkit.report.bench.machine import describe_machine
from camkit.report.fabricated_optics import fabricated_optics
from camkit.report.quality import (
    FABRICATION_SEEDS,
    FIELD_SHARES,
    QUADRANTS,
    Shot,
    crop_origin,
    expose,
    inner_srgb,
    list_set,
    psnr,
    read_picture,
)
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate
from camkit.runtime.unit import FOCUS, Unit
from camkit.scenes.squares import squares_scene
from tools.capture.simulated import captured, color_sensor
from tools.comparison.bank_gain import ALONE, TOGETHER, restoring_together, together_of
from tools.comparison.compact_json import to_compact_json
from tools.comparison.copies import relative_error, transfer_error, transfers
from tools.comparison.paired import mean_and_error

ISOS: Final = (100.0, 1600.0)
TARGET_PX: Final = 640
MOST_PX: Final = 768
"""Of a side of a picture; its middle is taken."""
TARGET_SHARES: Final = (0.0, 0.35, 0.65, 0.95)
DIGITS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One copy.

    Attributes:
        copy: Seed of the lens.
        found: Its focus; None where it could not be told from the nominal one.
        why: What was said then.
        error: Of the transfer, with nominal kernels and those of the focus.
        gains_db: Bank -> capture by capture.
    """

    copy: int
    found: MeasuredFocus | None
    why: str
    error: tuple[float, float]
    gains_db: Mapping[str, tuple[float, ...]]

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        said = {"why": self.why} if self.found is None else self.found.to_json()
        error = {"nominal": self.error[0], "unit": self.error[1]}
        pictures = {
            bank: [i // len(ISOS) for i in range(len(g))] for bank, g in self.gains_db.items()
        }
        gains = {bank: gain(each, pictures[bank]) for bank, each in self.gains_db.items()}
        return {"copy": self.copy, **said, "transfer_error": error, "gain": gains}


def main(words: Sequence[str] | None = None) -> None:
    """Measure and write JSON."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--bundle", default="duet", help="NAME or PATH")
    parser.add_argument("--recipe", type=Path, help="with [wiener.together]")
    parser.add_argument("--data", type=Path, required=True, help="folder of sharp pictures")
    parser.add_argument("--pictures", type=int, help="the first of them by name")
    parser.add_argument("--copies", type=int, nargs="*", default=FABRICATION_SEEDS, help="seeds")
    parser.add_argument("--outliers", type=int, nargs="*", default=(), help="seeds, told apart")
    parser.add_argument("--focus-um", type=float, help="reach of the kernels; default: auto")
    parser.add_argument("--work-dir", type=Path, default=Path("runs/quality"), help="traced PSFs")
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args(words)
    bundle, range_um = refocusable(open_bundle(find_bundle(arguments.bundle)), arguments.focus_um)
    banks = {ALONE: bundle}
    if arguments.recipe is not None:
        banks[TOGETHER] = restoring_together(bundle, together_of(arguments.recipe))
    pictures = list_set(arguments.data, arguments.pictures)
    parts: dict[str, list[Judged]] = {"copies": [], "outliers": []}
    for part, judged in parts.items():
        for copy in getattr(arguments, part):
            lens = fabricated_optics(bundle, copy, cache_folder=arguments.work_dir / "psf")
            judged.append(judge(copy, lens, banks, pictures))
            print(json.dumps(judged[-1].to_json()), flush=True)
    record: dict[str, Any] = {
        "machine": describe_machine(),
        "bundle": bundle.manifest.name,
        "kernels_to_um": range_um,
        "pictures": len(pictures),
        "blend": blend_errors(bundle, range_um),
    }
    for part, judged in parts.items():
        gains = {
            bank: gain(
                [db for one in judged for db in one.gains_db[bank]],
                [one.copy for one in judged for _ in one.gains_db[bank]],
            )
            for bank in banks
        }
        record[part] = {"gain": gains, "each": [one.to_json() for one in judged]}
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    arguments.output.write_text(to_compact_json(record, DIGITS) + "\n", encoding="utf-8")


def refocusable(bundle: Bundle, range_um: float | None) -> tuple[Bundle, float]:
    """Return a bundle with kernels of its lens before a moved sensor, and how far that is moved."""
    lens = _lens_of(bundle)
    reach_um = lens.focus_range_um() if range_um is None else range_um
    psf, _ = with_focus(bundle.psf, (-reach_um, reach_um), lens.refocused, color_sensor(bundle))
    members = {name: bundle.member(name) for name in bundle.names} | {PSF: psf_to_bytes(psf)}
    stated = bundle.manifest
    version = format_of(psf, (), least=stated.version_pair)
    manifest = stated.model_copy(update={"format_version": version})
    return bundle_from_bytes(bundle_to_bytes(manifest, members), path=bundle.path), reach_um


def _lens_of(bundle: Bundle) -> LensOptics:
    return LensOptics(lens=parse_prescription(bundle.member(PRESCRIPTION).decode("utf-8")))


def judge(
    copy: int, lens: FrozenOptics, banks: Mapping[str, Bundle], pictures: Sequence[Path]
) -> Judged:
    """Measure the focus of a copy, and what it is worth to every bank."""
    found, why, bundle = None, "", banks[ALONE]
    try:
        found = measure_focus(
            target_captures(lens.psf, bundle),
            EdgeCamera(
                psf=bundle.psf, sensor=color_sensor(bundle), depth_mm=bundle.reference_depth_mm
            ),
        )
    except ContractError as refused:
        why = str(refused)
    focus_um = 0.0 if found is None else found.focus_um
    sensor = color_sensor(bundle)
    error = (
        transfer_error(bundle.psf, lens.psf, sensor),
        transfer_error(bundle.psf, lens.psf, sensor, focus_um=focus_um),
    )
    # who needs no file gains nothing
    gains = {bank: (0.0,) * (len(pictures) * len(ISOS)) for bank in banks}
    if found is not None:
        gains = gains_db(lens, banks, pictures, focus_um)
    return Judged(copy=copy, found=found, why=why, error=error, gains_db=gains)


def target_captures(lens: FrozenPsf, bundle: Bundle) -> list[tuple[str, Capture]]:
    """Photograph dark squares at some places of the field."""
    sensor, pipeline = color_sensor(bundle), Pipeline(bundle, Options(method="wiener", threads=1))
    whole, size = (sensor.width_px, sensor.height_px), (TARGET_PX, TARGET_PX)
    taken = []
    for number, share in enumerate(TARGET_SHARES):
        options = SimulationOptions(
            seed=number,
            origin_px=crop_origin(size, whole, share, QUADRANTS[number % len(QUADRANTS)]),
            depth_mm=bundle.reference_depth_mm,
        )
        simulation = simulate(squares_scene(number, TARGET_PX, TARGET_PX), sensor, lens, options)
        taken.append((f"target at {share:g}", captured(pipeline, simulation)))
    return taken


def gains_db(
    lens: FrozenOptics, banks: Mapping[str, Bundle], pictures: Sequence[Path], focus_um: float
) -> dict[str, tuple[float, ...]]:
    """Return what the focus gains each bank, capture by capture."""
    bundle = banks[ALONE]
    unit = Unit(name="copy", bundle_sha256=bundle.sha256, facts={FOCUS: focus_um})
    pipelines = {bank: [_bank(of, known) for known in (None, unit)] for bank, of in banks.items()}
    gains: dict[str, list[float]] = {bank: [] for bank in banks}
    for number, picture in enumerate(pictures):
        scene = read_picture(picture, MOST_PX)
        for iso in ISOS:
            shot = Shot(
                set_name=picture.parent.name,
                picture=picture,
                number=number,
                position=number % len(FIELD_SHARES),
                iso=iso,
                psf="fresh",
            )
            exposed = expose(shot, scene, bundle, lens)
            for bank, ways in pipelines.items():
                without, known = (_psnr_db(way, exposed.simulation, exposed.sharp) for way in ways)
                gains[bank].append(known - without)
    return {bank: tuple(each) for bank, each in gains.items()}


def _bank(bundle: Bundle, unit: Unit | None) -> Pipeline:
    options = Options(method="wiener", undistort=False, vignetting=True, threads=1, unit=unit)
    return Pipeline(bundle, options)


def _psnr_db(pipeline: Pipeline, simulation: Simulation, sharp: FloatArray) -> float:
    restored = pipeline.start(captured(pipeline, simulation)).fill()
    return psnr(*inner_srgb(restored, sharp))


def blend_errors(bundle: Bundle, range_um: float) -> dict[str, dict[str, float]]:
    """Return the relative RMS error of blended transfers half-way to either end of the reach."""
    lens, sensor = _lens_of(bundle), color_sensor(bundle)
    response = sensor.response_arrays()
    low, nominal, high = (
        transfers(color_kernels(bundle.psf, *response, focus_um=at))
        for at in (-range_um, 0.0, range_um)
    )
    halves = (-range_um / 2, range_um / 2)
    there, _ = with_focus(bundle.psf, halves, lens.refocused, sensor)
    found = {}
    for half_um, end, other in zip(halves, (low, high), (high, low), strict=True):
        traced = transfers(color_kernels(there, *response, focus_um=half_um))
        linear = (nominal + end) / 2
        parabola = 0.75 * nominal + 0.375 * end - 0.125 * other
        found[f"{half_um:g}"] = {
            "linear": relative_error(linear, traced),
            "parabola": relative_error(parabola, traced),
            "nominal": relative_error(nominal, traced),
        }
    return found


def gain(each_db: Sequence[float], groups: Sequence[int]) -> dict[str, float | None] | None:
    """Return the mean gain with its standard error over groups; None of nothing."""
    if not each_db:
        return None
    mean_db, error_db = mean_and_error(each_db, groups)
    return {"mean_db": mean_db, "se_db": error_db, "captures": len(each_db)}


if __name__ == "__main__":
    main()
