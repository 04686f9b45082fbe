"""A haze made by formula, beside the tiny PSF: cells of 8 px, leaning outward."""

from dataclasses import replace

import numpy as np

from camkit.haze import Haze
from camkit.psf import FrozenPsf
from tests.bundle_factory import tiny_psf

CELL_PX = 8
CELLS = 7


def tiny_haze(psf: FrozenPsf | None = None, *, cells: int = CELLS, share: float = 0.5) -> Haze:
    """Give a haze that leans outward along +y, beside the tiny PSF unless another is given.

    Args:
        psf: Whose samples it has.
        cells: Along a side of a kernel.
        share: Of the light in the core on the axis; a tenth less at every further field.
    """
    chosen = tiny_psf() if psf is None else psf
    lead = chosen.kernels.shape[:3]
    y, x = np.indices((cells, cells)) - cells // 2
    fields = np.arange(lead[0])[:, None, None]
    wide = np.exp(-(x**2 + (y - fields) ** 2) / cells)
    wide /= wide.sum(axis=(-2, -1), keepdims=True)
    waves = 1 - 0.1 * np.arange(lead[2])
    core = np.broadcast_to(share * 0.9**fields * waves, lead).copy()
    light = 0.95 * (1 - core)[..., None, None] * wide[:, None, None]
    return Haze(
        kernels=light.astype(np.float32),
        core_share=core,
        field_heights_mm=chosen.field_heights_mm,
        depths_mm=chosen.depths_mm,
        wavelengths_um=chosen.wavelengths_um,
        cell_px=CELL_PX,
        pixel_pitch_um=chosen.pixel_pitch_um,
    )


def with_kernels(haze: Haze, factor: float) -> Haze:
    """Give a haze with a factor on its light."""
    return replace(haze, kernels=haze.kernels * np.float32(factor))
