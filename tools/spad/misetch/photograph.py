"""A point 1.35 m away, photographed through a plate, and the PSF measured on the photographs.

    dots of the whole plate on 3.45-um pixels -> three frames 3 EV apart, with noise, as PNG
      -> what `camkit calibrate psf --dots` does -> a PSF file as a recipe names it

References: Sun 2021, section 4.5.1: a 50-mm lens, a point of 655 nm.
"""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.bundle.psf_file import psf_to_bytes
from camkit.calibration.dots import SeenDots, dots_psf
from camkit.calibration.measured import PsfOptions
from camkit.calibration.psf import measure_psf
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.plate_psf import frozen_psf
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.dots.camera import DotCamera
from camkit.models_def.optics.dots.pattern import dot_picture
from camkit.models_def.optics.dots.target import FloatGrid
from camkit.runtime.merging.survey import survey
from camkit.runtime.output.part_file import atomic_output

PITCH_UM: Final = 3.45
DEPTH_M: Final = 1.35
SIDE_PX: Final = 241
"""Twice as wide as the dots, for the dark around them to be seen."""
SAMPLES: Final = 3
TIMES_S: Final = (1.0, 1 / 8, 1 / 64)
PEAK: Final = 0.7
"""Of the brightest pixel in the shortest frame, in white."""
WHITE_ELECTRONS: Final = 1e4
READ_NOISE_ELECTRONS: Final = 10.0
TOP_CODE: Final = 65535


def measured_psf(
    height_um: FloatGrid, camera: DotCamera, designed: FloatArray, folder: Path
) -> tuple[Path, SeenDots]:
    """Photograph a point through a plate, and write the PSF that is measured on it.

    Args:
        height_um: (cells, cells) of one unit, as it was made.
        camera: What the plate stands in.
        designed: (11, 11) PSF that the plate was made for.
        folder: For frames and PSF.

    Returns:
        The file of the PSF, and what was seen.

    Raises:
        ContractError: If a frame cannot be written.
        DecodeError: If no dots are found.
    """
    grid = PixelGrid(side_px=SIDE_PX, pitch_um=PITCH_UM, samples=SAMPLES)
    frames = _bracket(dot_picture(height_um, camera, grid), folder)
    options = PsfOptions(pixel_pitch_um=PITCH_UM, depth_m=DEPTH_M)
    point = measure_psf(survey(frames, TIMES_S), options, None)
    psf, seen = dots_psf(point, frozen_psf(designed), camera.active_um)
    out = folder / "measured.safetensors"
    with atomic_output(out) as part:
        part.write_bytes(psf_to_bytes(psf))
    return out, seen


def _bracket(light: FloatGrid, folder: Path) -> list[Path]:
    """Write the frames of a light (h, w), longest first, as linear PNGs of 16 bits."""
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(0)
    paths = [folder / f"point_{n}.png" for n in range(len(TIMES_S))]
    for path, time_s in zip(paths, TIMES_S, strict=True):
        mean = light / light.max() * PEAK * WHITE_ELECTRONS * time_s / TIMES_S[-1]
        # a point has no colour, but a picture has three
        planes = np.stack([_exposed(mean, rng) for _ in range(3)], axis=-1)
        codes = np.clip(np.rint(planes * TOP_CODE), 0, TOP_CODE).astype(np.uint16)
        if not cv2.imwrite(str(path), codes):
            raise ContractError(f"cannot write {path}")
    return paths


def _exposed(electrons: FloatGrid, rng: np.random.Generator) -> NDArray[np.float64]:
    """Return what is read of a mean number of electrons, 1 = white."""
    read = rng.normal(scale=READ_NOISE_ELECTRONS, size=electrons.shape)
    return np.asarray((rng.poisson(electrons) + read) / WHITE_ELECTRONS)
