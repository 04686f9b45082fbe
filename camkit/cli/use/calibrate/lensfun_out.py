"""`camkit calibrate lensfun-out`: distortion and vignetting to an entry that lensfun reads."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import check_out, tell
from camkit.errors import ContractError, DecodeError


def lensfun_out(
    source: Annotated[
        Path,
        typer.Argument(
            help="A bundle, by its path or name, or what `calibrate geometry` wrote (.toml)."
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="The entry (.xml).")],
    focal_mm: Annotated[float, typer.Option(help="Focal length.")],
    lens_name: Annotated[
        str | None, typer.Option(help="Model of the lens; default: the name of the source.")
    ] = None,
    maker: Annotated[str, typer.Option(help="Maker of the lens.")] = "Generic",
    mount: Annotated[
        str, typer.Option(help="Mount of the camera, as the database names it.")
    ] = "Generic",
    crop_factor: Annotated[
        float | None,
        typer.Option(
            help="Of the camera; default: by the sensor of a bundle. A geometry needs it."
        ),
    ] = None,
    aperture: Annotated[
        float | None, typer.Option(help="F-number; with it the vignetting of a bundle is written.")
    ] = None,
    most_residual_px: Annotated[
        float, typer.Option(help="By which the model may miss the distortion.")
    ] = 0.5,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write distortion and vignetting of a bundle or a measured geometry for lensfun."""
    check_out(out, ".xml", "an entry of lensfun", overwrite=overwrite)
    from camkit.runtime.calibration.lensfun.database import check_positive
    from camkit.runtime.calibration.lensfun.entry import (
        Name,
        fit_distortion,
        fit_vignetting,
        to_xml,
    )
    from camkit.runtime.calibration.lensfun.models import TERMS
    from camkit.runtime.calibration.lensfun.source import read_source
    from camkit.runtime.output.part_file import atomic_output

    options = {"--focal-mm": focal_mm, "--crop-factor": crop_factor, "--aperture": aperture}
    for option, value in {**options, "--most-residual-px": most_residual_px}.items():
        if value is not None:
            check_positive(value, option)
    for option, text in {"--lens-name": lens_name, "--maker": maker, "--mount": mount}.items():
        if text is not None and not (text.strip() and text.isprintable()):
            raise ContractError(f"{option} must be a name; got {text!r}")
    known = read_source(source)
    crop = known.crop_factor if crop_factor is None else crop_factor
    if crop is None:
        raise ContractError(f"{source} does not tell how large the sensor is: say --crop-factor")
    fit = fit_distortion(known, focal_mm)
    if fit.residual_px > most_residual_px:
        raise DecodeError(
            f"{fit.distortion.model}, the nearest of lensfun's models, misses the distortion of "
            f"{known.name} by {fit.residual_px:.2f} px; --most-residual-px is {most_residual_px:g}"
        )
    notes, light, light_residual = list(known.notes), None, None
    if known.light is not None and aperture is not None:
        half_px = 0.5 * (known.size_px[0] ** 2 + known.size_px[1] ** 2) ** 0.5
        light, light_residual = fit_vignetting(known.light, half_px, focal_mm, aperture)
    elif known.light is not None:
        notes.append("vignetting is left out: it needs --aperture")
    named = Name(maker=maker, model=lens_name or known.name, mount=mount, crop_factor=crop)
    text = to_xml(named, known.size_px, fit.distortion, light)
    out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_output(out) as part:
        part.write_text(text, encoding="utf-8")
    model = fit.distortion.model
    record = {
        "lens": named.model,
        "crop_factor": crop,
        "model": model,
        "focal_mm": focal_mm,
        "terms": dict(zip(TERMS[model], fit.distortion.terms, strict=True)),
        "residual_px": round(fit.residual_px, 6),
        "scale": fit.scale,
        "vignetting": light and {"terms": list(light.terms), "residual": light_residual},
        "notes": notes,
        "out": str(out),
    }
    line = f"  {named.model}, {model} at {focal_mm:g} mm, misses by {fit.residual_px:.3f} px"
    tell(record, [line], as_json=json_)
