"""Maps and films of the archives that photons become."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.report.view.picture_light import find_capture
from camkit.report.view.result_search import ViewedResult
from camkit.runtime.kinds.spad.products.preview import (
    GAMMA,
    PERCENTILES,
    white_of,
    white_of_flight,
)
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.pipeline import load

MOST_SIDE_PX: Final = 1024
MOST_FILM_SAMPLES: Final = 24_000_000
MOST_RETURNS: Final = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueMap:
    """A map of values.

    Attributes:
        name: What it shows.
        unit: Of the values.
        values: (h, w); NaN where there is none.
        size_px: (height, width) of the whole map.
        valid: Share of the pixels of the whole map that have a value.
        low, high: Between which its colours run.
        colours: Name of its colour map.
        is_turned: Whether low values have the colours of high ones: near is red.
        stride: Of so many pixels along a side one is kept.
    """

    name: str
    unit: str
    values: NDArray[Any]
    size_px: tuple[int, int]
    valid: float
    low: float
    high: float
    colours: str
    is_turned: bool = False
    stride: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Film:
    """A film of photons.

    Attributes:
        name: What it shows.
        codes: (n, h, w) grey.
        labels: Of its frames.
        note: What the codes mean, and what was left out.
    """

    name: str
    codes: NDArray[np.uint8]
    labels: tuple[str, ...]
    note: str


def maps_of(arrays: Mapping[str, NDArray[Any]]) -> list[ValueMap]:
    """Return the maps of an archive, distances with their sigma first."""
    maps = []
    if "depth_m" in arrays:
        maps += _layers("Depth", "m", arrays["depth_m"], "turbo", is_turned=True)
    if "lifetime_ps" in arrays:
        maps += _layers("Lifetime", "ps", arrays["lifetime_ps"], "turbo", is_turned=False)
    if "sigma_ps" in arrays:
        is_depth = "depth_m" in arrays
        sigma = arrays["sigma_ps"] * (LIGHT_M_PER_PS / 2 if is_depth else 1.0)
        if "valid" in arrays:
            sigma = np.where(arrays["valid"], sigma, np.nan)
        name, unit = ("Sigma of depth", "m") if is_depth else ("Sigma of lifetime", "ps")
        maps += _layers(name, unit, sigma, "viridis", is_turned=False)
    if "intensity" in arrays:
        photons = arrays["intensity"]
        planes = photons if photons.ndim == 2 else photons[0]
        maps.append(_map("Photons", "photons", planes, "grey", is_turned=False))
    return maps


def film_of(arrays: Mapping[str, NDArray[Any]]) -> Film | None:
    """Return the film of an archive; None where it has a picture or maps alone."""
    name = next((key for key in ("frames", "transient") if key in arrays), None)
    if name is None or arrays[name].ndim != 3:
        return None
    frames = arrays[name]
    stride = max(1, -(-frames.size // MOST_FILM_SAMPLES))
    frames_shown = frames[::stride]
    is_flight = name == "transient"
    white = white_of_flight(frames) if is_flight else max(map(white_of, frames))
    share = np.clip(frames_shown / max(white, 1e-9), 0, 1)
    labels = [
        f"frame {number * stride + 1} of {len(frames)}" for number in range(len(frames_shown))
    ]
    if is_flight and "time_ps" in arrays:
        times = arrays["time_ps"][::stride]
        labels = [f"{label}, {time:.0f} ps" for label, time in zip(labels, times, strict=True)]
    note = f"White is {white:.3g} photons, shown with gamma {GAMMA}."
    if stride > 1:
        note += f" One of {stride} frames is shown: the page would be too large otherwise."
    return Film(
        name="Light in flight" if is_flight else "Film of photons",
        codes=np.round(share ** (1 / GAMMA) * 255).astype(np.uint8),
        labels=tuple(labels),
        note=note,
    )


def photons_before(result: ViewedResult, shape: tuple[int, int]) -> tuple[Any | None, str]:
    """Return the photons of the array's own pixels, each as large as its finer ones, and a line.

    Args:
        result: A picture of photons.
        shape: (h, w) of its fine grid.

    Returns:
        None in place of (h, w) photons where they are unknown.
    """
    from camkit.errors import CamkitError

    source, reason = find_capture(result) if result.record else (None, "there is no sidecar")
    if source is None:
        return None, f"There is no before: {reason}."
    timing = (result.record or {}).get("options", {}).get("of_kind", {}).get("timing")
    choices = {"timing": timing} if timing else {}
    try:
        developed = load("none", kind="spad", product="intensity", **choices).run(source)
        photons = developed.arrays["intensity"]
    except (CamkitError, OSError, KeyError) as error:
        return None, f"There is no before: {error}."
    times = shape[0] // photons.shape[-2]
    large = photons.repeat(times, axis=-2).repeat(times, axis=-1) if times else photons
    if large.shape != shape:
        return None, "There is no before: the capture is of another size."
    return large, (
        f"Before is {source.name}: the photons of each pixel of the array, nothing resolved finer."
    )


def _layers(
    name: str, unit: str, values: NDArray[Any], colours: str, *, is_turned: bool
) -> list[ValueMap]:
    layers = values[None] if values.ndim == 2 else values[:MOST_RETURNS]
    numbers = [""] if len(layers) == 1 else [" of the first return", " of the second return"]
    return [
        _map(name + number, unit, layer, colours, is_turned=is_turned)
        for number, layer in zip(numbers, layers, strict=True)
    ]


def _map(name: str, unit: str, values: NDArray[Any], colours: str, *, is_turned: bool) -> ValueMap:
    stride = -(-max(values.shape) // MOST_SIDE_PX)
    is_known = np.isfinite(values)
    plane = np.where(is_known, values, np.nan)[::stride, ::stride]
    finite = values[is_known]
    low, high = np.percentile(finite, PERCENTILES) if finite.size else (0.0, 1.0)
    return ValueMap(
        name=name,
        unit=unit,
        values=plane,
        size_px=(values.shape[0], values.shape[1]),
        valid=float(is_known.mean()),
        low=float(low),
        high=float(max(high, low + 1e-9)),
        colours=colours,
        is_turned=is_turned,
        stride=stride,
    )
