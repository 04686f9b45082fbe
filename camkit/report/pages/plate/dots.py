"""A unit of a plate of dots as files: `plate.npz` with its heights, and its masks."""

import io
import re
from pathlib import Path
from typing import Any, Final

import numpy as np

from camkit.models_def.optics.dots.effective import effective_psf
from camkit.models_def.optics.dots.match import Match
from camkit.models_def.optics.dots.target import FloatGrid, likeness
from camkit.models_def.optics.dots.unit import DotPlate
from camkit.report.pages.plate.mask_files import POLARITY, mask_facts, mask_image
from camkit.runtime.output.part_file import write_together

PLATE: Final = "plate.npz"
_MASK: Final = re.compile(r"mask_\d+\.png")


def dot_paths(folder: Path, levels: int) -> list[Path]:
    """Return files of a plate of so many levels: its masks, the shallowest first, and heights."""
    count = levels.bit_length() - 1
    return [*(folder / f"mask_{number}.png" for number in range(1, count + 1)), folder / PLATE]


def older_files(folder: Path) -> list[Path]:
    """Return what an earlier plate left in a folder, masks of other numbers of levels among it."""
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.name == PLATE or _MASK.fullmatch(p.name))


def write_dots(match: Match, target: FloatGrid, folder: Path) -> dict[str, Any]:
    """Write plate.npz and mask_1.png, mask_2.png, ...; all of them or none.

    Masks of an earlier plate of more levels are removed: etched through, they would spoil this one.

    Args:
        match: The plate.
        target: (11, 11), what it was made for.
        folder: Made if it is not there.

    Returns:
        What there is to tell: goals reached, step, cells, masks, and the same of the PSF that the
        array sees.
    """
    plate = match.plate
    *masks, heights = dot_paths(folder, plate.levels)
    array_psf = effective_psf(plate.height_um, plate.camera)
    files = {
        **{path: mask_image(layer, "png") for path, layer in zip(masks, plate.masks, strict=True)},
        heights: _npz(plate, array_psf),
    }
    write_together(files)
    for path in older_files(folder):
        if path not in files:
            path.unlink()
    return {
        **match.etched.to_json(),
        "levels": plate.levels,
        "cell_um": plate.camera.cell_um,
        "step_um": plate.etching.step_um,
        "unit_mm": plate.camera.unit_mm,
        "tiles": plate.camera.tiles,
        "index": round(plate.camera.index, 6),
        "seen": likeness(array_psf, target).to_json(),
        "gerchberg_saxton": match.gerchberg_saxton.to_json(),
        "refined": match.refined.to_json(),
        "rounded": match.rounded.to_json(),
        "polarity": POLARITY,
        "masks": mask_facts(masks, plate.masks, plate.etching.step_um),
        "plate": str(heights),
    }


def _npz(plate: DotPlate, array_psf: FloatGrid) -> bytes:
    """Return the archive: one unit, and the PSFs of dots and of the array, of unit sum."""
    light = plate.light
    data = io.BytesIO()
    np.savez(
        data,
        allow_pickle=False,
        height_um=plate.height_um,
        level=plate.level.astype(np.uint8),
        cell_um=np.float64(plate.camera.cell_um),
        step_um=np.float64(plate.etching.step_um),
        unit_mm=np.float64(plate.camera.unit_mm),
        wavelength_um=np.float64(plate.camera.wavelength_um),
        dots=light / light.sum(),
        psf=(array_psf / array_psf.sum()).astype(np.float32),
    )
    return data.getvalue()
