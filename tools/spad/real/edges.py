"""LinoSPAD2: bins of 0 to 156 ps by its calibration, and what it costs to take them for equal.

A pulse is drawn on the real edges of one pixel after the other, and sharpened twice: with the edges
stated, and with the mean width alone. Bins without any width are left out: they see nothing.
"""

import tempfile
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.bank import make_bank
from camkit.runtime.kinds.spad.bound import information
from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA, GaussianPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from tools.spad.real.claim import Claim
from tools.spad.real.face import product
from tools.spad.real.panels import Panel, write_panels

FILE: Final = "linospad2_tdc_calibration_A5.csv"
FWHM_PS: Final = 100.0
PHOTONS: Final = 1000.0
EVEN: Final = 0.5
PER_PIXEL: Final = 400
PIXELS: Final = 16
MARGIN_PS: Final = 200.0


def measure(folder: Path, out: Path) -> list[Claim]:
    """Measure errors with and without the edges."""
    table = np.genfromtxt(folder / FILE, delimiter=",", skip_header=1)[:, 1:]
    table = table[np.isfinite(table).all(axis=1)]
    widths = np.diff(table, axis=1)
    errors: dict[str, list[NDArray[np.float64]]] = {"stated": [], "ignored": []}
    bounds, inside = [], []
    rng = np.random.default_rng(0)
    for number in np.linspace(0, len(table) - 1, PIXELS).astype(int):
        axis = TimeAxis(orientation="histogram", edges_ps=np.unique(table[number]))
        times = rng.uniform(MARGIN_PS, axis.edges_ps[-1] - MARGIN_PS, PER_PIXEL)
        found = _errors(axis, times, rng)
        for name, own in found.items():
            errors[name].append(own[0])
        sigma = found["stated"][1]
        inside.append(np.abs(found["stated"][0]) < sigma)
        bounds.append(_bounds(axis, times))
    bound = float(np.sqrt(np.mean(np.concatenate(bounds) ** 2)))
    rms = {name: float(np.sqrt(np.mean(np.concatenate(e) ** 2))) for name, e in errors.items()}
    write_panels(
        out / "linospad2.png",
        [
            Panel(title="widths of bins, ps (pixel down)", values=widths, span=(0, 60)),
            Panel(title="error, edges stated, ps", values=_block(errors["stated"])),
            Panel(title="error, edges ignored, ps", values=_block(errors["ignored"])),
        ],
        columns=3,
    )
    return [
        Claim(capture=FILE, what="widest bin", value=widths.max(), unit="ps"),
        Claim(capture=FILE, what="mean bin", value=widths.mean(), unit="ps"),
        Claim(capture=FILE, what="bins without width", value=float((widths == 0).mean())),
        Claim(capture=FILE, what="Cramer-Rao bound, 1000 photons", value=bound, unit="ps"),
        Claim(capture=FILE, what="rms, edges stated", value=rms["stated"], unit="ps"),
        Claim(capture=FILE, what="rms over bound, stated", value=rms["stated"] / bound, most=1.05),
        Claim(
            capture=FILE,
            what="|error| below sigma, stated",
            value=float(np.mean(inside)),
            least=0.6,
        ),
        Claim(capture=FILE, what="rms, one width for all", value=rms["ignored"], unit="ps"),
    ]


def _block(rows: list[NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return rows, one per pixel, high enough to look at."""
    return np.stack(rows).repeat(PER_PIXEL // len(rows) // 2, axis=0)


def _errors(
    axis: TimeAxis, times: NDArray[np.float64], rng: np.random.Generator
) -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return errors and sigmas (p,) with the edges stated and with one width for all."""
    pulse = GaussianPulse(sigma_ps=FWHM_PS / FWHM_PER_SIGMA)
    every = np.broadcast_to(np.arange(axis.bins), (len(times), axis.bins))
    share = np.diff(axis.edges_ps) / axis.step_ps
    counts = rng.poisson(PHOTONS * axis.shares(pulse, times, every) + EVEN * share)
    laser = f"[laser]\nfwhm_ps = {FWHM_PS}\n"
    edges = ", ".join(f"{edge:.6f}" for edge in axis.edges_ps)
    first = axis.edges_ps[0] + axis.step_ps / 2
    texts = {
        "stated": f"[timing]\norientation = 'histogram'\nbin_edges_ps = [{edges}]\n{laser}",
        "ignored": f"[timing]\norientation = 'histogram'\ntime_bin_ps = {axis.step_ps}\n"
        f"first_ps = {first}\n{laser}",
    }
    with tempfile.TemporaryDirectory() as scratch:
        path = Path(scratch) / "drawn.npz"
        np.savez(path, histogram=counts.T[:, None].astype(np.uint32))
        made = {name: product(path, text, pool="1").arrays for name, text in texts.items()}
    return {
        name: (found["time_of_flight_ps"][0] - times, found["sigma_ps"][0])
        for name, found in made.items()
    }


def _bounds(axis: TimeAxis, times: NDArray[np.float64]) -> NDArray[np.float64]:
    bank = make_bank(axis, GaussianPulse(sigma_ps=FWHM_PS / FWHM_PER_SIGMA))
    told = np.interp(times, bank.mu_ps, information(bank, EVEN / PHOTONS))
    return np.asarray(1 / np.sqrt(PHOTONS * told))
