"""One edge explained by kernels: its place, its dark and bright, how sharp it is.

All colours of an edge lie at one place, so what colours differ by is the lens's. Dark and bright
belong to the scene and are fitted for each colour. A slope of the scene is not fitted: it would
take the place of wide light, and from edge to edge it falls to either side.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibration.blur.blob_basis import Blobs, FloatGrid, FloatLine
from camkit.calibration.blur.photo_edges import ColourRows, PhotoEdge

FINE: Final = 8
"""Places per pixel at which light across an edge is computed."""
MARGIN_PX: Final = 4.0
FLOOR: Final = 0.01
"""Of the step: what real edges deviate by, noise apart."""
WIDTHS: Final = np.geomspace(0.5, 2.0, 25)
"""Factors on the width of the predicted profile that are tried."""
_ROUNDS: Final = 3
_MOST_MOVE_PX: Final = 3.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ColourFit:
    """A colour of an edge, brought to a rise from 0 to 1.

    Attributes:
        distance_px: (n,) from the fitted place of the edge.
        rise: (n,) as seen.
        predicted: (n,) as predicted.
        weight: (n,) one over the variance of each.
        noise: (n,) standard deviation of each by noise alone.
        half: (n,) 0 or 1.
    """

    distance_px: FloatLine
    rise: FloatLine
    predicted: FloatLine
    weight: FloatLine
    noise: FloatLine
    half: NDArray[np.intp]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class EdgeFit:
    """An edge as kernels explain it.

    Attributes:
        moved_px: Where it lies, from where its line was fitted.
        colours: None for a colour that sees no step.
    """

    moved_px: float
    colours: tuple[ColourFit | None, ...]


def fine_places(reach_px: float) -> FloatLine:
    """Return the distances (place,) at which predicted profiles are sampled."""
    half = round((reach_px + MARGIN_PX) * FINE)
    return np.asarray(np.arange(-half, half + 1) / FINE)


def fine_rises(blobs: Blobs, edge: PhotoEdge, reach_px: float) -> FloatGrid:
    """Return (place, k): light across an edge behind each blob, see `fine_places`."""
    return blobs.rises(fine_places(reach_px), edge.outward, edge.sideways)


def fit_edge_place(
    edge: PhotoEdge, profiles: FloatGrid, places: FloatLine, *, start_px: float = 0.0
) -> EdgeFit:
    """Fit the place of an edge, and dark and bright of each colour.

    Args:
        edge: The edge.
        profiles: (c, place) predicted, from 0 to 1.
        places: (place,) px.
        start_px: Where it lies to begin with.
    """
    shift = start_px
    for _ in range(_ROUNDS):
        rest_by_move = move_by_move = 0.0
        for rows, profile in zip(edge.colours, profiles, strict=True):
            if rows is None:
                continue
            rest, move, _ = _linear(rows, profile, places, shift)
            rest_by_move += float(rest @ move)
            move_by_move += float(move @ move)
        step = rest_by_move / move_by_move if move_by_move else 0.0
        shift = float(np.clip(shift + step, start_px - _MOST_MOVE_PX, start_px + _MOST_MOVE_PX))
    return EdgeFit(
        moved_px=shift,
        colours=tuple(
            None if rows is None else _colour_fit(rows, profile, places, shift)
            for rows, profile in zip(edge.colours, profiles, strict=True)
        ),
    )


def _linear(
    rows: ColourRows, profile: FloatLine, places: FloatLine, shift: float
) -> tuple[FloatLine, FloatLine, tuple[float, float]]:
    """Return what is left, what moving the edge does to it, and (dark, step)."""
    at = rows.distance_px - shift
    light = np.interp(at, places, profile)
    slope = np.interp(at - 0.5, places, profile) - np.interp(at + 0.5, places, profile)
    share = rows.count / rows.count.sum()
    light_mean, value_mean = float(share @ light), float(share @ rows.value)
    centred = light - light_mean
    power = max(float(share @ centred**2), 1e-12)
    step = float(share @ (centred * (rows.value - value_mean))) / power
    step = step if abs(step) > 1e-9 else 1e-9
    root = np.sqrt(rows.count)
    rest = (rows.value - value_mean - step * centred) / step
    slope = slope - float(share @ slope)
    move = slope - float(share @ (slope * centred)) / power * centred
    return rest * root, move * root, (value_mean - step * light_mean, step)


def _colour_fit(
    rows: ColourRows, profile: FloatLine, places: FloatLine, shift: float
) -> ColourFit | None:
    _, _, (dark, step) = _linear(rows, profile, places, shift)
    if step <= 0:
        return None
    at = rows.distance_px - shift
    noise = rows.scatter / step / np.sqrt(rows.count)
    return ColourFit(
        distance_px=at,
        rise=(rows.value - dark) / step,
        predicted=np.interp(at, places, profile),
        weight=1 / (noise**2 + FLOOR**2),
        noise=noise,
        half=rows.half,
    )


def width_factors(
    edge: PhotoEdge, profile: FloatLine, places: FloatLine, shift: float
) -> FloatLine:
    """Return (2,): how much wider each half of an edge is than predicted.

    Args:
        edge: The edge; its middle colour is looked at.
        profile: (place,) predicted for that colour.
        places: (place,) px.
        shift: Where the edge lies.
    """
    rows = edge.colours[len(edge.colours) // 2]
    if rows is None:
        return np.full(2, np.nan)
    middle = float(np.interp(0.5, profile, places))
    factors = []
    for half in (0, 1):
        mine = rows.half == half
        at = rows.distance_px[mine] - shift
        scaled = middle + (at - middle) / WIDTHS[:, None]
        light, lower, upper = (
            np.interp(scaled + move, places, profile) for move in (0.0, -0.5, 0.5)
        )
        factors.append(_least(_misfits(light, lower - upper, rows.value[mine], rows.count[mine])))
    return np.array(factors)


def _misfits(light: FloatGrid, slope: FloatGrid, value: FloatLine, count: FloatLine) -> FloatLine:
    """Return (width,): mean squares that widened profiles leave, their places to first order."""
    table = np.stack([np.ones_like(light), light, slope], axis=-1)
    weighted = table * count[:, None]
    normal = np.einsum("wni,wnj->wij", weighted, table)
    normal += 1e-9 * count.sum() * np.eye(3)
    right = np.einsum("wni,n->wi", weighted, value)
    fitted = np.linalg.solve(normal, right[..., None])[..., 0]
    rest = value - np.einsum("wni,wi->wn", table, fitted)
    return np.asarray((rest**2) @ count)


def _least(misfits: FloatLine) -> float:
    """Return the factor of the least misfit, by the parabola through it and its neighbours."""
    i = int(misfits.argmin())
    logs = np.log(WIDTHS)
    if i in (0, misfits.size - 1):
        return float(WIDTHS[i])
    low, mid, high = misfits[i - 1 : i + 2]
    bend = low - 2 * mid + high
    offset = 0.5 * (low - high) / bend if bend > 0 else 0.0
    return float(np.exp(logs[i] + offset * (logs[1] - logs[0])))
