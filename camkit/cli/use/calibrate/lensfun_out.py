"""`camkit calibrate lensfun-out`: distortion and vignetting to an entry that lensfun reads."""

from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.use.calibrate.outputs import Page, check_out, check_page, tell


def lensfun_out(
    source: Annotated[
        Path,
        typer.Argument(
            help="Bundle (NAME or PATH), or geometry (.toml of `camkit calibrate geometry`)."
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Entry for lensfun to write (.xml).")],
    focal_mm: Annotated[
        float | None,
        typer.Option(
            help="Focal length in mm, required for a bundle; default: that of the geometry."
        ),
    ] = None,
    lens_name: Annotated[
        str | None, typer.Option(help="Model of the lens; default: the name of the source.")
    ] = None,
    maker: Annotated[str, typer.Option(help="Maker of the lens.")] = "Generic",
    mount: Annotated[
        str, typer.Option(help="Mount of the camera, as named in the database.")
    ] = "Generic",
    crop_factor: Annotated[
        float | None,
        typer.Option(
            help="Crop factor, required for a geometry; default: from the sensor of the bundle."
        ),
    ] = None,
    aperture: Annotated[
        float | None,
        typer.Option(
            help="F-number at which the vignetting of a bundle is written; default: no vignetting."
        ),
    ] = None,
    most_residual_px: Annotated[
        float, typer.Option(help="Largest misfit of the distortion model in px.")
    ] = 0.5,
    page: Page = None,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write distortion and vignetting of a bundle or a measured geometry for lensfun."""
    check_out(out, ".xml", "an entry of lensfun", overwrite=overwrite)
    check_page(page, overwrite=overwrite)
    from camkit.calibration.lensfun.entry import EntryOptions, lensfun_entry
    from camkit.runtime.output.part_file import atomic_outputs

    options = EntryOptions(
        focal_mm=focal_mm,
        lens_name=lens_name,
        maker=maker,
        mount=mount,
        crop_factor=crop_factor,
        aperture=aperture,
        most_residual_px=most_residual_px,
    )
    entry = lensfun_entry(source, options)
    texts = {out: entry.to_xml()}
    if page is not None:
        from camkit.report.calibration.lensfun_page import entry_html

        texts[page] = entry_html(entry)
    for path in texts:
        path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_outputs(*texts) as parts:
        for part, text in zip(parts, texts.values(), strict=True):
            part.write_text(text, encoding="utf-8")
    fit = entry.fit
    line = (
        f"  {entry.name.model}, {fit.distortion.model} at {fit.distortion.focal_mm:g} mm, misses "
        f"by {fit.residual_px:.3f} px"
    )
    extra = {} if page is None else {"page": str(page)}
    tell({**entry.to_record(), "out": str(out), **extra}, [line], as_json=json_)
