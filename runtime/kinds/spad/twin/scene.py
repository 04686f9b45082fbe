"""Scenes of single photons: the light of every sub-pixel and time bin.

depth and albedo   a pulse at the time of flight of every sub-pixel, as bright as its albedo
transient          light in flight as it is given, one frame for each time bin
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS

AT_ONCE: Final = 8192
"""Sub-pixels that are computed at once."""


def light_of_depth(
    depth_m: NDArray[np.floating], albedo: NDArray[np.floating], axis: TimeAxis, pulse: Pulse
) -> FloatArray:
    """Return the light of surfaces, (bins, h, w) float32: shares of their albedo.

    Args:
        depth_m: (h, w) from the array; NaN where there is no surface.
        albedo: (h, w) how bright they are, >= 0.
        axis: Of time.
        pulse: As it is seen.

    Raises:
        ContractError: If the arrays do not fit each other, or hold what cannot be.
    """
    if depth_m.ndim != 2 or depth_m.shape != albedo.shape:
        raise ContractError(
            f"depth_m and albedo must be two arrays of one (h, w); got {depth_m.shape} and "
            f"{albedo.shape}"
        )
    if not np.isfinite(albedo).all() or (albedo < 0).any():
        raise ContractError("albedo must be finite and >= 0")
    if np.isinf(depth_m).any() or (depth_m < 0).any():
        raise ContractError("depth_m must be >= 0, NaN where there is no surface")
    times_ps = (np.asarray(depth_m, np.float64) * 2 / LIGHT_M_PER_PS).ravel()
    bright = np.where(np.isnan(times_ps), 0.0, albedo.ravel())
    times_ps = np.nan_to_num(times_ps)
    light = np.empty((axis.bins, len(times_ps)), np.float32)
    every = np.arange(axis.bins)
    for start in range(0, len(times_ps), AT_ONCE):
        some = times_ps[start : start + AT_ONCE]
        shares = axis.shares(pulse, some, np.broadcast_to(every, (len(some), axis.bins)))
        light[:, start : start + AT_ONCE] = (shares * bright[start : start + AT_ONCE, None]).T
    return light.reshape(axis.bins, *depth_m.shape)


def light_in_flight(frames: NDArray[np.floating], bins: int) -> FloatArray:
    """Check light by time that is given, (bins, h, w).

    Raises:
        ContractError: If it has another number of frames, or holds what is no light.
    """
    if frames.ndim != 3 or len(frames) != bins:
        raise ContractError(f"transient must be (t, h, w) with {bins} frames; got {frames.shape}")
    if not np.isfinite(frames).all() or (frames < 0).any():
        raise ContractError("transient must be finite and >= 0")
    return np.asarray(frames, np.float32)
