"""`camkit freeze`: a lens, a plate, or a PSF that was measured, to a frozen PSF.

With `--unit` it measures one camera body instead (unit.py).
"""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, NamedTuple

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.errors import ContractError, UnsupportedError
from camkit.progress import note, working

if TYPE_CHECKING:
    from camkit.bundle.frozen_optics import FrozenOptics
    from camkit.bundle.sensor import ColorSensor
    from camkit.bundle.stages import Wiener
    from camkit.models_def.optics.diffraction.freezing import PlateReport
    from camkit.models_def.optics.freeze import FreezeGrid, FreezeReport
    from camkit.models_def.optics.optics import Optics

LIMIT_DB: Final = 0.05


def freeze(
    optics: Annotated[
        Path,
        typer.Argument(
            help="Lens (.toml, .zmx), plate (.toml, name, bundle) or measured PSF (.safetensors).",
            metavar="OPTICS",
        ),
    ],
    captures: Annotated[
        list[Path] | None,
        typer.Argument(
            help="With --unit: captures of dark squares on white.", metavar="[CAPTURES]..."
        ),
    ] = None,
    *,
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--out",
            help="PSF to write (.safetensors), or with --unit the camera body (.toml).",
        ),
    ],
    unit: Annotated[
        bool,
        typer.Option("--unit", help="Measure the focus of the camera body that took CAPTURES."),
    ] = False,
    recipe: Annotated[
        Path | None,
        typer.Option(help="Recipe (.toml) with the sensor and its Wiener bank; default: duet's."),
    ] = None,
    depths_mm: Annotated[
        str | None,
        typer.Option(
            help="Object distances in mm, near to far, such as 500,700,1500; default: the lens's."
        ),
    ] = None,
    limit_db: Annotated[
        float, typer.Option(help="Largest mean loss in dB from storing fewer PSF samples.")
    ] = LIMIT_DB,
    energy: Annotated[
        float | None,
        typer.Option(
            help="Least share of each colour's light inside the kernels; default: 0.995, plates "
            "0.999."
        ),
    ] = None,
    max_side_px: Annotated[
        int | None,
        typer.Option(help="Largest kernel side in px, odd; default: 151, plates 401."),
    ] = None,
    focus_um: Annotated[
        str | None,
        typer.Option(
            help="Also store kernels for a sensor shifted by up to this many um, or 'auto'; "
            "default: none."
        ),
    ] = None,
    haze: Annotated[
        Path | None,
        typer.Option(
            help="Store only sharp peaks as kernels; write the veiling glare to this file "
            "(.safetensors)."
        ),
    ] = None,
    stress_out: Annotated[
        Path | None,
        typer.Option(help="Also write kernels off the design point to this file (.safetensors)."),
    ] = None,
    stress_haze: Annotated[
        Path | None,
        typer.Option(
            help="With --haze and --stress-out: also write the veiling glare of those kernels."
        ),
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also write the report for `export` to this file (.json).")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Compute the PSF of a lens or a plate with as few samples as the loss allows (needs torch).

    With --unit nothing is frozen: the focus of the camera body that took CAPTURES is measured.
    """
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    refuse_existing([out, haze, stress_out, stress_haze, report], overwrite=overwrite)
    depths = _depths(depths_mm)
    if unit or captures:
        from camkit.bundle.reader import SUFFIX

        others = {
            "--haze": haze,
            "--stress-out": stress_out,
            "--stress-haze": stress_haze,
            "--report": report,
            "--limit-db": None if limit_db == LIMIT_DB else limit_db,
            "--energy": energy,
            "--max-side-px": max_side_px,
            "--recipe": recipe if optics.suffix.lower() == SUFFIX else None,
        }
        _check_unit(
            unit=unit, options=[name for name, value in others.items() if value is not None]
        )
    recipe = _default_recipe() if recipe is None else recipe
    if unit or captures:
        from camkit.cli.design.unit import measure_unit

        print_report(measure_unit(optics, captures or [], out, recipe, depths, focus_um), json_)
        return
    require_torch("camkit freeze")
    from camkit.bundle.psf_file import write_psf
    from camkit.cli.design.unit import focus_range_um
    from camkit.models_def.optics.diffraction.freezing import WINDOW
    from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
    from camkit.models_def.optics.freeze import FreezeGrid, freeze_stress
    from camkit.models_def.optics.optics_file import read_optics

    sensor, bank = _camera_of(recipe)
    source = read_optics(optics)
    if (stress_haze is None) != (haze is None or stress_out is None):
        raise ContractError(
            "with --haze, --stress-out and --stress-haze go together; else omit --stress-haze"
        )
    if haze is not None:
        choices = {
            "--depths-mm": depths_mm is not None,
            "--limit-db": limit_db != LIMIT_DB,
            "--energy": energy is not None,
            "--max-side-px": max_side_px is not None,
            "--focus-um": focus_um is not None,
        }
        if conflicts := [name for name, is_set in choices.items() if is_set]:
            raise ContractError(f"--haze conflicts with {', '.join(conflicts)}")
        stress = None if stress_out is None or stress_haze is None else (stress_out, stress_haze)
        hazy_facts = _freeze_hazy(source, (out, haze), stress, sensor)
        _report(hazy_facts, report, json_)
        return
    moved_um = focus_range_um(source, focus_um)
    base = WINDOW if isinstance(source, PlateOptics) else FreezeGrid()
    grid = replace(
        base,
        depths_mm=depths,
        energy=base.energy if energy is None else energy,
        max_side_px=base.max_side_px if max_side_px is None else max_side_px,
        # who says how much is wanted gets no less
        least_energy=base.least_energy if energy is None else None,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    facts = _freeze(source, out, _FreezeSettings(sensor, bank, grid, limit_db, moved_um))
    if stress_out is not None:
        stress_out.parent.mkdir(parents=True, exist_ok=True)
        write_psf(stress_out, freeze_stress(source, sensor, grid).psf)
    _report(facts.to_json(), report, json_)


def _report(facts: dict[str, int | float | str], report: Path | None, json_: bool) -> None:
    """Write the report where it is wanted, and print it."""
    from camkit.cli.design.design_time import print_report

    if report is not None:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(facts, indent=2) + "\n", encoding="utf-8")
    print_report(facts, json_)


@working("freezing peaks and haze of the lens")
def _freeze_hazy(
    optics: "Optics",
    paths: tuple[Path, Path],
    stress: tuple[Path, Path] | None,
    sensor: "ColorSensor",
) -> dict[str, int | float | str]:
    """Freeze the peaks of a lens and the haze beside them, at other distances too if wanted.

    Nothing is written before all is known.
    """
    from camkit.contracts import depth_name
    from camkit.models_def.optics.lens_optics import LensOptics
    from camkit.models_def.optics.thin.freezing import freeze_hazy
    from camkit.models_def.optics.thin.nearer import freeze_distances

    if not isinstance(optics, LensOptics):
        raise UnsupportedError("--haze is for lenses only; leave it out")
    frozen, report = freeze_hazy(optics.lens, sensor, tell=note)
    facts = report.to_json()
    if stress is not None:
        distances = freeze_distances(optics.lens, sensor, tell=note)
        _write_optics(distances, *stress)
        facts["distances"] = ", ".join(map(depth_name, distances.psf.depths_mm))
    _write_optics(frozen, *paths)
    return facts


def _write_optics(frozen: "FrozenOptics", out: Path, haze_out: Path) -> None:
    """Write kernels and haze to two files."""
    from camkit.bundle.haze_file import write_haze
    from camkit.bundle.psf_file import write_psf

    assert frozen.haze is not None
    for path in (out, haze_out):
        path.parent.mkdir(parents=True, exist_ok=True)
    write_psf(out, frozen.psf)
    write_haze(haze_out, frozen.haze)


class _FreezeSettings(NamedTuple):
    """The settings of freezing."""

    sensor: "ColorSensor"
    bank: "Wiener | None"
    grid: "FreezeGrid"
    limit_db: float
    focus_um: float


@working("freezing the optics")
def _freeze(optics: "Optics", out: Path, settings: _FreezeSettings) -> "FreezeReport | PlateReport":
    from camkit.models_def.optics.diffraction.freezing import freeze_plate
    from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
    from camkit.models_def.optics.freeze import freeze_optics

    if isinstance(optics, PlateOptics):
        if settings.focus_um:
            raise UnsupportedError("a plate is frozen at its nominal focus; leave --focus-um out")
        return freeze_plate(optics, out, sensor=settings.sensor, grid=settings.grid, tell=note)
    return freeze_optics(
        optics,
        out,
        sensor=settings.sensor,
        settings=settings.bank,
        limit_db=settings.limit_db,
        grid=settings.grid,
        focus_um=settings.focus_um,
        tell=note,
    )


def _camera_of(recipe: Path) -> "tuple[ColorSensor, Wiener | None]":
    """Return the sensor of a recipe, and its bank."""
    from camkit.bundle.sensor import ColorSensor
    from camkit.bundle.stages import Wiener
    from camkit.models_def.training.kind import read_recipe, training_kind

    plan = read_recipe(recipe)
    stages = training_kind(plan.kind).design(plan).stages
    if not isinstance(plan.sensor, ColorSensor):
        raise UnsupportedError(f"a {plan.sensor.type} sensor has no response to freeze a PSF for")
    return plan.sensor, next((stage for stage in stages if isinstance(stage, Wiener)), None)


def _check_unit(*, unit: bool, options: Sequence[str]) -> None:
    if not unit:
        raise ContractError("captures are for --unit, which measures the camera that took them")
    if options:
        raise ContractError(f"--unit freezes nothing; leave {', '.join(options)} out")


def _depths(text: str | None) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text is not None else ()
    except ValueError:
        raise ContractError(f"--depths-mm takes distances A,B,C in mm; got {text!r}") from None


def _default_recipe() -> Path:
    from importlib import resources

    return Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
