"""A gate that is not what the timing file says, and a second surface close behind the first.

A gate of another width moves all times alike; that is what [correction] offset_ps is for, so times
are judged without their median error too.
"""

from dataclasses import replace
from typing import Any, Final

import numpy as np

from camkit.report.kinds.spad.synthetic import AXIS, PULSE, Light, bound_ps, draw
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from tools.spad.limit.judged import Sweep, judged, swept

WIDTHS: Final = (1.0, 0.95, 1.05, 0.9, 1.1, 0.8, 1.25, 0.65, 1.5, 0.5, 2.0)
TIMES: Final = (1.0, 0.8, 1.25, 0.65, 1.5, 0.5, 2.0, 0.25, 4.0, 0.1)
APART_PS: Final = (900, 800, 700, 600, 500, 400, 300, 250, 200, 150, 100)
LIGHT: Final = Light(photons=1000.0, sbr=3.0)
SHAPE: Final = (32, 64)
NEAR_PS: Final = 100.0


def sweeps() -> list[Sweep]:
    """Measure wrong widths, time constants, orientation, and two surfaces."""
    return [
        swept("stated over true width of the gate", "", WIDTHS, lambda f: _wrong(f, width=f)),
        swept("stated over true time constant", "", TIMES, lambda f: _wrong(f, rc=f)),
        swept("orientation stated as", "", ("gate", "histogram"), _turned),
        swept("two returns, 1000 photons", "ps", APART_PS, lambda d: _two(d, 1000.0)),
        swept("two returns, 200 photons", "ps", APART_PS, lambda d: _two(d, 200.0)),
    ]


def _wrong(value: float | str, *, width: float = 1.0, rc: float = 1.0) -> dict[str, Any]:
    stated = replace(PULSE, width_ps=PULSE.width_ps * width, rc_ps=PULSE.rc_ps * rc)
    return _sharpened(value, Sharpener(AXIS, stated, Way(pool="1")))


def _turned(orientation: Any) -> dict[str, Any]:
    axis = TimeAxis.regular(orientation, bins=AXIS.bins, time_bin_ps=AXIS.step_ps)
    return _sharpened(orientation, Sharpener(axis, PULSE, Way(pool="1")))


def _sharpened(value: float | str, sharpener: Sharpener) -> dict[str, Any]:
    rng = np.random.default_rng(1)
    times = rng.uniform(500, 2000, SHAPE[0] * SHAPE[1])
    found = sharpener.strip(draw(times, LIGHT, rng).reshape(*SHAPE, AXIS.bins))
    errors, valid = found.time_of_flight_ps.ravel() - times, found.valid.ravel()
    offset = float(np.median(errors))
    with_offset = judged(value, errors, bound_ps(times, LIGHT), valid)["rmse_over_crb"]
    more = {"offset_ps": offset, "rmse_with_offset": np.inf if with_offset is None else with_offset}
    point = judged(value, errors - offset, bound_ps(times, LIGHT), valid, **more)
    # more than a gate off is no offset that anybody would calibrate
    point["broken"] |= abs(offset) > PULSE.width_ps
    return point


def _two(apart: float, photons: float) -> dict[str, Any]:
    rng = np.random.default_rng(int(apart))
    first = rng.uniform(500, 1200, 16 * 16)
    half = Light(photons=photons / 2, sbr=6.0)
    counts = draw(first, half, rng) + draw(first + apart, half, rng)
    found = Sharpener(AXIS, PULSE, Way(pool="1", returns=2)).strip(counts.reshape(16, 16, -1))
    errors = found.time_of_flight_ps.reshape(2, -1) - np.stack([first, first + apart])
    both = found.valid.all(axis=0).ravel()
    right = both & (np.abs(errors) < NEAR_PS).all(axis=0)
    share, inside = right.mean(), np.abs(errors / found.sigma_ps.reshape(2, -1))[:, right]
    told = {
        "valid": round(float(both.mean()), 4),
        "right": round(float(share), 4),
        "wrong": round(float((both & ~right).sum() / max(both.sum(), 1)), 4),
        "within_sigma": round(float((inside < 1).mean()), 4) if right.any() else None,
    }
    return {"value": apart, **told, "broken": bool(share < 0.5)}
