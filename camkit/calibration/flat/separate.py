"""Lens, display and exposures from pictures of one display in different poses.

    log light = V(|p - c|) + D(q) + e,    p = R q + s

with the falling off V of the lens about the optical centre c, the display's own pattern D, the
exposure e of each picture. What D can take over from V in all poses at once is not known: the share
of V's least independent part that D cannot take over says whether the two are told apart. It is the
least generalised eigenvalue of the normal matrix of V, with and without D beside it.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from camkit.calibration.flat.pose import Pose
from camkit.calibration.flat.spline import Radial, Surface

FloatGrid = NDArray[np.float64]

LEAST_SHARE: Final = 0.15
"""Shifts by a fifth of the width pass, by a tenth do not: there poses that are wrong by a hundredth
cost more than 1 % of the light."""
LEAST_CENTRE_SHARE: Final = 0.01
MOST_CENTRE_ERROR: Final = 0.003
"""Of the radius, standard error of an optical centre up to which it is found and not noise."""
RADIAL_INTERVALS: Final = 6
SPACING: Final = 0.25
"""Of the knots of the display's pattern, in widths of the picture."""
CENTRE_ROUNDS: Final = 6
MOST_OFFSET: Final = 0.1
"""Of the radius, by which the optical centre may lie off."""
_LEAST_POWER: Final = 1e-4
"""Of the strongest mixture of functions; a weaker one is not seen by the pictures at all."""
_LEAST_SEEN: Final = 1e-10
_SAME_CENTRE: Final = 1e-5
_RIDGE: Final = 1e-9
_TIED_RIDGE: Final = 1e-3
"""Where the two are not told apart, what both can explain is the lens's: D is kept small."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Views:
    """The pictures and the facts about them.

    Attributes:
        log_light: (picture, place) logarithm of the light.
        x: (place,) from the middle of the picture, in units of the longest radius.
        y: (place,) likewise, down.
        poses: Of the pictures, shifts in the same unit.
        centre: (x, y) of the optical centre as far as it is known.
        reach: Largest radius from it, with what it may move.
        width: Of the picture.
    """

    log_light: FloatGrid
    x: FloatGrid
    y: FloatGrid
    poses: tuple[Pose, ...]
    centre: tuple[float, float]
    reach: float
    width: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The separated parts of the pictures.

    Attributes:
        radial: Functions of the lens.
        falling: Their factors.
        display: (picture, place) logarithm of the display's pattern as each picture sees it.
        rest: (picture, place) what is left.
        centre: (x, y) of the optical centre.
        centre_found: Whether it was fitted.
        share: Of the lens that the display cannot take over.
    """

    radial: Radial
    falling: FloatGrid
    display: FloatGrid
    rest: FloatGrid
    centre: tuple[float, float]
    centre_found: bool
    share: float

    @property
    def separated(self) -> bool:
        """Return whether lens and display were told apart."""
        return self.share >= LEAST_SHARE

    @property
    def rms(self) -> float:
        """Return the RMS of the residuals, as a share of the light."""
        return float(np.sqrt(np.mean(self.rest**2)))

    def illumination(self, radius: FloatGrid) -> FloatGrid:
        """Return relative illumination, 1 at the centre."""
        return np.exp(self.radial.terms(radius) @ self.falling)


class _Surroundings:
    """The factors beside the lens: the display's pattern and the exposures."""

    def __init__(self, views: Views) -> None:
        places = [pose.places(views.x, views.y) for pose in views.poses]
        x, y = (np.concatenate(part) for part in zip(*places, strict=True))
        display = Surface(x, y, SPACING * views.width).terms(x, y)
        pictures = np.kron(np.eye(len(views.poses)), np.ones((views.x.size, 1)))
        self.columns = np.concatenate([display, pictures], axis=1)
        self.display_terms = display.shape[1]
        self._pictures = len(views.poses)
        power, mixtures = linalg.eigh(self.columns.T @ self.columns)
        strong = power > _LEAST_SEEN * power[-1]
        self._unit = self.columns @ (mixtures[:, strong] / np.sqrt(power[strong]))

    def left_of(self, columns: FloatGrid) -> FloatGrid:
        """Return columns without the part that display and exposures explain."""
        return np.asarray(columns - self._unit @ (self._unit.T @ columns))

    def least_share(self, columns: FloatGrid) -> float:
        """Return the least share of any mixture of columns that these cannot take over."""
        by_picture = columns.reshape(self._pictures, -1, columns.shape[1])
        alone = (by_picture - by_picture.mean(axis=1, keepdims=True)).reshape(columns.shape)
        power, mixtures = linalg.eigh(alone.T @ alone)
        strong = power > _LEAST_POWER * power[-1]
        unit = mixtures[:, strong] / np.sqrt(power[strong])
        residual = self.left_of(columns) @ unit
        return float(np.clip(linalg.eigvalsh(residual.T @ residual)[0], 0.0, 1.0))


