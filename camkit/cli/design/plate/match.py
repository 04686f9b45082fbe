"""`camkit plate match`: a PSF to a plate of dots that can be etched."""

import json
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from camkit.cli.choices import Debug, Json, Overwrite
from camkit.cli.say import say
from camkit.progress import working

_SUM_TOLERANCE = 1e-4
_POOR = 0.999


def match(
    psf: Annotated[
        Path,
        typer.Argument(
            help="PSF to match: NPZ with an 11x11 array psf, or a frozen PSF (.safetensors)."
        ),
    ],
    out_dir: Annotated[Path, typer.Option("-o", "--out-dir", help="Folder for plate and masks.")],
    levels: Annotated[
        int, typer.Option(help="Number of etched levels, a power of 2 up to 64.")
    ] = 8,
    cells: Annotated[
        int, typer.Option(help="Number of cells along a side of the 0.873-mm unit.")
    ] = 88,
    seed: Annotated[int, typer.Option(min=0, help="Random seed of the initial phases.")] = 0,
    overwrite: Overwrite = False,
    json_: Json = False,
    _debug: Debug = False,
) -> None:
    """Find the plate whose diffraction orders form a given PSF, and its masks (needs torch).

    One unit of it is written: side by side, 16x16 units make the plate of a SPAD camera.
    """
    from camkit.cli.design.design_time import refuse_existing, require_torch

    require_torch("camkit plate match")
    import numpy as np

    from camkit.cli.design.plate.target import read_target
    from camkit.models_def.optics.dots.camera import DotCamera
    from camkit.models_def.optics.dots.match import check_levels, match_dots
    from camkit.models_def.optics.dots.target import to_target
    from camkit.report.pages.plate.dots import older_files, write_dots

    check_levels(levels)
    camera = DotCamera(cells=cells)
    psf_values = read_target(psf)
    target = to_target(psf_values)
    refuse_existing(older_files(out_dir), overwrite=overwrite)
    began = time.process_time()
    with working(f"matching {psf}"):
        matched = match_dots(target, camera, levels, np.random.default_rng(seed))
    cpu_seconds = time.process_time() - began
    record = write_dots(matched, target, out_dir)
    record |= {
        "cpu_seconds": round(cpu_seconds, 2),
        "notes": _notes(float(psf_values.sum()), record),
    }
    if json_:
        say(json.dumps(record))
        return
    for note in record["notes"]:
        say(f"note: {note}", err=True)
    _tell(record, out_dir)


def _notes(total: float, record: dict[str, Any]) -> list[str]:
    notes = []
    if abs(total - 1) > _SUM_TOLERANCE:
        notes.append(f"the PSF had a sum of {total:g}; it was divided by it")
    if record["correlation"] < _POOR:
        more = (
            "a plate of two levels is as bright on one side as on the other"
            if record["levels"] == 2
            else "give it more levels, or more cells"
        )
        notes.append(f"the plate is little like the PSF: {more}")
    return notes


def _tell(record: dict[str, Any], folder: Path) -> None:
    for mask in record["masks"]:
        say(
            f"{folder / mask['file']}: etch {mask['depth_um']:.4f} um, "
            f"{mask['etched_share']:.1%} of the cells"
        )
    for what, likeness in (("dots", record), ("seen by the array", record["seen"])):
        say(
            f"{what}: correlation {likeness['correlation']:.5f}, RMSE {likeness['rmse']:.4f} of "
            f"the peak, {likeness['efficiency']:.1%} of the light"
        )
    say(record["plate"])
