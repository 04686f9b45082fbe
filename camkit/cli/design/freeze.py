"""`camkit freeze`: a lens, a plate, or a PSF that was measured, to a frozen PSF.

With `--unit` it measures one camera body instead (unit.py).
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.errors import ContractError, UnsupportedError

if TYPE_CHECKING:
    from camkit.bundle.sensor import ColorSensor
    from camkit.bundle.stages import Wiener

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

        beside = {
            "--haze": haze,
            "--stress-out": stress_out,
            "--stress-haze": stress_haze,
            "--report": report,
            "--limit-db": None if limit_db == LIMIT_DB else limit_db,
            "--energy": energy,
            "--max-side-px": max_side_px,
            "--recipe": recipe if optics.suffix.lower() == SUFFIX else None,
        }
        _check_unit(unit=unit, beside=[name for name, value in beside.items() if value is not None])
    recipe = _default_recipe() if recipe is None else recipe
    if unit or captures:
        from camkit.cli.design.unit import measure_unit

        print_report(measure_unit(optics, captures or [], out, recipe, depths, focus_um), json_)
        return
    require_torch("camkit freeze")
    from camkit.bundle.frozen_optics import write_optics_files
    from camkit.cli.design.unit import focus_range_um
    from camkit.models_def.optics.freezer import FreezeRequest, freeze_optics
    from camkit.models_def.optics.optics_file import read_optics

    if (stress_haze is None) != (haze is None or stress_out is None):
        raise ContractError(
            "with --haze, --stress-out and --stress-haze go together; else omit --stress-haze"
        )
    sensor, bank = _camera_of(recipe)
    found = read_optics(optics)
    request = FreezeRequest(
        sensor=sensor,
        bank=bank,
        depths_mm=depths,
        limit_db=None if limit_db == LIMIT_DB else limit_db,
        energy=energy,
        max_side_px=max_side_px,
        focus_um=focus_range_um(found, focus_um),
        haze=haze is not None,
        stress=stress_out is not None,
    )
    frozen = freeze_optics(found, request)
    write_optics_files(frozen.optics, out, haze)
    if stress_out is not None and frozen.stress is not None:
        write_optics_files(frozen.stress, stress_out, stress_haze)
    if report is not None:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(frozen.facts, indent=2) + "\n", encoding="utf-8")
    print_report(frozen.facts, json_)


def _camera_of(recipe: Path) -> "tuple[ColorSensor, Wiener | None]":
    """Return the sensor of a recipe, and its bank."""
    from camkit.bundle.sensor import ColorSensor
    from camkit.bundle.stages import Wiener
    from camkit.models_def.training.kind import read_recipe, training_kind

    chosen = read_recipe(recipe)
    stages = training_kind(chosen.kind).design(chosen).stages
    if not isinstance(chosen.sensor, ColorSensor):
        raise UnsupportedError(f"a {chosen.sensor.type} sensor has no response to freeze a PSF for")
    return chosen.sensor, next((stage for stage in stages if isinstance(stage, Wiener)), None)


def _check_unit(*, unit: bool, beside: Sequence[str]) -> None:
    if not unit:
        raise ContractError("captures are for --unit, which measures the camera that took them")
    if beside:
        raise ContractError(f"--unit freezes nothing; leave {', '.join(beside)} out")


def _depths(text: str | None) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text is not None else ()
    except ValueError:
        raise ContractError(f"--depths-mm takes distances A,B,C in mm; got {text!r}") from None


def _default_recipe() -> Path:
    from importlib import resources

    return Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
