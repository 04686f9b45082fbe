"""A camera with a haze so small that its frames take a second; its recipe and optics."""

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from tests.bayer_recipe import RECIPE as PLAIN
from tests.haze_factory import CELL_PX, tiny_haze

WIDTH_PX, HEIGHT_PX, PITCH_UM = 320, 240, 5.96
SETTINGS = f"""[haze]
shrink = {CELL_PX}
terms = 8

[frames]
count = 2
validation_count = 1
crop_px = 160
shots = 2
tiles = 6
validation_tiles = 4

[wiener]
block_px = 96
"""
RECIPE = (
    PLAIN.replace("width_px = 600", f"width_px = {WIDTH_PX}")
    .replace("height_px = 400", f"height_px = {HEIGHT_PX}")
    .replace("[wiener]\n", SETTINGS)
    .replace('prescription = "duet"', 'prescription = "duet"\ncopies = 2')
)


def hazy_optics(share: float = 0.5) -> FrozenOptics:
    """Give round core kernels with a haze that leans outward, at the fields of the sensor."""
    at = np.arange(-4, 5)
    gaussian = np.exp(-np.add.outer(at**2, at**2) / 3.0)
    kernels = np.tile(gaussian / gaussian.sum(), (3, 1, 3, 1, 1)).astype(np.float32)
    corner_mm = np.hypot(WIDTH_PX, HEIGHT_PX) / 2 * PITCH_UM / 1000
    psf = FrozenPsf(
        kernels=kernels,
        field_heights_mm=np.linspace(0.0, corner_mm, 3),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.46, 0.54, 0.6]),
        pixel_pitch_um=PITCH_UM,
        distortion=RadialDistortion(
            coefficients=np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)), radius_mm=corner_mm
        ),
        relative_illumination=np.array([1.0, 0.9, 0.8]),
    )
    return FrozenOptics(psf=psf, haze=tiny_haze(psf, share=share))
