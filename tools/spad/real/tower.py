"""A tower 9.8 km away, 3.7 photons a pixel: two random halves of the photons against each other.

The rule for chosen squares (`camkit.runtime.kinds.spad.pooling`) was chosen with the split of seed
0 in sight, which therefore shows pictures alone; what is claimed is the mean of other splits. They
hold the same photons: no second capture of the kind is at hand.
"""

import tempfile
from pathlib import Path
from typing import Any, Final

import numpy as np
import scipy.io
from numpy.typing import NDArray

from tools.spad.real.claim import Claim
from tools.spad.real.face import product
from tools.spad.real.panels import Panel, write_panels

FILE: Final = "tower_9.8km.mat"
APART_M: Final = 0.3
TIMING: Final = """
[timing]
orientation = "histogram"
time_bin_ps = 250
first_ps = 5180125
bins = 800
[laser]
fwhm_ps = 1000
[array]
key = "data_processed"
"""
POOLS: Final = ("auto", "1", "3", "5")
SPLITS: Final = range(1, 11)
"""Seeds of the splits that are judged."""
LEAST_BOTH: Final = 0.25
LEAST_RIGHT: Final = 0.97


def measure(folder: Path, out: Path) -> list[Claim]:
    """Measure how far halves agree, for every side of squares."""
    cells = scipy.io.loadmat(folder / FILE)["data_processed"]
    claims, panels = [], []
    for pool in POOLS:
        first, _, apart = _halved(cells, 0, pool)
        panels.append(Panel(title=f"half, pool {pool}: depth, m", values=first))
        panels.append(Panel(title=f"pool {pool}: apart, m", values=apart, span=(0, 0.6)))
        both, right = np.array([_shares(_halved(cells, seed, pool)[2]) for seed in SPLITS]).T
        told = (
            (f"accepted in both halves, pool {pool}", both, LEAST_BOTH),
            (f"of them within 0.3 m, pool {pool}", right, LEAST_RIGHT),
        )
        for what, found, least in told:
            claims.append(Claim(capture=FILE, what=what, value=found.mean(), least=least))
            claims.append(Claim(capture=FILE, what=f"{what}, worst split", value=found.min()))
    whole = product(folder / FILE, TIMING)
    panels.insert(0, Panel(title="all photons: depth, m", values=whole.arrays["depth_m"]))
    panels.insert(1, Panel(title="photons", values=whole.arrays["intensity"], colors="gray"))
    write_panels(out / "tower.png", panels, columns=5)
    valid = whole.arrays["valid"].mean()
    return [
        *claims,
        Claim(capture=FILE, what="accepted of all photons, pool auto", value=valid),
        Claim(capture=FILE, what="CPU of all photons, pool auto", value=whole.cpu_s, unit="s"),
    ]


def _halved(
    cells: NDArray[Any], seed: int, pool: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return depth of both halves, and how far they lie apart; NaN where either is not valid."""
    made = []
    with tempfile.TemporaryDirectory() as scratch:
        for half in split(cells, np.random.default_rng(seed)):
            path = Path(scratch) / "half.mat"
            scipy.io.savemat(path, {"data_processed": half})
            made.append(product(path, TIMING, pool=pool).arrays["depth_m"])
    return made[0], made[1], np.abs(made[0] - made[1])


def _shares(apart: NDArray[np.float64]) -> tuple[float, float]:
    both = np.isfinite(apart)
    return float(both.mean()), float(np.mean(apart[both] < APART_M))


def split(
    cells: NDArray[Any], rng: np.random.Generator
) -> tuple[NDArray[np.object_], NDArray[np.object_]]:
    """Return cells of stamps as two: each photon falls to either by the toss of a coin."""
    halves = np.empty(cells.shape, object), np.empty(cells.shape, object)
    for place in np.ndindex(cells.shape):
        stamps = np.ravel(cells[place])
        heads = rng.random(stamps.size) < 0.5
        for half, own in zip(halves, (heads, ~heads), strict=True):
            # an empty cell is what MATLAB writes for it
            half[place] = stamps[own][:, None] if own.any() else np.zeros((1, 0))
    return halves
