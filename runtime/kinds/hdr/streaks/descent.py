"""The light of clipped cells that explains what lies around them, one colour, one window.

Streaks are told from the scene by their gradients: wherever nothing clipped, the gradient of what
is seen less the streaks of the lights is that of the scene, which is small nearly everywhere and
large at edges. A penalty that grows less and less (Geman and McClure 1987) says so; its scale is
narrowed step by step (graduated non-convexity, Blake and Zisserman 1987), each step a few
conjugate gradients on the weights of the last one. Wide scales come first because edges of the
scene would otherwise hold every light where it started.

    min over x >= 0:  sum rho(grad(seen - K x)) + excess^2 where K x > seen + bias * x

- Cells beside clipped ones are not looked at: part of their light is a lamp's blur within a cell.
- Lights are sought on a scale of their own fourth root: a scale of their own would hold the faint
  ones, none would let them rise to what only the bright ones can explain.
- A small price per light keeps broad dim areas, whose streaks no one could tell from the scene,
  from being made bright.

References: Sun 2021, section 5.4, solves for the lights by a network; this takes its place.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.runtime.kinds.hdr.streaks.convolution import Spread

COARSE: Final = (1.0, 0.3, 0.1, 0.03, 0.012, 0.006)
"""Scales of the penalty, from the first step to the last."""
FINE: Final = (0.012, 0.012, 0.006, 0.006)
FAINTEST: Final = 1e-2
DIMMEST: Final = 0.05
"""Fainter lights cost no more."""
BRIGHTEST: Final = 600.0
DIM: Final = 10.0
"""From here on a light costs less of `dim_price`: lights are as often ten as a hundred."""
EXCESS: Final = 1.0
"""What a light pays where its streaks outshine what is seen, beside the gradients."""
MOST_BEYOND: Final = 0.2
"""Share of its streaks by which a first guess may outshine what is seen."""
_DIMMEST_START: Final = 2.0**-20
_HALVINGS: Final = 12
_TINY: Final = 1e-30
_NONE: Final = np.float32(0)
Mask = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """The steps of the search for lights at one pitch of cells.

    Attributes:
        scales: Of the penalty, one for every step.
        rounds: Conjugate gradients of a step; weights and the scale of the lights go stale.
        root: Lights are sought on a scale of their own to this power.
        price: Per light, of those that it would cost by itself.
        dim_price: Beside it, of a light that is not bright; less and less from `DIM` on.
    """

    scales: tuple[float, ...]
    rounds: int
    root: float
    price: float
    dim_price: float


COARSE_STEPS: Final = Steps(scales=COARSE, rounds=6, root=0.25, price=0.005, dim_price=0.0)
FINE_STEPS: Final = Steps(scales=FINE, rounds=3, root=0.5, price=0.00125, dim_price=0.08)


def seek_lights(
    measured: FloatArray,
    clipped: Mask,
    spread: Spread,
    first: FloatArray,
    steps: Steps,
    hidden: Mask | None = None,
) -> FloatArray:
    """Return the light of clipped cells.

    Args:
        measured: (h, w) float32: light of the cells, less what known light has thrown there; of no
            meaning in clipped ones.
        clipped: (h, w): cells in which a sample clipped.
        spread: What a cell's light becomes.
        first: (h, w) float32: light to start from.
        steps: Scales and prices.
        hidden: (h, w): cells that are not looked at; the clipped ones unless there are more.

    Returns:
        (h, w) float32, 0 outside the clipped cells.
    """
    usable = usable_cells(clipped if hidden is None else hidden)
    down, across = usable[1:] & usable[:-1], usable[:, 1:] & usable[:, :-1]
    light = np.where(clipped, np.maximum(first, FAINTEST), 0).astype(np.float32)
    for scale in steps.scales:
        blurred = spread.spread(light)
        rest_y, rest_x = gradient(measured - blurred)
        weights = _Weights(
            y=np.where(down, _weight(rest_y, scale), _NONE),
            x=np.where(across, _weight(rest_x, scale), _NONE),
            excess=np.where(usable & (blurred > measured), np.float32(EXCESS / scale**2), _NONE),
        )
        unit = np.power(light, steps.root, out=np.zeros_like(light), where=clipped)
        price = _price(light, steps) * unit**2 / np.maximum(light, DIMMEST)
        system = _System(spread=spread, weights=weights, unit=unit, price=price)
        start = np.divide(light, unit, out=np.zeros_like(light), where=unit > 0)
        rest = unit * system.gathered(rest_y, rest_x, measured - blurred) - price * start
        solution = unit * _conjugate_gradients(system, rest, start, steps.rounds)
        light = np.where(clipped, np.clip(solution, FAINTEST, BRIGHTEST), _NONE)
    return light


def not_outshining(
    guess: FloatArray, measured: FloatArray, clipped: Mask, spread: Spread
) -> FloatArray:
    """Return a guess, less bright where its streaks would be brighter than what is seen.

    A start far too bright is not always left again: where streaks lie on clipped cells mostly,
    little speaks against it.

    Args:
        guess: (h, w) float32: light of the clipped cells.
        measured: (h, w) float32, as in `seek_lights`.
        clipped: (h, w).
        spread: What a cell's light becomes.
    """
    blurred, there = spread.spread(guess)[~clipped], measured[~clipped]
    low, high = _DIMMEST_START, 1.0
    if _excess_share(blurred, there) <= MOST_BEYOND:
        return guess
    for _ in range(_HALVINGS):
        middle = (low * high) ** 0.5
        if _excess_share(np.float32(middle) * blurred, there) > MOST_BEYOND:
            high = middle
        else:
            low = middle
    return guess * np.float32(low)


def _excess_share(blurred: FloatArray, measured: FloatArray) -> float:
    """Return the share of streaks that is brighter than what is seen."""
    whole = float(blurred.sum(dtype=np.float64))
    return float(np.maximum(blurred - measured, 0).sum(dtype=np.float64)) / max(whole, _TINY)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Weights:
    """The weights of the gradients down and across, and of light above the picture."""

    y: FloatArray
    x: FloatArray
    excess: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class _System:
    """The normal equations of one step, in units of the lights."""

    spread: Spread
    weights: _Weights
    unit: FloatArray
    price: FloatArray

    def gathered(self, slope_y: FloatArray, slope_x: FloatArray, level: FloatArray) -> FloatArray:
        """Return the gradient by every light of a picture with these gradients and this level."""
        weighed = _divergence(self.weights.y * slope_y, self.weights.x * slope_x)
        weighed += self.weights.excess * level
        return self.spread.gathered(weighed)

    def applied(self, light: FloatArray) -> FloatArray:
        """Return the matrix times lights in their units."""
        blurred = self.spread.spread(self.unit * light)
        image = self.gathered(*gradient(blurred), blurred)
        image *= self.unit
        image += self.price * light
        return image


def _conjugate_gradients(
    system: _System, rest: FloatArray, start: FloatArray, rounds: int
) -> FloatArray:
    """Solve from a start with this residual; both are changed in place."""
    solution, way = start, rest.copy()
    size = float(np.vdot(rest, rest))
    for _ in range(rounds):
        if size < _TINY:
            break
        image = system.applied(way)
        step = np.float32(size / max(float(np.vdot(way, image)), _TINY))
        solution += step * way
        image *= step
        rest -= image
        last, size = size, float(np.vdot(rest, rest))
        way *= np.float32(size / last)
        way += rest
    return solution


def _price(light: FloatArray, steps: Steps) -> FloatArray:
    """Return the price of more light, which falls with the logarithm of a light."""
    return np.asarray(steps.price + steps.dim_price * DIM / (DIM + light), np.float32)


def _weight(rest: FloatArray, scale: float) -> FloatArray:
    """Return the weights of Geman and McClure."""
    return np.asarray(scale**-2 / (1 + (rest / scale) ** 2) ** 2, np.float32)


def gradient(image: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the differences of cells (h, w) down, (h - 1, w), and across, (h, w - 1)."""
    return image[1:] - image[:-1], image[:, 1:] - image[:, :-1]


def _divergence(y: FloatArray, x: FloatArray) -> FloatArray:
    """Return the transpose of the gradient."""
    out = np.empty((x.shape[0], y.shape[1]), np.float32)
    np.subtract(y[:-1], y[1:], out=out[1:-1])
    out[0], out[-1] = (0 - y[0], y[-1]) if len(y) else (0, 0)
    out[:, 1:] += x
    out[:, :-1] -= x
    return out


def usable_cells(clipped: Mask) -> Mask:
    """Return a mask of the cells (h, w) that are neither clipped nor beside a clipped one."""
    rows = clipped.copy()
    rows[1:] |= clipped[:-1]
    rows[:-1] |= clipped[1:]
    near = rows.copy()
    near[:, 1:] |= rows[:, :-1]
    near[:, :-1] |= rows[:, 1:]
    return ~near
