"""The focus of a camera body: one number, out of captures of edges.

    captures -> straight edges, anywhere in the field            (edges.py)
    kernels of every shift of focus, at the place of an edge -> how light rises across it
      -> bright, dark, tilt and place of each edge by least squares, at many shifts
      -> the shift with the least misfit over all edges -> its standard error, by leaving edges out

Copies of a lens differ from the design mostly by where the sensor lies. Colours focus at different
depths, so a profile tells to which side it is moved.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import ColorSensor
from camkit.calibration.edges import Edge, FloatGrid, FloatLine, find_edges
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.psf import FrozenPsf, focus_weights
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.placement import place

LEAST_EDGES: Final = 3
MOST_MISFIT: Final = 0.015
"""Of the step: RMS of profiles around the best kernels, beyond which it is another lens."""
OUTLIER: Final = 9.0
"""Times the median of the mean square at its own best focus: an edge that is none."""
LEAST_ERRORS: Final = 2.0
"""Standard errors that a focus must differ from the nominal one."""
LEAST_FALL: Final = 0.01
"""Of the mean square, by which it must explain the edges better."""
SHIFTS: Final = 41
FINE: Final = 16
"""Places per pixel at which the light across an edge is computed."""
MOST_MOVE_PX: Final = 4.0
"""Of an edge, from where half of its middle colour's light lies beyond it."""
_ROUNDS: Final = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class EdgeCamera:
    """The facts of the camera that are known beforehand.

    Attributes:
        psf: Its kernels, those of a moved sensor among them.
        sensor: Response and size.
        depth_mm: Distance of the target, see `depth_weights`.
    """

    psf: FrozenPsf
    sensor: ColorSensor
    depth_mm: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredFocus:
    """The focus of a camera body.

    Attributes:
        focus_um: How far its sensor lies from the nominal place, away from the lens.
        standard_error_um: Of that, by leaving out one edge after the other.
        captures: With usable edges.
        edges: Used.
        misfit_nominal: RMS of the profiles around those of the nominal kernels, of the step.
        misfit: The same with the kernels of this focus.
    """

    focus_um: float
    standard_error_um: float
    captures: int
    edges: int
    misfit_nominal: float
    misfit: float

    def to_json(self) -> dict[str, float | int]:
        """Return plain JSON values."""
        return {
            "focus_um": round(self.focus_um, 2),
            "standard_error_um": round(self.standard_error_um, 2),
            "captures": self.captures,
            "edges": self.edges,
            "misfit_nominal": round(self.misfit_nominal, 5),
            "misfit": round(self.misfit, 5),
        }


def measure_focus(captures: Sequence[tuple[str, Capture]], camera: EdgeCamera) -> MeasuredFocus:
    """Measure the focus of a camera body.

    Args:
        captures: Name and capture, of a target with straight edges at the distance of the camera's
            focus: dark squares on white, say.
        camera: What is known of it.

    Raises:
        ContractError: If a capture is of another sensor, there are too few edges, they are clipped,
            they are not of this lens, or the focus lies beyond the kernels or is the nominal one.
    """
    shifts_um = _known_shifts(camera.psf)
    kernels = [
        color_kernels(
            camera.psf, *camera.sensor.response_arrays(), depth_mm=camera.depth_mm, focus_um=at_um
        )
        for at_um in (0.0, *shifts_um)
    ]
    tried_um = np.unique([*np.linspace(shifts_um[0], shifts_um[-1], SHIFTS), 0.0])
    shares = np.stack([focus_weights(shifts_um, float(at_um)) for at_um in tried_um])
    squares: list[FloatLine] = []
    captures_used = clipped = 0
    for name, capture in captures:
        fits, clipped_edges = _squares_of(name, capture, camera, kernels, shares)
        squares, captures_used, clipped = (
            squares + fits,
            captures_used + bool(fits),
            clipped + clipped_edges,
        )
    if len(squares) < LEAST_EDGES:
        why = f"; {clipped} more are clipped: expose less" if clipped else ""
        raise ContractError(
            f"the captures show {len(squares)} straight edges, {LEAST_EDGES} are needed{why}: "
            "photograph dark squares on white, turned by some degrees, sharp to the eye and evenly "
            "lit"
        )
    return _best(np.array(squares), tried_um, captures_used)


