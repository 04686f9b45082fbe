"""The point light of a merged bracket: where it is, how its core looks, how dark it is around.

The centre is that of a Gaussian fitted to the core, elliptical and at any angle, on the samples of
one colour as they lie.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, optimize

from camkit.calibration.lattice import FloatGrid, Lattice
from camkit.errors import DecodeError

CORE_PX: Final = 6.0
REST_PX: Final = 4.0
LEAST_SNR: Final = 20.0
LONE_FACTOR: Final = 100.0
"""A cell this many times as bright as all around it is a defect and no light."""
BORDER_SHARE: Final = 0.1
_LEAST_BORDER_PX: Final = 8
_ONE_SIGMA: Final = 0.8413
_OUTLIER_SPREADS: Final = 4.0
_START_SPREAD_PX: Final = 1.2
_SPREADS_PX: Final = (0.25, 8.0)


class LightCore(Protocol):
    """The bright part of a light as a plain function fits it."""

    @property
    def y(self) -> float:
        """Return the row of its centre, in pixels."""

    @property
    def x(self) -> float:
        """Return the column of its centre."""

    @property
    def height(self) -> float:
        """Return its brightness in the middle."""

    @property
    def radius_px(self) -> float:
        """Return the radius within which residuals show whether the core fits."""

    @property
    def spread_px(self) -> float:
        """Return the standard deviation of its blur where it is narrowest."""

    def at(self, y: FloatGrid, x: FloatGrid) -> FloatGrid:
        """Return its values at pixels."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Core:
    """A Gaussian: its centre (y, x) in pixels, height, and the (2, 2) form in its exponent."""

    y: float
    x: float
    height: float
    form: FloatGrid

    @property
    def radius_px(self) -> float:
        """Return the radius within which it is fitted."""
        return REST_PX

    @property
    def spread_px(self) -> float:
        """Return its standard deviation where it is narrowest."""
        return float(1 / np.sqrt(np.linalg.eigvalsh(self.form).max()))

    def at(self, y: FloatGrid, x: FloatGrid) -> FloatGrid:
        """Return its values at pixels."""
        dy, dx, form = y - self.y, x - self.x, self.form
        inside = form[0, 0] * dy**2 + 2 * form[0, 1] * dy * dx + form[1, 1] * dx**2
        return np.asarray(self.height * np.exp(-0.5 * inside))


def find_light(cells: NDArray[np.floating]) -> tuple[int, int]:
    """Return (row, column) of the brightest cell that is no lone defect.

    Args:
        cells: (h, w) light of whole cells, the sum of their colours.

    Raises:
        DecodeError: If nothing stands out of the noise.
    """
    ring = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)
    bound = LONE_FACTOR * np.maximum(ndimage.maximum_filter(cells, footprint=ring), 0)
    smooth = ndimage.uniform_filter(np.minimum(cells, bound), 3)
    level, spread = background([smooth])
    if smooth.max() - level < LEAST_SNR * spread:
        raise DecodeError(
            f"no point light: nothing stands out {LEAST_SNR:g} times of the noise; expose longer, "
            "or darken the room"
        )
    row, column = np.unravel_index(int(smooth.argmax()), smooth.shape)
    return int(row), int(column)


def background(planes: Sequence[NDArray[np.floating]]) -> tuple[float, float]:
    """Return level and spread of planes along their border, robustly; NaN is left out.

    Both hold also where a converter cut at black what noise had brought below it: the level is a
    mean, and the spread that of the upper half.

    Raises:
        DecodeError: If there is nothing but NaN.
    """
    return level_of(np.concatenate([plane[border(plane)] for plane in planes]))


def border(plane: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Return which samples of a (h, w) plane lie along its border."""
    sides = [max(_LEAST_BORDER_PX, round(BORDER_SHARE * n)) for n in plane.shape]
    mask = np.ones(plane.shape, dtype=bool)
    mask[sides[0] : -sides[0], sides[1] : -sides[1]] = False
    return mask


def level_of(values: NDArray[np.floating]) -> tuple[float, float]:
    """Return level and spread of (n,) values of the dark, robustly; NaN is left out.

    Raises:
        DecodeError: If there is nothing but NaN.
    """
    finite = values[np.isfinite(values)]
    if not finite.size:
        raise DecodeError("every frame is clipped along its border: darken the room")
    middle, high = np.quantile(finite, (0.5, _ONE_SIGMA))
    spread = float(high - middle)
    return float(finite[np.abs(finite - middle) <= _OUTLIER_SPREADS * spread].mean()), spread


def fit_core(lattice: Lattice, y: float, x: float) -> Core:
    """Fit a Gaussian to the samples of a colour around a place.

    Args:
        lattice: Light of a colour, background taken off.
        y: Row in pixels near the centre.
        x: Column in pixels.

    Raises:
        DecodeError: If there is no light of this colour.
    """
    at_y, at_x = lattice.places()
    near = (np.hypot(at_y - y, at_x - x) <= CORE_PX) & np.isfinite(lattice.values)
    values = lattice.values[near]
    top = float(values.max(initial=0))
    if top <= 0:
        raise DecodeError("the light is dark in one colour: take one that every colour sees")
    dy, dx = at_y[near] - y, at_x[near] - x

    def misfit(p: FloatGrid) -> FloatGrid:
        return _core(p, top).at(dy, dx) / top - values / top

    log_low, log_high = np.log(_SPREADS_PX)
    start = [0.0, 0.0, 1.0, np.log(_START_SPREAD_PX), np.log(_START_SPREAD_PX), 0.0]
    low = [-CORE_PX, -CORE_PX, 0.0, log_low, log_low, -np.pi]
    high = [CORE_PX, CORE_PX, 10.0, log_high, log_high, np.pi]
    fitted = _core(optimize.least_squares(misfit, start, bounds=(low, high)).x, top)
    return Core(y=y + fitted.y, x=x + fitted.x, height=fitted.height, form=fitted.form)


def _core(p: FloatGrid, top: float) -> Core:
    """Return the Gaussian of six numbers: place, height, log spreads, angle."""
    c, s = np.cos(p[5]), np.sin(p[5])
    turn = np.array([[c, -s], [s, c]])
    form = turn @ np.diag(np.exp(-2 * p[3:5])) @ turn.T
    return Core(y=float(p[0]), x=float(p[1]), height=float(p[2]) * top, form=form)
