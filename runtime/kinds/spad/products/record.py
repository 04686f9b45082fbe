"""Facts for a sidecar and a plan about the processing of a capture."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.stages import SuperResolve
from camkit.runtime.job.job import Job
from camkit.runtime.kinds.spad.captures.photon_capture import photons_of
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, GatedPulse, GaussianPulse, Pulse
from camkit.runtime.kinds.spad.sharpen import Way
from camkit.runtime.kinds.spad.stages.super_resolve import camera_of, size_of_network
from camkit.runtime.kinds.spad.time_axis import TimeAxis


def told_way(way: Way) -> Mapping[str, Any]:
    """Return how pixels are fitted, as plain JSON values."""
    return {
        "method": way.method,
        "pool": way.pool,
        "returns": way.returns,
        "false_alarms": way.false_alarms,
    }


def told_finer(job: Job) -> Mapping[str, Any]:
    """Return how pictures were made finer, as plain JSON values; nothing where they were not."""
    stage = next((s for s in job.setup.stages if isinstance(s, SuperResolve)), None)
    if stage is None:
        return {}
    size = size_of_network(camera_of(stage, job), photons_of(job))
    return {"finer": "linear" if size is None else "net", "size": size}


def told_axis(axis: TimeAxis) -> Mapping[str, Any]:
    """Return where the bins lie, as plain JSON values."""
    return {
        "orientation": axis.orientation,
        "bins": axis.bins,
        "time_bin_ps": round(axis.step_ps, 4),
        "first_ps": round(float(axis.centres_ps[0]), 4),
    }


def told_pulse(pulse: Pulse, *, is_guessed: bool) -> Mapping[str, Any]:
    """Return what a pulse looks like, as plain JSON values."""
    if isinstance(pulse, GatedPulse):
        shape = {"width_ps": pulse.width_ps, "rc_ps": pulse.rc_ps, "sigma_ps": pulse.sigma_ps}
    elif isinstance(pulse, GaussianPulse):
        shape = {"fwhm_ps": round(pulse.sigma_ps * FWHM_PER_SIGMA, 2)}
    else:
        shape = {"measured_from_ps": pulse.start_ps, "measured_to_ps": pulse.end_ps}
    return {"pulse": {**shape, "guessed": is_guessed}}


def total_photons(frames: FloatArray, shape: tuple[int, int]) -> float:
    """Return the photons of a capture, rounded to 0.1.

    Args:
        frames: (..., h, w) photons of a pixel of the array, perhaps on a finer grid.
        shape: Pixels of the array, (rows, columns).
    """
    share = shape[0] * shape[1] / (frames.shape[-2] * frames.shape[-1])
    return float((frames.sum(dtype=np.float64) * share).round(1))