def _known_shifts(psf: FrozenPsf) -> NDArray[np.float64]:
    if psf.focus_um is None:
        raise ContractError(
            f"the PSF has the nominal focus alone: freeze it with {option_text('focus_um')} and "
            "export the bundle again, or give the lens"
        )
    return psf.focus_um


def _squares_of(
    name: str,
    capture: Capture,
    camera: EdgeCamera,
    kernels: Sequence[FieldKernels],
    shares: FloatGrid,
) -> tuple[list[FloatLine], int]:
    """Return the mean squares (focus,) of every edge of a capture, and how many are clipped."""
    channels = len(camera.sensor.channels)
    if capture.channels != channels:
        raise ContractError(f"{name} has {capture.channels} colours, the sensor {channels}")
    try:
        window = place(capture, camera.sensor.extent, None).window
    except ContractError as error:
        raise ContractError(f"{name}: {error}") from error
    edges = find_edges(capture)
    squares = []
    for edge in edges.edges:
        x_mm, y_mm = (float(at) for at in window.to_mm(edge.x_px, edge.y_px))
        rises = np.stack([edge_rises(k.at(x_mm, y_mm), edge.normal) for k in kernels])
        squares.append(_edge_squares(edge, np.tensordot(shares, rises, axes=1)))
    return squares, edges.clipped


