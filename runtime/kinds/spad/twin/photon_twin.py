"""A scene recorded by the array of a bundle.

a picture                       counts (h, w)
an NPZ of depth_m and albedo    histogram (bins, h, w)
an NPZ of transient             the same, of light in flight
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.captures.bundle_times import times_of_bundle
from camkit.runtime.kinds.spad.files.npz import read_npz
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.linear import Grid
from camkit.runtime.kinds.spad.finer.sampling import light_of
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS, Timing
from camkit.runtime.kinds.spad.twin.array import see_through
from camkit.runtime.kinds.spad.twin.counting import (
    Disturbances,
    count_frames,
    count_times,
    scaled_to,
)
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions, Recorded
from camkit.runtime.kinds.spad.twin.scene import light_in_flight, light_of_depth
from camkit.runtime.kinds.spad.twin.working import WORKING_POINTS
from camkit.runtime.twin.light import LUMINANCE

SCENE_ARRAYS: Final = frozenset({"depth_m", "albedo", "transient"})
MOST_BYTES: Final = 2_000_000_000
S_PER_PS: Final = 1e-12


def record(scene: FloatArray | Path, bundle: Bundle, options: PhotonOptions) -> Recorded:
    """Record a scene.

    Args:
        scene: (3, h, w) linear Rec.709, white = 1, of any size: it is fitted to the fine grid; or
            the NPZ of a scene on it.
        bundle: The camera.
        options: How much light there is.

    Raises:
        DecodeError: If the NPZ cannot be read.
        ContractError: If it holds no scene of this array.
        BundleError: If the bundle has no such array.
    """
    camera = FineCamera.of(bundle)
    rng = np.random.default_rng(options.seed)
    if not isinstance(scene, Path):
        light = fitted(luminance(scene), camera)
        return _counted(camera, light, options, rng)
    arrays = read_scene(scene)
    axis, pulse = times_of(camera)
    notes: tuple[str, ...] = ()
    if "transient" in arrays:
        light = light_in_flight(arrays["transient"], axis.bins)
    elif {"depth_m", "albedo"} <= arrays.keys():
        light = light_of_depth(arrays["depth_m"], arrays["albedo"], axis, pulse)
        notes = _outside(light, arrays["depth_m"], arrays["albedo"], axis)
    else:
        raise ContractError(
            f"{scene.name} holds {', '.join(arrays) or 'nothing'}; a scene has depth_m and albedo, "
            "or transient"
        )
    return replace(_timed(camera, light, axis, options, rng), notes=notes)


def _outside(
    light: FloatArray, depth_m: NDArray[Any], albedo: NDArray[Any], axis: TimeAxis
) -> tuple[str, ...]:
    """Return a note where less than half of the pulse of a surface lies on the time axis."""
    is_surface = ~np.isnan(depth_m) & (albedo > 0)
    is_lost = is_surface & (light.sum(axis=0) < albedo / 2)
    if not is_lost.any():
        return ()
    share = is_lost.sum() / is_surface.sum()
    deep_m = axis.bins * axis.step_ps * LIGHT_M_PER_PS / 2
    return (
        f"{share:.1%} of the scene lies outside the time axis, {axis.bins} x {axis.step_ps:g} ps "
        f"({deep_m:.2f} m deep)",
    )


def luminance(picture: FloatArray) -> FloatArray:
    """Return the luminance (h, w) of linear Rec.709 (3, h, w)."""
    return np.tensordot(np.array(LUMINANCE, np.float32), np.maximum(picture, 0), axes=1)


def fitted(light: FloatArray, camera: FineCamera) -> FloatArray:
    """Return the middle of a picture (h, w), on the fine grid of an array."""
    height, width = _fine_shape(camera)
    if light.shape == (height, width):
        return light
    share = max(height / light.shape[0], width / light.shape[1])
    tall = max(round(light.shape[0] * share), height)
    wide = max(round(light.shape[1] * share), width)
    way = cv2.INTER_AREA if share < 1 else cv2.INTER_CUBIC
    sized = np.maximum(cv2.resize(light, (wide, tall), interpolation=way), 0)
    top, left = (tall - height) // 2, (wide - width) // 2
    return np.ascontiguousarray(sized[top : top + height, left : left + width], np.float32)


def times_of(camera: FineCamera) -> tuple[TimeAxis, Pulse]:
    """Return the time bins of an array, and the pulse that it sees.

    Raises:
        ContractError: If its bundle states none.
    """
    timing = Timing().with_stated(times_of_bundle(camera.bundle.manifest))
    pulse = timing.pulse()
    if camera.sensor.time_bins == 0 or pulse is None:
        raise ContractError(
            f"bundle {camera.bundle.manifest.name} states no time bins and pulse: its array counts "
            "pictures only"
        )
    return timing.axis(bins=camera.sensor.time_bins), pulse


def read_scene(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of a scene.

    Raises:
        DecodeError: If the file is no NPZ of numbers, or too large.
    """
    try:
        arrays = read_npz(path, max_bytes=MOST_BYTES)
    except DecodeError as error:
        raise DecodeError(f"cannot read the scene {path}: {error}") from error
    for name in SCENE_ARRAYS & arrays.keys():
        if arrays[name].dtype.kind not in "biuf":
            raise DecodeError(
                f"cannot read the scene {path}: {name} holds {arrays[name].dtype}; expected real "
                "numbers"
            )
    return arrays


