"""Whole frames restored, judged zone by zone: photographed by the twin, undone by a camera.

    picture -> repeated until it fills the frame -> capture -> developed | filter | network -> dB

Frames are whole since haze reaches across them. Pictures are compared in the geometry of the
sensor as sRGB values, each zone the ring of the frame that lies nearest to a field.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.colorimetry import encode_srgb
from camkit.report.quality import BORDER_PX
from camkit.report.stress.rig import INPUT, Method, Rig, usual_sizes
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, photograph
from camkit.runtime.twin.truth import light_sensor, picture_scale, true_picture

BEST_DB: Final = 120.0
FILTER: Final = "filter"
TRUTH: Final = "truth"
Array = NDArray[np.float64]
Watch = Callable[[str, FloatArray], None]
"""Takes whole frames as they are made: `TRUTH` or the name of a method, (3, h, w) of sRGB, which
is changed afterwards: what shall stay is copied."""

MOST_BYTES: Final = 2_000_000_000
"""For a restoration: photographing takes more, and bits do not depend on it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovered:
    """PSNR of restored frames.

    Attributes:
        method: What restored them: the size of a network, or the filter alone.
        zones: By field, dB of sRGB of the developed capture, of the filter alone and of the
            method; None where the frame does not reach.
        overall: The same of all of the frame.
    """

    method: str
    zones: tuple[tuple[float, float, float] | None, ...]
    overall: tuple[float, float, float]


def recover(
    bundle: Bundle,
    pictures: Iterable[FloatArray],
    heights_mm: Array,
    *,
    iso: float,
    frame_px: tuple[int, int] | None = None,
    watch: Watch | None = None,
) -> Recovered:
    """Photograph frames and restore them.

    Args:
        bundle: The camera.
        pictures: (3, h, w) float32 linear Rec.709 each, at least one.
        heights_mm: (field,) from the axis, not decreasing.
        iso: Sensitivity.
        frame_px: (width, height) about the middle of the sensor; None for all of it.
        watch: Is shown every frame: the truth, then what each method makes of it.

    Raises:
        ContractError: If the bundle states no optics.
    """
    manifest = bundle.manifest
    scale, sensor = picture_scale(manifest), light_sensor(manifest)
    rig = Rig(bundle, usual_sizes(manifest), option_fields={"max_mem_bytes": MOST_BYTES})
    methods = _compared_methods(rig)
    extent = sensor.known_extent
    width, height = frame_px or (extent.width_px, extent.height_px)
    width, height = min(width, extent.width_px), min(height, extent.height_px)
    square = np.zeros((len(methods), heights_mm.size))
    count = np.zeros(heights_mm.size)
    for number, picture in enumerate(pictures):
        options = SimulationOptions(
            iso=iso,
            seed=number,
            scale=scale,
            depth_mm=bundle.reference_depth_mm,
            distort=False,
        )
        simulation = photograph(filled(picture, scale * width, scale * height), bundle, options)
        truth = encode_srgb(true_picture(simulation.clean, sensor))
        if watch is not None:
            watch(TRUTH, truth)
        zone = zones_of(simulation.window, scale, heights_mm)
        inside = np.s_[
            BORDER_PX : truth.shape[1] - BORDER_PX, BORDER_PX : truth.shape[2] - BORDER_PX
        ]
        near = zone[inside].ravel()
        count += np.bincount(near, minlength=heights_mm.size)
        for row, method in enumerate(methods):
            estimate = encode_srgb(restored(method.pipeline, simulation))
            if watch is not None:
                watch(method.name, estimate)
            estimate -= truth
            error = np.square(estimate, out=estimate).mean(axis=0)[inside].ravel()
            square[row] += np.bincount(near, error, minlength=heights_mm.size)
    whole = square.sum(axis=1) / count.sum()
    with np.errstate(invalid="ignore", divide="ignore"):
        means = square / count
    zones = [
        None if count[i] == 0 else _three([_decibels(v) for v in means[:, i]])
        for i in range(heights_mm.size)
    ]
    last = methods[-1]
    return Recovered(
        method=last.name if last.networks else FILTER,
        zones=tuple(zones),
        overall=_three([_decibels(v) for v in whole]),
    )


def filled(picture: FloatArray, width: int, height: int) -> FloatArray:
    """Repeat a picture (3, h, w), every second one mirrored, until it fills a frame."""
    pad = [(0, 0), (0, max(height - picture.shape[1], 0)), (0, max(width - picture.shape[2], 0))]
    return np.ascontiguousarray(np.pad(picture, pad, mode="symmetric")[:, :height, :width])


def zones_of(window: SensorWindow, scale: int, heights_mm: Array) -> NDArray[np.intp]:
    """Return the number of the nearest field (h, w) of every sample of a picture.

    Of fields at one height the first counts.
    """
    width, height = window.size_px
    fine = window.resampled(1 / scale, (scale * width, scale * height)) if scale > 1 else window
    y, x = (np.arange(scale * side, dtype=np.float64) for side in (height, width))
    x_mm, y_mm = fine.to_mm(x[None], y[:, None])
    rising = np.flatnonzero(np.diff(heights_mm, prepend=-1.0) > 0)
    distinct_mm = heights_mm[rising]
    edges = (distinct_mm[1:] + distinct_mm[:-1]) / 2
    return rising[np.searchsorted(edges, np.hypot(x_mm, y_mm))]


def _compared_methods(rig: Rig) -> Sequence[Method]:
    """Return the capture, the last method without networks, and the network where there is one."""
    simple = [method for method in rig.methods if not method.networks]
    capture = next(method for method in simple if method.name == INPUT)
    by_name = {method.name: method for method in rig.networks}
    network = by_name.get(rig.primary)
    return (capture, simple[-1]) if network is None else (capture, simple[-1], network)


def restored(pipeline: Pipeline, simulation: Simulation) -> FloatArray:
    """Return what a pipeline makes of a simulated capture, (3, h, w) linear Rec.709."""
    capture = pipeline.capture_of(
        simulation.samples,
        iso=simulation.iso,
        white_balance=simulation.white_balance,  # type: ignore[arg-type]
        origin_px=tuple(int(v) for v in simulation.window.origin_px),  # type: ignore[arg-type]
    )
    return pipeline.start(capture).fill()


def _decibels(square: float) -> float:
    return min(-10 * float(np.log10(max(square, 1e-30))), BEST_DB)


def _three(values: Sequence[float]) -> tuple[float, float, float]:
    """Return capture, filter and method; the filter twice where it is the method."""
    return values[0], values[1], values[-1]
