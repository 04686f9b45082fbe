"""A camera of physics alone: a sensor, frozen optics, their haze undone, the filter; no network."""

from pathlib import Path
from typing import Final

from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import (
    Color,
    Dehaze,
    Demosaic,
    Illumination,
    Linearise,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.writer import write_physics

PRIOR_SCALE: Final = 3e-4
PRIOR_EXPONENT: Final = 2.0
WIDEST_PX: Final = 201
"""Kernels of at most this side are undone in the usual blocks."""


def write_camera(path: Path, name: str, optics: FrozenOptics, sensor: ColorSensor) -> Bundle:
    """Write a bundle without network, and open it.

    Args:
        path: Of the bundle; an existing one is replaced.
        name: Of the camera, in its manifest.
        optics: Kernels, and the haze beside them.
        sensor: With a mosaic.

    Raises:
        BundleError: If a reader would refuse the result.
    """
    side = int(optics.psf.kernels.shape[-1])
    # blocks of twice the kernel, which wrap no light, overlapped by one
    block = 512 if side <= WIDEST_PX else -(-2 * side // 64) * 64
    dehaze = Dehaze() if optics.haze is None else Dehaze(shrink=optics.haze.cell_px)
    usual: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        WhiteBalance(),
        Demosaic(),
        dehaze,
        Wiener(
            takes=("clear", "unknown"),
            block_px=block,
            overlap_px=160 if side <= WIDEST_PX else block // 2,
            prior_scale=PRIOR_SCALE,
            prior_exponent=PRIOR_EXPONENT,
        ),
        RaiseClipped(takes=("restored",)),
        Illumination(takes=("neutral",)),
        Undistort(),
        Color(),
    )
    stages = [stage for stage in usual if stage is not dehaze or optics.haze is not None]
    farthest_mm = float(optics.psf.depths_mm[-1])
    return write_physics(path, rewired(stages, usual), sensor, optics, farthest_mm, name=name)