def _fine_shape(camera: FineCamera) -> tuple[int, int]:
    return camera.scale * camera.sensor.height_px, camera.scale * camera.sensor.width_px


def seen_by(camera: FineCamera, light: FloatArray) -> FloatArray:
    """Return the light of every pixel (n, h, w) from that of the fine grid (n, m h, m w).

    Raises:
        ContractError: If it is not of this array.
    """
    shape = _fine_shape(camera)
    if light.shape[1:] != shape:
        raise ContractError(
            f"a scene of bundle {camera.bundle.manifest.name} has {shape[1]}x{shape[0]} sub-pixels;"
            f" got {light.shape[2]}x{light.shape[1]}"
        )
    sensor = camera.sensor
    return see_through(light, camera.kernel, Grid(scale=sensor.sub_pixels, phase=sensor.phase))


def dark_counts(camera: FineCamera, point: str) -> float:
    """Return the dark counts of a pixel in a picture, or a step, of a working point."""
    return camera.sensor.dark_count_rate_hz * WORKING_POINTS[point].time_s


def collected(camera: FineCamera, photons: float) -> float:
    """Return the photons of a pixel where one that sees a sub-pixel has so many.

    Pixels that see all of themselves collect those of scale^2 sub-pixels (4x4: 16 times).
    """
    return photons * light_of(camera.stage, camera.grid)


def dead_share(camera: FineCamera, point: str) -> float:
    """Return the dead time over the time for which a pixel counts, at a working point."""
    return camera.sensor.dead_time_ps * S_PER_PS / WORKING_POINTS[point].time_s


def _counted(
    camera: FineCamera, light: FloatArray, options: PhotonOptions, rng: np.random.Generator
) -> Recorded:
    photons = collected(camera, options.photons)
    mean = seen_by(camera, light[None]).astype(np.float64) * photons
    if np.isfinite(options.sbr):
        mean += mean.mean() / options.sbr
    point = "intensity"
    added = Disturbances(dark=dark_counts(camera, point), dead_share=dead_share(camera, point))
    counts = count_frames(mean, added, rng)[0]
    return Recorded(name="counts", values=counts, attributes=_attributes(camera))


def _timed(
    camera: FineCamera,
    light: FloatArray,
    axis: TimeAxis,
    options: PhotonOptions,
    rng: np.random.Generator,
) -> Recorded:
    photons = collected(camera, options.photons)
    mean = scaled_to(seen_by(camera, light), photons)
    mean += photons / options.sbr / axis.bins
    dark = dark_counts(camera, "depth")
    counts = count_times(mean, axis.orientation, Disturbances(dark=dark), rng)
    attributes = {**_attributes(camera), **times_of_bundle(camera.bundle.manifest)}
    return Recorded(name="histogram", values=counts, attributes=attributes)


def _attributes(camera: FineCamera) -> Mapping[str, Any]:
    return {"pitch_um": camera.sensor.pixel_pitch_um, "bundle": camera.bundle.manifest.name}