def edge_rises(kernels: FloatArray, normal: tuple[float, float]) -> FloatGrid:
    """Return the rise of each colour's light across a sharp edge.

    A sample of a kernel is taken as light spread evenly over its pixel, which is how sharp an edge
    looks to pixels.

    Args:
        kernels: (c, h, w), as light falls on the sensor.
        normal: (y, x) of unit length, towards the bright side.

    Returns:
        (c, place) from 0 to 1; places are `FINE` a pixel, see `rise_places`.
    """
    h, w = kernels.shape[-2:]
    count = rise_places(h, w).size
    y, x = np.mgrid[-(h // 2) : h // 2 + 1, -(w // 2) : w // 2 + 1]
    at = (y * normal[0] + x * normal[1]).ravel() * FINE + count // 2
    low = np.floor(at).astype(np.intp)
    share = at - low
    spread = np.stack(
        [
            np.bincount(low, kernel.ravel() * (1 - share), count)
            + np.bincount(low + 1, kernel.ravel() * share, count)
            for kernel in kernels.astype(np.float64)
        ]
    )
    for width in (abs(part) * FINE for part in normal):
        spread = np.stack([np.convolve(line, _box(width), mode="same") for line in spread])
    # half of what falls on a place lies before its middle
    return np.asarray(np.cumsum(spread, axis=1) - spread / 2)


def rise_places(height: int, width: int) -> FloatLine:
    """Return the distances (place,) from the edge, px, of `edge_rises` of kernels of some sides."""
    half = (math.ceil(math.hypot(height, width) / 2) + 2) * FINE
    return np.asarray(np.arange(-half, half + 1) / FINE)


def _box(width: float) -> FloatLine:
    """Return a box of unit sum, whose outermost places have the remainder of a whole one."""
    half = math.ceil(max(width - 1, 0) / 2)
    box = np.ones(2 * half + 1)
    if half:
        box[[0, -1]] = (width - (2 * half - 1)) / 2
    return np.asarray(box / box.sum())


def _edge_squares(edge: Edge, rises: FloatGrid) -> FloatLine:
    """Return the mean square (focus,) of an edge's profiles around the best of each focus.

    Dark, bright and tilt of each colour are fitted, and one place for all colours.

    Args:
        edge: Its profiles.
        rises: (focus, c, place).
    """
    half = rises.shape[-1] // 2
    places = np.arange(-half, half + 1) / FINE
    squares = []
    for of_focus in rises:
        middle = of_focus[of_focus.shape[0] // 2]
        start = shift = -float(np.interp(0.5, middle, places))
        square = 0.0
        for _ in range(_ROUNDS):
            square, step_px = _fit_colours(edge, of_focus, places, shift)
            shift = float(np.clip(shift + step_px, start - MOST_MOVE_PX, start + MOST_MOVE_PX))
        squares.append(square)
    return np.array(squares)


def _fit_colours(
    edge: Edge, rises: FloatGrid, places: FloatLine, shift: float
) -> tuple[float, float]:
    """Return the mean square, and how much farther the edge lies."""
    rest_by_move = move_by_move = total = weight = 0.0
    for profile, rise in zip(edge.profiles, rises, strict=True):
        at = profile.distance_px - shift
        light = np.interp(at, places, rise, left=0.0, right=1.0)
        slope = (np.interp(at + 0.5, places, rise) - np.interp(at - 0.5, places, rise)) * -1.0
        root = np.sqrt(profile.count)
        table = np.stack([np.ones_like(at), light, at], axis=1) * root[:, None]
        fitted, *_ = np.linalg.lstsq(table, profile.value * root, rcond=None)
        step = fitted[1] if fitted[1] else 1.0
        rest = (profile.value * root - table @ fitted) / step
        by_move = slope * root
        by_move = by_move - table @ np.linalg.lstsq(table, by_move, rcond=None)[0]
        rest_by_move += float(rest @ by_move)
        move_by_move += float(by_move @ by_move)
        total += float(rest @ rest)
        weight += float(profile.count.sum())
    return total / weight, rest_by_move / move_by_move if move_by_move else 0.0


def _best(squares: FloatGrid, tried_um: FloatLine, captures: int) -> MeasuredFocus:
    """Find the least mean square (edge, focus), and its standard error.

    Raises:
        ContractError: If that is no measurement.
    """
    least_squares = squares.min(axis=1)
    squares = squares[least_squares <= OUTLIER * np.median(least_squares)]
    edges = len(squares)
    total = squares.mean(axis=0)
    focus_um, least = _minimum(tried_um, total)
    nominal = float(total[np.flatnonzero(tried_um == 0)[0]])
    if np.sqrt(least) > MOST_MISFIT:
        raise ContractError(
            f"the edges deviate from those of this lens by {np.sqrt(least):.1%} of their step at "
            f"best, more than {MOST_MISFIT:.1%}: the captures are of another lens or "
            "distance, or the target is not sharp"
        )
    if not tried_um[0] < focus_um < tried_um[-1]:
        raise ContractError(
            f"the focus lies at or beyond {focus_um:g} um, where the kernels end: give a larger "
            f"{option_text('focus_um')}, or focus the camera anew"
        )
    jackknife = np.array(
        [_minimum(tried_um, (total * edges - one) / (edges - 1))[0] for one in squares]
    )
    error_um = float(np.sqrt((edges - 1) / edges * np.square(jackknife - jackknife.mean()).sum()))
    if abs(focus_um) <= LEAST_ERRORS * error_um or least > (1 - LEAST_FALL) * nominal:
        raise ContractError(
            f"the focus is {focus_um:.1f} +- {error_um:.1f} um, which these captures do not tell "
            f"from the nominal one: omit {option_text('unit')}, or show more edges over the field"
        )
    return MeasuredFocus(
        focus_um=focus_um,
        standard_error_um=error_um,
        captures=captures,
        edges=edges,
        misfit_nominal=float(np.sqrt(nominal)),
        misfit=float(np.sqrt(least)),
    )


def _minimum(at: FloatLine, values: FloatLine) -> tuple[float, float]:
    """Return place and height of the least value, by the parabola through it and its neighbours."""
    i = int(values.argmin())
    if i in (0, at.size - 1):
        return float(at[i]), float(values[i])
    curve = np.polyfit(at[i - 1 : i + 2] - at[i], values[i - 1 : i + 2], 2)
    offset = float(-curve[1] / (2 * curve[0])) if curve[0] > 0 else 0.0
    return float(at[i]) + offset, float(np.polyval(curve, offset))
