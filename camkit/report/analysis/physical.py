"""A camera of physics alone: a sensor, frozen optics, their haze undone, the filter; no network."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from camkit.bundle.chain import rewired
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import Manifest, format_of, planes_of
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.stages import (
    Color,
    Dehaze,
    Demosaic,
    Illumination,
    Linearise,
    Parts,
    RaiseClipped,
    Repair,
    Stage,
    Undistort,
    WhiteBalance,
    Wiener,
)
from camkit.bundle.writer import write_bundle

PRIOR_SCALE: Final = 3e-4
PRIOR_EXPONENT: Final = 2.0
WIDEST_PX: Final = 201
"""Kernels of at most this side are undone in the usual blocks."""


def write_physical(
    path: Path,
    name: str,
    optics: FrozenOptics,
    sensor: ColorSensor,
    *,
    terms: int = 32,
    rounds: int = 3,
) -> Bundle:
    """Write a bundle without network, and open it.

    Args:
        path: Of the bundle; an existing one is replaced.
        name: Of the camera, in its manifest.
        optics: Kernels, and the haze beside them.
        sensor: With a mosaic.
        terms: Of the stage `haze`, where there is one.
        rounds: Likewise.
    """
    side = int(optics.psf.kernels.shape[-1])
    # blocks of twice the kernel, which wrap no light, overlapped by one
    block = 512 if side <= WIDEST_PX else -(-2 * side // 64) * 64
    bank = Wiener(
        takes=("rgb", "unknown") if optics.haze is None else ("clear", "unknown"),
        block_px=block,
        overlap_px=160 if side <= WIDEST_PX else block // 2,
        prior_scale=PRIOR_SCALE,
        prior_exponent=PRIOR_EXPONENT,
    )
    dehaze: Sequence[Stage] = (
        ()
        if optics.haze is None
        else (Dehaze(shrink=optics.haze.cell_px, terms=terms, rounds=rounds),)
    )
    usual: tuple[Stage, ...] = (
        Linearise(),
        Repair(),
        WhiteBalance(),
        Demosaic(),
        *dehaze,
        bank,
        RaiseClipped(takes=("restored",)),
        Illumination(takes=("neutral",)),
        Undistort(),
        Color(),
    )
    stages = rewired(usual, usual)
    depth_mm = float(optics.psf.depths_mm[0]) if optics.psf.depths_mm.size == 1 else np.inf
    stated = optics.entry(depth_mm)
    manifest = Manifest(
        format_version=format_of(optics.psf, hazy=optics.haze is not None),
        name=name,
        version="0.1.0",
        licence="Apache-2.0",
        training_data="none: no network",
        sensor=sensor,
        optics=stated,
        stages=stages,
        planes=planes_of(stages, Parts(sensor=sensor, optics=stated, networks={})),
        products={"image": stages[-1].gives[0]},
    )
    write_bundle(path, manifest, optics.members)
    return open_bundle(path)
