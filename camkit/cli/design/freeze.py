"""`camkit freeze`: a lens, a plate, or a PSF that was measured, to a frozen PSF.

With `--unit` it measures one camera body instead, by `camkit.calibrate.camera_body`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final

import typer

from camkit.cli.choices import (
    Configuration,
    Debug,
    GlassCatalogues,
    GlassFiles,
    Json,
    Overwrite,
    several_states,
)
from camkit.errors import ContractError

LIMIT_DB: Final = 0.05


def freeze(
    optics: Annotated[
        Path,
        typer.Argument(
            help="Lens (.toml, .zmx, .json), plate (.toml, name, bundle) or measured PSF "
            "(.safetensors).",
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
    quick: Annotated[
        bool,
        typer.Option(
            "--quick", help="Take 7 fields and 5 wavelengths without a search: a preview."
        ),
    ] = False,
    glass: GlassFiles = None,
    catalogue: GlassCatalogues = None,
    configuration: Configuration = None,
    configurations: Annotated[
        str | None,
        typer.Option(
            help="States of a lens in one file: all, or NAME,NAME; the first is usual; default: "
            "one."
        ),
    ] = None,
    psf_model: Annotated[
        str | None,
        typer.Option(
            help="PSF of a lens: rays or waves; default: waves where its spot is that sharp."
        ),
    ] = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Compute the PSF of a lens or a plate with as few samples as the loss allows (needs torch).

    With --unit nothing is frozen: the focus of the camera body that took CAPTURES is measured.
    """
    from camkit.cli.design.design_time import print_report

    depths = _depths(depths_mm)
    if unit or captures:
        from camkit.bundle.reader import SUFFIX
        from camkit.calibrate import body_focus

        options = {
            "--haze": haze,
            "--stress-out": stress_out,
            "--stress-haze": stress_haze,
            "--report": report,
            "--quick": quick or None,
            "--glass": glass,
            "--catalogue": catalogue,
            "--configuration": configuration,
            "--configurations": configurations,
            "--psf-model": psf_model,
            "--limit-db": None if limit_db == LIMIT_DB else limit_db,
            "--energy": energy,
            "--max-side-px": max_side_px,
            "--recipe": recipe if optics.suffix.lower() == SUFFIX else None,
        }
        _check_unit([name for name, value in options.items() if value is not None], unit=unit)
        focus = body_focus.camera_body(
            optics,
            captures or (),
            out,
            recipe=recipe,
            depths_mm=depths,
            focus_um=focus_um,
            overwrite=overwrite,
        )
        print_report({**focus.to_json(), "out": str(out)}, json_)
        return
    from camkit.models_def.face import optics_freezing

    facts = optics_freezing.freeze(
        optics,
        out,
        recipe=recipe,
        depths_mm=depths,
        limit_db=None if limit_db == LIMIT_DB else limit_db,
        energy=energy,
        max_side_px=max_side_px,
        focus_um=focus_um,
        haze=haze,
        stress_out=stress_out,
        stress_haze=stress_haze,
        report=report,
        quick=quick,
        glass=tuple(glass or ()),
        catalogue=catalogue,
        configuration=configuration,
        configurations=several_states(configurations),
        psf_model=psf_model,
        overwrite=overwrite,
    )
    print_report(facts, json_)


def _check_unit(options: Sequence[str], *, unit: bool) -> None:
    if not unit:
        raise ContractError("captures are for --unit, which measures the camera that took them")
    if options:
        raise ContractError(f"--unit freezes nothing; leave {', '.join(options)} out")


def _depths(text: str | None) -> tuple[float, ...]:
    try:
        return tuple(float(part) for part in text.split(",")) if text is not None else ()
    except ValueError:
        raise ContractError(f"--depths-mm takes distances A,B,C in mm; got {text!r}") from None
