"""Lifetimes of fluorescence, of histograms."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.caller import option_text
from camkit.contracts import FloatArray
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.cancel import check_cancelled
from camkit.runtime.kinds.spad.lifetime.decay import Decay
from camkit.runtime.kinds.spad.lifetime.fitter import LifetimeFitter, Lifetimes
from camkit.runtime.kinds.spad.lifetime.guess import guess_width
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.preview import depth_picture, write_preview
from camkit.runtime.kinds.spad.products.record import told_axis, told_pulse
from camkit.runtime.kinds.spad.products.strips import pieces
from camkit.runtime.kinds.spad.products.survey import Survey
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, Pulse
from camkit.runtime.kinds.spad.time_axis import LEAST_BINS, TimeAxis
from camkit.runtime.maker import Made, Making

PIXEL_BYTES: Final = 120
"""Of all arrays."""
SAMPLE_ROWS: Final = 16
"""Rows, evenly spread, in which a pulse is looked for that nobody stated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Window:
    """The bins that are fitted, of `[lifetime] from_ps` to `to_ps`."""

    bins: slice
    axis: TimeAxis


def make_lifetime(making: Making, survey: Survey, began: float) -> Made:
    """Fit a decay to every pixel; arguments as of `make_depth`.

    Raises:
        DecodeError: If the file is damaged, or holds no counts.
        ContractError: If what is stated of it cannot be true of it.
        UnsupportedError: If it is a scan with a gate, or behind a bundle.
        Cancelled: If the caller wished so.
    """
    if survey.camera is not None:
        raise UnsupportedError(
            f"lifetimes are those of the array's own pixels; use {option_text('bundle', 'none')}"
        )
    window = _window(survey)
    pulse, warnings = _pulse(survey, window)
    told = survey.timing.lifetime
    decay = Decay(axis=window.axis, pulse=pulse, period_ps=told.period_ps)
    fitter = LifetimeFitter(decay)
    read_s = time.perf_counter() - began
    arrays = _arrays(making, survey, fitter, window)
    shown = np.where(arrays["valid"], arrays["lifetime_ps"], np.nan)
    if not arrays["valid"].any():
        warnings += ("no pixel has enough photons for a reliable lifetime",)
    return Made(
        arrays=arrays,
        writers={
            ".npz": lambda path: write_archive(path, arrays),
            ".png": lambda path: write_preview(path, depth_picture(-shown)),
        },
        pictures={
            "exr": (".exr", lambda path: write_exr(path, shown[None], "Y")),
            "tiff": (".tif", lambda path: write_tiff(path, shown[None])),
        },
        record={
            "product": "lifetime",
            **told_axis(window.axis),
            **told_pulse(pulse, is_guessed=survey.timing.pulse() is None),
            "period_ps": told.period_ps,
            "limits_ps": [round(limit, 2) for limit in fitter.limits_ps],
        },
        seconds={"read": read_s, "fit": time.perf_counter() - began - read_s},
        warnings=(*warnings, *survey.warnings()),
        sections={
            "spad": {"pixels": int(shown.size), "valid": [int(arrays["valid"].sum())]},
        },
    )


def _window(survey: Survey) -> _Window:
    """Return the bins to fit.

    Raises:
        ContractError: If too few are left.
    """
    axis, told = survey.an_axis, survey.timing.lifetime
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
    return _Window(bins=bins, axis=TimeAxis(orientation=axis.orientation, edges_ps=edges))


def _pulse(survey: Survey, window: _Window) -> tuple[Pulse, tuple[str, ...]]:
    stated = survey.timing.pulse()
    if stated is not None:
        return stated, ()
    height = survey.shape[0]
    rows = np.unique(np.linspace(0, height - 1, min(height, SAMPLE_ROWS)).astype(int))
    counts = [survey.rows.rows(int(row), int(row) + 1).counts[..., window.bins] for row in rows]
    sample = np.concatenate(counts).reshape(-1, window.axis.bins)
    guessed = guess_width(sample, window.axis, survey.timing.lifetime.period_ps)
    told = (
        f"no pulse is stated: a Gaussian of {FWHM_PER_SIGMA * guessed.sigma_ps:.3g} ps full width "
        "before one decay is estimated; state [laser] fwhm_ps or [irf] if you know it"
    )
    return guessed, (told,)


def _arrays(
    making: Making, survey: Survey, fitter: LifetimeFitter, window: _Window
) -> dict[str, NDArray[Any]]:
    shape = survey.shape
    hot, dark = survey.timing.hot(shape), survey.timing.dark(shape)
    found: dict[str, NDArray[Any]] = {
        field.name: np.zeros(shape, bool if field.name == "known" else float)
        for field in fields(Lifetimes)
    }
    intensity, blind = np.zeros(shape), np.zeros(shape, bool)
    for top, counts, lost in _strips(making, survey):
        rows = slice(top, top + len(counts))
        intensity[rows] = counts.sum(axis=2, dtype=np.float64) - dark[rows] * survey.bins
        blind[rows] = lost
        fitted = fitter.fit(counts[..., window.bins].reshape(-1, window.axis.bins))
        for name, whole in found.items():
            whole[rows] = getattr(fitted, name).reshape(len(counts), -1)
    believed = found["evidence"] > fitter.threshold()
    valid = believed & found["known"] & ~hot & ~blind
    return {
        "lifetime_ps": np.where(valid, found["lifetime_ps"], np.nan),
        "time_of_flight_ps": found["time_of_flight_ps"],
        "amplitude": found["amplitude"].astype(np.float32),
        "background": np.maximum(found["background"] - dark, 0.0).astype(np.float32),
        "sigma_ps": found["sigma_ps"].astype(np.float32),
        "evidence": found["evidence"].astype(np.float32),
        "intensity": intensity.astype(np.float32),
        "valid": valid,
    }


def _strips(making: Making, survey: Survey) -> Iterator[tuple[int, FloatArray, NDArray[np.bool_]]]:
    """Yield first row, counts (rows, w, bins) and blind pixels of strip after strip."""
    for piece in pieces(
        survey.shape,
        survey.bins,
        reach=0,
        max_mem_bytes=survey.settings.max_mem_bytes,
        held_bytes=PIXEL_BYTES * survey.shape[0] * survey.shape[1],
    ):
        check_cancelled(making.cancel)
        strip = survey.rows.rows(piece.top, piece.bottom)
        yield piece.top, strip.counts, strip.blind
        if making.progress is not None:
            making.progress(piece.bottom, survey.shape[0])
