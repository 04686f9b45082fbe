"""Times of photons to the lifetime of what sent them, strip by strip."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages import Lifetime
from camkit.errors import ContractError
from camkit.runtime.cancel import check_wish
from camkit.runtime.job.job import Job
from camkit.runtime.job.stage_work import StageWork
from camkit.runtime.job.stream import Stream
from camkit.runtime.kinds.spad.captures.known_pulse import pulse_of
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture, photons_of
from camkit.runtime.kinds.spad.captures.strips import pieces
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.lifetime.fitter import LifetimeFitter, Lifetimes
from camkit.runtime.kinds.spad.lifetime.guess import guess_width
from camkit.runtime.kinds.spad.pixels import Pixels, by_pixel
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import LEAST_BINS, TimeAxis
from camkit.runtime.rows import Rows

METHODS: Final[tuple[str, ...]] = ()
OPTIONS: Final[tuple[str, ...]] = ()
PIXEL_BYTES: Final = 120
"""Of all arrays."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The bins that are fitted, of `[lifetime] from_ps` to `to_ps`."""

    bins: slice
    axis: TimeAxis


class Decays:
    """The decays of every pixel, complete once all rows of lifetimes are out (`Stream.beside`).

    Attributes:
        window: The bins that are fitted.
        pixels: What is known of the pixels.
        arrays: (h, w) by name, as `Lifetimes` names them, and `intensity`.
        pulse: Before the decay; None before the first row.
        fitter: Likewise.
    """

    def __init__(self, window: Window, photons: Stream) -> None:
        shape = photons.shape[1:]
        self.window, self.pixels = window, Pixels.of(photons)
        self.pulse: Pulse | None = None
        self.fitter: LifetimeFitter | None = None
        self.arrays: dict[str, NDArray[Any]] = {
            field.name: np.zeros(shape, bool if field.name == "known" else float)
            for field in fields(Lifetimes)
        } | {"intensity": np.zeros(shape)}


def prepare(entry: Lifetime, job: Job) -> StageWork:
    """Make ready; nothing is fitted before the first row is asked for."""

    def run(taken: Sequence[Stream]) -> tuple[Stream, ...]:
        (photons,) = taken
        decays = Decays(_window(photons_of(job)), photons)
        bands = _fitted(entry, job, photons, decays)
        plane = photons.plane.model_copy(update={"axes": "y x", "domain": "lifetime"})
        shape = 1, *photons.shape[1:]
        return (replace(photons.with_bands(bands), plane=plane, shape=shape, beside=decays),)

    return StageWork(run=run)


def _window(capture: PhotonCapture) -> Window:
    """Return the bins to fit.

    Raises:
        ContractError: If too few are left.
    """
    axis, told = capture.an_axis, capture.timing.lifetime
    low = -np.inf if told.from_ps is None else told.from_ps
    high = np.inf if told.to_ps is None else told.to_ps
    kept = np.flatnonzero((axis.centres_ps >= low) & (axis.centres_ps <= high))
    if len(kept) < LEAST_BINS:
        raise ContractError(
            f"[lifetime] from_ps and to_ps leave {len(kept)} time bins; expected at least "
            f"{LEAST_BINS}"
        )
    bins = slice(int(kept[0]), int(kept[-1]) + 1)
    edges = axis.edges_ps[bins.start : bins.stop + 1]
    return Window(bins=bins, axis=TimeAxis(orientation=axis.orientation, edges_ps=edges))


def _fitted(entry: Lifetime, job: Job, photons: Stream, decays: Decays) -> Iterator[Rows]:
    """Fit the pixels of strip after strip."""
    capture, window, arrays = photons_of(job), decays.window, decays.arrays
    period_ps = capture.timing.lifetime.period_ps
    guess = partial(_guessed, window=window, period_ps=period_ps)
    decays.pulse = pulse_of(job, entry.takes[0], guess)
    decay = Decay(axis=window.axis, pulse=decays.pulse, period_ps=period_ps)
    decays.fitter = fitter = LifetimeFitter(decay)
    pixels, rows = decays.pixels, photons.rows()
    bins, height, width = photons.shape
    for piece in pieces(
        (height, width),
        bins,
        reach=0,
        max_mem_bytes=capture.settings.max_mem_bytes,
        held_bytes=PIXEL_BYTES * height * width,
    ):
        check_wish()
        inside = slice(piece.top, piece.bottom)
        counts = by_pixel(rows.read(piece.top, piece.bottom))
        arrays["intensity"][inside] = (
            counts.sum(axis=2, dtype=np.float64) - pixels.dark[inside] * bins
        )
        fitted = fitter.fit(counts[..., window.bins].reshape(-1, window.axis.bins))
        for field in fields(Lifetimes):
            arrays[field.name][inside] = getattr(fitted, field.name).reshape(len(counts), -1)
        yield arrays["lifetime_ps"][None, inside].copy()


def _guessed(sample: NDArray[Any], *, window: Window, period_ps: float | None) -> Pulse:
    return guess_width(np.ascontiguousarray(sample[:, window.bins]), window.axis, period_ps)