def separate(views: Views) -> Parts:
    """Separate pictures into lens and display, with the optical centre where they show it."""
    surroundings = _Surroundings(views)
    parts = middle = _fit(views, surroundings, views.centre)
    if not parts.separated:
        return parts
    for _ in range(CENTRE_ROUNDS):
        centre = _moved_centre(views, surroundings, parts)
        if centre is None:
            return middle
        previous, parts = parts.centre, _fit(views, surroundings, centre, centre_found=True)
        if np.hypot(centre[0] - previous[0], centre[1] - previous[1]) < _SAME_CENTRE:
            break
    return parts


def _fit(
    views: Views,
    surroundings: _Surroundings,
    centre: tuple[float, float],
    *,
    centre_found: bool = False,
) -> Parts:
    radial = Radial(views.reach, RADIAL_INTERVALS)
    lens = _repeated(radial.terms(np.hypot(views.x - centre[0], views.y - centre[1])), views)
    share = surroundings.least_share(lens)
    light = views.log_light.ravel()
    light = light - light.mean()
    count, last = lens.shape[1], lens.shape[1] + surroundings.display_terms
    columns = np.concatenate([lens, surroundings.columns], axis=1)
    normal = columns.T @ columns
    power = np.diag(normal)
    ridge = np.zeros(len(normal))
    ridge[:count] = _RIDGE * power[:count].mean()
    ridge[count:last] = (_RIDGE if share >= LEAST_SHARE else _TIED_RIDGE) * power[count:last].mean()
    factors = linalg.solve(normal + np.diag(ridge), columns.T @ light, assume_a="pos")
    shape = views.log_light.shape
    return Parts(
        radial=radial,
        falling=factors[:count],
        display=(columns[:, count:last] @ factors[count:last]).reshape(shape),
        rest=(light - columns @ factors).reshape(shape),
        centre=centre,
        centre_found=centre_found,
        share=share,
    )


def _moved_centre(
    views: Views, surroundings: _Surroundings, parts: Parts
) -> tuple[float, float] | None:
    """Return better centre by one step of Gauss and Newton; None where the pictures do not tell."""
    dx, dy = views.x - parts.centre[0], views.y - parts.centre[1]
    radius = np.hypot(dx, dy)
    slope = parts.radial.slopes(radius) @ parts.falling / np.maximum(radius, 1e-9)
    moves = _repeated(-np.stack([slope * dx, slope * dy], axis=1), views)
    if not np.abs(moves).max() > 0 or surroundings.least_share(moves) < LEAST_CENTRE_SHARE:
        return None
    lens = surroundings.left_of(_repeated(parts.radial.terms(radius), views))
    slopes = surroundings.left_of(moves)
    slopes = slopes - lens @ linalg.lstsq(lens, slopes)[0]
    rest = parts.rest.ravel()
    step = linalg.lstsq(slopes, rest)[0]
    variance = float(np.mean((rest - slopes @ step) ** 2))
    if variance > MOST_CENTRE_ERROR**2 * float(linalg.eigvalsh(slopes.T @ slopes)[0]):
        return None
    x, y = parts.centre[0] + float(step[0]), parts.centre[1] + float(step[1])
    is_outside = np.hypot(x - views.centre[0], y - views.centre[1]) > MOST_OFFSET
    return None if is_outside else (x, y)


def _repeated(columns: FloatGrid, views: Views) -> FloatGrid:
    """Return columns for every picture, which all have the same lens."""
    return np.tile(columns, (len(views.poses), 1))
