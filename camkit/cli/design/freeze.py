"""`camkit freeze`: a lens, a plate, or a PSF that was measured, to a frozen PSF."""

import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError, UnsupportedError

if TYPE_CHECKING:
    from camkit.models_def.optics.diffraction.freezing import PlateReport
    from camkit.models_def.optics.freeze import FreezeReport


def freeze(
    optics: Annotated[
        Path,
        typer.Argument(
            help="A lens (.toml or .zmx), a plate (.toml, a name, or a bundle with one), or a "
            "measured PSF (.safetensors).",
            metavar="OPTICS",
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="The frozen PSF (.safetensors).")],
    recipe: Annotated[
        Path | None,
        typer.Option(help="Recipe (TOML) with the sensor and its Wiener bank; default: duet's."),
    ] = None,
    depths_mm: Annotated[
        str | None,
        typer.Option(help="Object distances, near to far, such as 500,700,1500; default: lens's."),
    ] = None,
    limit_db: Annotated[float, typer.Option(help="Mean loss allowed for the samples.")] = 0.05,
    energy: Annotated[
        float | None,
        typer.Option(
            help="Least share of the light of a colour inside the kernels; default: 0.995, of a "
            "plate 0.999 or what the largest side holds."
        ),
    ] = None,
    max_side_px: Annotated[
        int | None,
        typer.Option(help="Largest side of a kernel, odd; default: 151, of a plate 401."),
    ] = None,
    stress_out: Annotated[
        Path | None, typer.Option(help="Also write kernels off the design point there.")
    ] = None,
    report: Annotated[
        Path | None, typer.Option(help="Also write the report there, as JSON for `export`.")
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Keep as few PSF samples of a lens or a plate as the stated loss allows (needs torch)."""
    from camkit.cli.design.design_time import print_report, refuse_existing, require_torch

    require_torch("camkit freeze")
    refuse_existing([out, stress_out, report], overwrite=overwrite)
    from camkit.bundle.psf_file import write_psf
    from camkit.bundle.sensor import ColorSensor
    from camkit.bundle.stages import Wiener
    from camkit.models_def.optics.diffraction.freezing import WINDOW, freeze_plate
    from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
    from camkit.models_def.optics.freeze import FreezeGrid, freeze_optics, freeze_stress
    from camkit.models_def.optics.optics_file import read_optics
    from camkit.models_def.training.kind import read_recipe, training_kind

    depths = _depths(depths_mm)
    chosen = read_recipe(_default_recipe() if recipe is None else recipe)
    stages = training_kind(chosen.kind).design(chosen).stages
    if not isinstance(chosen.sensor, ColorSensor):
        raise UnsupportedError(f"a {chosen.sensor.type} sensor has no response to freeze a PSF for")
    found = read_optics(optics)
    base = WINDOW if isinstance(found, PlateOptics) else FreezeGrid()
    grid = replace(
        base,
        depths_mm=depths,
        energy=base.energy if energy is None else energy,
        max_side_px=base.max_side_px if max_side_px is None else max_side_px,
        # who says how much is wanted gets no less
        least_energy=base.least_energy if energy is None else None,
    )
    out.parent.mkdir(parents=True, exist_ok=True)
    told: FreezeReport | PlateReport
    if isinstance(found, PlateOptics):
        told = freeze_plate(found, out, sensor=chosen.sensor, grid=grid, tell=_tell)
    else:
        told = freeze_optics(
            found,
            out,
            sensor=chosen.sensor,
            settings=next((stage for stage in stages if isinstance(stage, Wiener)), None),
            limit_db=limit_db,
            grid=grid,
            tell=_tell,
        )
    if stress_out is not None:
        stress_out.parent.mkdir(parents=True, exist_ok=True)
        write_psf(stress_out, freeze_stress(found, chosen.sensor, grid).psf)
    if report is not None:
        report.parent.mkdir(parents=True, exist_ok=True)
        report.write_text(json.dumps(told.to_json(), indent=2) + "\n", encoding="utf-8")
    print_report(told.to_json(), json_)


def _tell(line: str) -> None:
    say(line, err=True)


def _depths(text: str | None) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text is not None else ()
    except ValueError:
        raise ContractError(f"--depths-mm takes distances A,B,C in mm; got {text!r}") from None


def _default_recipe() -> Path:
    from importlib import resources

    return Path(str(resources.files("camkit.models_def.recipes"))) / "duet.toml"
