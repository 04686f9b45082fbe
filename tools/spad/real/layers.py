"""A partly transparent screen before a figure: two returns against their reference."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.io
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from tools.spad.real.claim import Claim
from tools.spad.real.face import product
from tools.spad.real.panels import Panel, write_panels

FILE: Final = "two_layer.mat"
REFERENCE: Final = "two_layer_obj.mat"
BIN_PS: Final = 8
TIMING: Final = f"""
[timing]
orientation = "histogram"
time_bin_ps = {4 * BIN_PS}
first_ps = {3000 * BIN_PS + 2 * BIN_PS}
bins = 1000
[array]
stamp_ps = {BIN_PS}
"""
NEAR_BINS: Final = 300
"""A return within so many of the reference shows its layer: layers lie 1500 apart."""


WALL_BINS: Final = 6240
"""Of the second layer: what the reference places beyond is wall, nearer is figure."""
WITHIN_BINS: Final = 40


def measure(folder: Path, out: Path) -> list[Claim]:
    """Measure both layers, by squares as needed and by squares of 3."""
    reference = scipy.io.loadmat(folder / REFERENCE)
    known = np.stack([reference["T_first"], reference["T_second"]])
    claims, panels = [], []
    for pool in ("auto", "3"):
        found = product(folder / FILE, TIMING, returns="2", pool=pool)
        share = found.arrays["valid"].all(axis=0).mean()
        claims += [
            Claim(capture=FILE, what=f"two returns, pool {pool}", value=share),
            Claim(capture=FILE, what=f"CPU, pool {pool}", value=found.cpu_s, unit="s"),
            *_judged(found.arrays, known, pool),
        ]
        panels += [
            Panel(title=f"{name} return, pool {pool}, m", values=layer)
            for name, layer in zip(("first", "second"), found.arrays["depth_m"], strict=True)
        ]
    scale = BIN_PS * LIGHT_M_PER_PS / 2
    panels += [
        Panel(title=f"{name}, reference, m", values=layer * scale)
        for name, layer in zip(("first", "second"), known, strict=True)
    ]
    write_panels(out / "two_layers.png", panels, columns=3)
    return claims


def _judged(arrays: dict[str, NDArray[Any]], known: NDArray[np.float64], pool: str) -> list[Claim]:
    """Judge every layer by the return of a pixel that lies nearest to its reference."""
    bins = np.where(arrays["valid"], arrays["time_of_flight_ps"] / BIN_PS, np.nan)
    wall = known[1] > WALL_BINS
    parts = (
        ("screen", known[0], np.isfinite(known[0])),
        ("wall", known[1], wall),
        ("figure", known[1], np.isfinite(known[1]) & ~wall),
    )
    claims = []
    for name, layer, where in parts:
        offsets = bins - layer
        away = np.where(np.isfinite(offsets), np.abs(offsets), np.inf)
        nearest = np.take_along_axis(offsets, away.argmin(axis=0)[None], 0)[0]
        shown = where & (np.abs(np.nan_to_num(nearest, nan=np.inf)) < NEAR_BINS)
        centre = np.median(nearest[shown])
        off = np.abs(nearest[shown] - centre)
        told = [
            ("shown", shown.sum() / where.sum(), ""),
            ("median from the reference", centre, "bins"),
            ("median error about that", np.median(off), "bins"),
            (f"within {WITHIN_BINS} bins of it", np.mean(off < WITHIN_BINS), ""),
        ]
        claims += [
            Claim(capture=FILE, what=f"{name}, pool {pool}: {what}", value=float(v), unit=unit)
            for what, v, unit in told
        ]
    return claims
