"""Pictures between sensor geometry and ideal geometry, in bands, by interpolation.

The ideal picture has the size of the capture and is centred on the ideal position of the
capture's centre: nothing moves on a whole sensor, and a crop far off the axis stays in view.

cv2.remap rounds positions to 1/32 px and holds them in 16 bits, so sides end at 32766 px. Maps
are computed on an 8 px lattice that is fixed to the picture and enlarged linearly, so the bands
do not depend on their height. Places in fixed point round the nodes to 1/256 px first; then all
sums are exact, and no reader of the bundle rounds a place to another 1/32 px.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.stages.undistort import Interpolation, Overshoot, Places
from camkit.errors import ContractError, UnsupportedError
from camkit.radial import RadialDistortion
from camkit.runtime.cancel import check_wish
from camkit.runtime.geometry.distortion import (
    check_distortion,
    distort_points,
    reference_channel,
    undistort_points,
)
from camkit.runtime.geometry.resampling import Maps, resampled, resampled_limited
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.machine.slices import run_slices
from camkit.runtime.rows import RowSource

FloatGrid = NDArray[np.float64]
Resample = Callable[[FloatArray, Maps], FloatArray]

LATTICE_PX: Final = 8
NODE_STEPS: Final = 256
PLACE_STEPS: Final = 32
"""Of a pixel, in fixed point: of nodes, and of places between them (those of cv2's maps)."""
BAND_ROWS: Final = 256
LANCZOS_REACH_PX: Final = 4
MAX_SIDE_PX: Final = 32766


def undistort_bands(
    source: RowSource,
    distortion: RadialDistortion,
    window: SensorWindow,
    *,
    band_rows: int = BAND_ROWS,
    threads: int = 1,
    interpolation: Interpolation = "lanczos",
    overshoot: Overshoot = "kept",
    places: Places = "float",
) -> Iterator[FloatArray]:
    """Undistort a capture, band by band; what lies outside it repeats its edge.

    Args:
        source: (c, h, w) picture in sensor geometry, of the size of the window.
        distortion: Radial distortion per channel.
        window: Where the picture lies on the sensor.
        band_rows: Height of the bands, a multiple of 8; the pixels do not depend on it.
        threads: Threads that share a band; the pixels do not depend on them.
        interpolation: Between pixels.
        overshoot: Whether values at rims of light above white, and below black, are kept or limited
            to the range of their samples; see `resampled_limited`.
        places: Arithmetic of the places, see the head of the module.

    Yields:
        (c, rows, w) float32 in ideal geometry, from top to bottom.

    Raises:
        ContractError: If sizes disagree or the distortion folds on the sensor.
        UnsupportedError: If a side is too long for cv2.remap.
    """
    warp = Warp(distortion, window, to_sensor=False, places=places)
    resample = partial(
        resampled_limited if overshoot == "limited" else resampled, interpolation=interpolation
    )
    yield from _warp_bands(source, warp, resample, band_rows=band_rows, threads=threads)


def distort_array(
    scene: FloatArray, distortion: RadialDistortion, window: SensorWindow, *, margin_px: int = 0
) -> FloatArray:
    """Warp an ideal picture into sensor geometry; beyond its border it is mirrored.

    Args:
        scene: (c, h, w) float32 in ideal geometry, of the size of the window.
        distortion: Radial distortion per channel.
        window: Where the capture lies on the sensor.
        margin_px: Pixels to compute beyond every side of the window.

    Returns:
        (c, h + 2 margin, w + 2 margin) float32.

    Raises:
        ContractError: If sizes disagree or the distortion folds on the sensor.
        UnsupportedError: If a side is too long for cv2.remap.
    """
    _check_size(scene.shape, window, distortion)
    height, width = scene.shape[1] + 2 * margin_px, scene.shape[2] + 2 * margin_px
    warp = Warp(distortion, window, to_sensor=True, margin_px=margin_px)
    out = np.empty((scene.shape[0], height, width), dtype=np.float32)
    for channel in range(scene.shape[0]):
        for top in range(0, height, BAND_ROWS):
            bottom = min(top + BAND_ROWS, height)
            maps = warp.maps(channel, top, bottom)
            out[channel, top:bottom] = resampled(
                scene[channel], maps, border=cv2.BORDER_REFLECT_101
            )
    return out


class Warp:
    """The map of a picture: for pixels of the output, positions in the source."""

    def __init__(
        self,
        distortion: RadialDistortion,
        window: SensorWindow,
        *,
        to_sensor: bool,
        margin_px: int = 0,
        places: Places = "float",
    ) -> None:
        check_distortion(distortion, window.corner_radius_mm)
        if max(window.size_px) + 2 * margin_px > MAX_SIDE_PX:
            raise UnsupportedError(
                f"pictures are warped up to {MAX_SIDE_PX} px a side; got {window.size_px}; "
                "switch undistortion off or crop"
            )
        self.window = window
        self.distortion = distortion
        self._to_sensor = to_sensor
        self._margin_px = margin_px
        self._places = places
        centre = window.centre_mm
        middle = reference_channel(distortion)
        self._shift_mm = undistort_points(centre, distortion, channel=middle) - centre

    @property
    def channels(self) -> int:
        """Return the number of channels that the distortion knows."""
        return int(self.distortion.coefficients.shape[0])

    def shares_map(self, channel: int) -> bool:
        """Return whether a channel has the same map as the one before it."""
        row = self.distortion.row
        return channel > 0 and bool(np.array_equal(row(channel), row(channel - 1)))

    def positions(self, channel: int, x_px: FloatGrid, y_px: FloatGrid) -> FloatGrid:
        """Return (..., 2) source pixel positions of output pixel positions.

        Args:
            channel: Number of the channel.
            x_px: Columns of the output, the margin included.
            y_px: Rows of the output, of the same shape.
        """
        points = np.stack(self.window.to_mm(x_px - self._margin_px, y_px - self._margin_px), -1)
        if self._to_sensor:
            source_mm = undistort_points(points, self.distortion, channel=channel) - self._shift_mm
        else:
            source_mm = distort_points(points + self._shift_mm, self.distortion, channel=channel)
        return np.stack(self.window.to_px(source_mm[..., 0], source_mm[..., 1]), axis=-1)

    def lattice(self, channel: int, top: int, bottom: int) -> FloatGrid:
        """Return positions on the lattice nodes around rows top..bottom (top on the lattice)."""
        width = self.window.size_px[0] + 2 * self._margin_px
        middle = (LATTICE_PX - 1) / 2
        columns = np.arange(-1, -(-width // LATTICE_PX) + 1) * LATTICE_PX + middle
        rows = np.arange(top // LATTICE_PX - 1, -(-bottom // LATTICE_PX) + 1) * LATTICE_PX + middle
        x, y = np.meshgrid(columns, rows)
        return self.positions(channel, x, y)

    def maps(self, channel: int, top: int, bottom: int) -> Maps:
        """Return cv2's fixed-point maps of output rows top..bottom (top on the lattice)."""
        nodes = self.lattice(channel, top, bottom)
        rows, columns = bottom - top, self.window.size_px[0] + 2 * self._margin_px
        if self._places == "fixed":
            return _fixed_maps(nodes, top, (rows, columns))
        dense = _dense(nodes.astype(np.float32), (rows, columns))
        whole, fraction = cv2.convertMaps(dense, None, cv2.CV_16SC2)
        return whole, fraction


def _dense(nodes: NDArray[Any], size: tuple[int, int]) -> NDArray[Any]:
    """Return (rows, columns, 2), linear between the nodes around them."""
    # cv2.resize places node i in the middle of its cell, as the lattice does.
    sides = (nodes.shape[1] * LATTICE_PX, nodes.shape[0] * LATTICE_PX)
    dense = cv2.resize(nodes, sides, interpolation=cv2.INTER_LINEAR)
    inside: NDArray[Any] = dense[LATTICE_PX:, LATTICE_PX:][: size[0], : size[1]]
    return inside


def _fixed_maps(nodes: FloatGrid, top: int, size: tuple[int, int]) -> Maps:
    """Return cv2's maps of (rows, columns) pixels from row `top` on, in fixed point.

    How far a place lies from its pixel is interpolated, less what all have in common: a number
    small enough for single precision to be exact.
    """
    steps = np.floor(nodes * NODE_STEPS + 0.5)
    middle = (LATTICE_PX - 1) / 2
    for axis, first in ((0, 0), (1, top // LATTICE_PX)):
        cells = np.arange(first - 1, first - 1 + nodes.shape[1 - axis]) * LATTICE_PX + middle
        steps[..., axis] -= (cells if axis == 0 else cells[:, None]) * NODE_STEPS
    common = np.rint(steps.mean(axis=(0, 1)) / NODE_STEPS)
    steps -= common * NODE_STEPS
    is_exact = np.abs(steps).max() * LATTICE_PX * LATTICE_PX * 4 < 2**24
    moves = _dense(steps.astype(np.float32 if is_exact else np.float64), size)
    moves = moves * moves.dtype.type(PLACE_STEPS / NODE_STEPS)
    moves += moves.dtype.type(0.5)
    parts = np.floor(moves, out=moves).astype(np.int32 if not is_exact else np.int16)
    # places between nodes lie between theirs: few pictures need more than 16 bits before the cut
    kind = np.int16 if np.abs(nodes).max() < MAX_SIDE_PX else np.int32
    whole = (parts >> 5).astype(kind)
    whole[..., 0] += (np.arange(size[1]) + int(common[0])).astype(kind)
    whole[..., 1] += (np.arange(top, top + size[0]) + int(common[1])).astype(kind)[:, None]
    if kind is not np.int16:
        whole = whole.clip(-(2**15), 2**15 - 1).astype(np.int16)
    parts &= PLACE_STEPS - 1
    return whole, (parts[..., 1] * PLACE_STEPS + parts[..., 0]).astype(np.uint16)


def _warp_bands(
    source: RowSource, warp: Warp, resample: Resample, *, band_rows: int, threads: int
) -> Iterator[FloatArray]:
    _check_size(source.shape, warp.window, warp.distortion)
    if band_rows < LATTICE_PX or band_rows % LATTICE_PX:
        raise ContractError(f"band_rows must be a multiple of {LATTICE_PX}; got {band_rows}")
    channels, height, width = source.shape
    tops = range(0, height, band_rows)
    spans = _source_spans(warp, tops, height)
    for top, (first, last) in zip(tops, spans, strict=True):
        bottom = min(top + band_rows, height)
        band = np.empty((channels, bottom - top, width), dtype=np.float32)
        fill = partial(_warp_rows, warp, (source.read(first, last), first), (band, top), resample)
        run_slices(fill, bottom - top, threads=threads, lattice=LATTICE_PX)
        del fill  # it holds rows that nobody needs while the next band is waited for
        yield band
        del band


def _warp_rows(
    warp: Warp,
    source: tuple[FloatArray, int],
    target: tuple[FloatArray, int],
    resample: Resample,
    begin: int,
    end: int,
) -> None:
    """Fill rows begin..end of a band; source and target come with the row they start at."""
    (rows, first), (band, top) = source, target
    for channel in range(rows.shape[0]):
        check_wish()
        if not warp.shares_map(channel):
            whole, fraction = warp.maps(channel, top + begin, top + end)
            whole[..., 1] -= first
        maps = whole, fraction
        band[channel, begin:end] = resample(rows[channel], maps)


def _source_spans(warp: Warp, tops: range, height: int) -> list[tuple[int, int]]:
    # Sources forget rows above the latest read, so no band may start above the one before it.
    spans: list[tuple[int, int]] = []
    lowest = max(height - LANCZOS_REACH_PX, 0)
    for top in reversed(tops):
        bottom = min(top + tops.step, height)
        y = np.stack([warp.lattice(c, top, bottom)[..., 1] for c in range(warp.channels)])
        first = int(np.floor(y.min())) - LANCZOS_REACH_PX
        last = int(np.ceil(max(y.max(), 0.0))) + LANCZOS_REACH_PX + 1
        lowest = min(lowest, max(first, 0))
        spans.append((lowest, min(max(last, lowest + 1), height)))
    return spans[::-1]


def _check_size(shape: tuple[int, ...], window: SensorWindow, distortion: RadialDistortion) -> None:
    width, height = window.size_px
    channels = distortion.coefficients.shape[0]
    if shape != (channels, height, width):
        raise ContractError(f"the picture must be ({channels}, {height}, {width}); got {shape}")
