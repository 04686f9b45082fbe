"""The pulse of a capture: the one that is stated, else the one that its brightest pixels show."""

from collections.abc import Callable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.job.job import Job
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture, photons_of
from camkit.runtime.kinds.spad.guess_pulse import guess_pulse
from camkit.runtime.kinds.spad.pixels import by_pixel
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.scatter import growth
from camkit.runtime.kinds.spad.sharpen import Sharpener

SAMPLE_ROWS: Final = 16
"""Rows, evenly spread, in which a pulse is looked for that nobody stated."""
CACHE_KEY: Final = "pulse"
LITTLE_LOST: Final = 0.02
"""Of the cycles: a pixel that lost less to pile-up scatters as Poisson counts do, within 1 %."""


def pulse_of(job: Job, plane: str, guess: Callable[[FloatArray], Pulse] | None = None) -> Pulse:
    """Return the pulse of a capture.

    Args:
        job: The capture.
        plane: Photons of the array's own pixels, in which one is looked for that nobody stated.
        guess: Counts (p, bins) -> the pulse that they show; None for a narrow one.

    Raises:
        ContractError: If none is stated and too few photons show one.
    """
    capture = photons_of(job)
    stated_pulse = capture.timing.pulse()
    if stated_pulse is not None:
        return stated_pulse
    if CACHE_KEY not in job.cache:
        sample = _sample(job, plane)
        job.cache[CACHE_KEY] = (
            guess_pulse(sample, capture.an_axis) if guess is None else guess(sample)
        )
    pulse: Pulse = job.cache[CACHE_KEY]
    return pulse


def growth_of(
    sharpener: Sharpener, capture: PhotonCapture, counts: FloatArray, worst: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return how much more the counts of pixels scatter for pile-up; None where it is little.

    Args:
        sharpener: Of the pulse.
        capture: Whose cycles are known.
        counts: (rows, w, bins), pile-up undone.
        worst: (rows,) see `Pixels`.
    """
    if worst.max(initial=0.0) < LITTLE_LOST:
        return None
    flat = counts.reshape(-1, counts.shape[2])
    return growth(sharpener.fitter, flat, capture.timing.timing.cycles).reshape(counts.shape[:2])


def _sample(job: Job, plane: str) -> FloatArray:
    (rows,) = job.probe(plane)
    bins, height, _ = rows.shape
    tops = np.unique(np.linspace(0, height - 1, min(height, SAMPLE_ROWS)).astype(int))
    samples = [by_pixel(rows.read(int(top), int(top) + 1)) for top in tops]
    return np.concatenate(samples).reshape(-1, bins)
