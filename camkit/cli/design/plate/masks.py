"""`camkit plate masks`: what a plate is etched through."""

import json
from pathlib import Path
from typing import Annotated

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.errors import ContractError


def masks(
    plate: Annotated[
        Path,
        typer.Argument(
            help="Plate (.toml or built-in name), or bundle with a plate.", metavar="PLATE"
        ),
    ],
    out_dir: Annotated[Path, typer.Option("-o", "--out-dir", help="Folder for the mask images.")],
    format_: Annotated[
        str, typer.Option("--format", help="Image format: png (one bit) or tiff (eight bits).")
    ] = "png",
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Write the masks of a plate as images, one for each etch step (needs torch)."""
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit plate masks")
    from camkit.models_def.optics.diffraction.plate import read_plate
    from camkit.report.pages.plate.mask_files import mask_paths, write_masks

    if format_ not in ("png", "tiff"):
        raise ContractError(f"--format is png or tiff; got {format_!r}")
    source = read_plate(plate)
    paths = mask_paths(source, out_dir, plate.stem, format_)  # type: ignore[arg-type]
    refuse_existing(paths, overwrite=overwrite)
    record = write_masks(source, out_dir, plate.stem, format_)  # type: ignore[arg-type]
    if json_:
        say(json.dumps(record))
        return
    for mask, path in zip(record["masks"], paths[:-1], strict=True):
        say(f"{path}: etch {mask['depth_um']:.4f} um, {mask['etched_share']:.1%} of the cells")
    say(str(paths[-1]))
