"""Fluorescence: a map of lifetimes, beside flimlib where that is installed.

flimlib (GPL, no dependency of camkit) fits the same model, a decay behind a Gaussian and a
background, by maximum likelihood. It fits no time of the pulse, so it is told width and place that
camkit found, pixels in groups of nearly the same place; half a bin later, for it samples decays
where bins begin. It starts from its own triple integral.

References: flimlib 2.2, the library of TRI2 and SLIM Curve.
"""

import importlib
import sys
import tempfile
import time
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.kinds.spad.pulse import FWHM_PER_SIGMA
from tools.spad.real.claim import Claim
from tools.spad.real.face import Product, product
from tools.spad.real.panels import Panel, write_panels

FILE: Final = "bh_flim_128x128x256.sdt.zip"
WINDOW: Final = "[lifetime]\nfrom_ps = 1000\nto_ps = 11700\n"
FOLDED: Final = WINDOW + "period_ps = 12500\n"
BEGIN: Final = 45
END: Final = 240
"""Bins that flimlib is given: from a little before the pulse."""
GROUPS: Final = 16
SLOWEST_PS: Final = 20_000.0
RELIABLE: Final = 5000
"""Photons of pixels whose lifetimes are compared."""


def measure(folder: Path, out: Path) -> list[Claim]:
    """Measure lifetimes, and hold them against those of flimlib."""
    path = folder / FILE
    found, folded = (product(path, text, product="lifetime") for text in (WINDOW, FOLDED))
    arrays = found.arrays
    bright = arrays["valid"] & (arrays["intensity"] > RELIABLE)
    residual = _halves(path)
    claims = [
        Claim(capture=FILE, what="pixels believed", value=arrays["valid"].mean()),
        _median("median lifetime", arrays, bright),
        _median("median lifetime, period stated", folded.arrays, bright),
        Claim(
            capture=FILE,
            what="median sigma",
            value=np.median(arrays["sigma_ps"][bright]),
            unit="ps",
        ),
        Claim(capture=FILE, what="CPU seconds, all", value=found.cpu_s, unit="s"),
        Claim(capture=FILE, what="two halves of photons: 68 % of error / sigma", value=residual),
    ]
    panels = [
        Panel(title="lifetime, ps", values=arrays["lifetime_ps"], span=(2000, 3000)),
        Panel(
            title="with the laser's period, ps",
            values=folded.arrays["lifetime_ps"],
            span=(2000, 3000),
        ),
        Panel(title="photons", values=arrays["intensity"], colors="gray"),
        Panel(title="sigma, ps", values=arrays["sigma_ps"], span=(0, 150)),
    ]
    theirs = _by_flimlib(path, found, bright)
    if theirs is None:
        print("flimlib is not installed: lifetimes stand alone", file=sys.stderr)
    else:
        claims += theirs[0]
        apart = np.where(bright, theirs[1] - arrays["lifetime_ps"], np.nan)
        panels.append(Panel(title="flimlib, ps", values=theirs[1], span=(2000, 3000)))
        panels.append(Panel(title="flimlib less camkit, ps", values=apart, span=(-150, 150)))
    write_panels(out / "lifetimes.png", panels, columns=3)
    return claims


def _median(what: str, arrays: dict[str, NDArray[Any]], bright: NDArray[np.bool_]) -> Claim:
    value = np.nanmedian(arrays["lifetime_ps"][bright])
    return Claim(capture=FILE, what=what, value=value, unit="ps")


def _halves(path: Path) -> float:
    """Return the 68 % quantile of the difference of two halves over its sigma."""
    frames = _frames(path)
    first = np.random.default_rng(0).binomial(frames.astype(np.int64), 0.5)
    with tempfile.TemporaryDirectory() as scratch:
        made = []
        for number, half in enumerate((first, frames.astype(np.int64) - first)):
            capture = Path(scratch) / f"half{number}.npz"
            np.savez(capture, histogram=half.astype(np.uint16))
            timing = f"[timing]\norientation = 'histogram'\ntime_bin_ps = 48.828\n{WINDOW}"
            made.append(product(capture, timing, product="lifetime").arrays)
    both = made[0]["valid"] & made[1]["valid"] & (made[0]["intensity"] > RELIABLE / 2)
    apart = made[0]["lifetime_ps"] - made[1]["lifetime_ps"]
    sigma = np.hypot(made[0]["sigma_ps"], made[1]["sigma_ps"])
    return float(np.quantile(np.abs(apart / sigma)[both], 0.6827))


def _frames(path: Path) -> NDArray[Any]:
    return np.asarray(product(path, "", product="transient").arrays["transient"])


def _by_flimlib(
    path: Path, found: Product, bright: NDArray[np.bool_]
) -> tuple[list[Claim], NDArray[np.float64]] | None:
    """Return claims and lifetimes (h, w) in ps; None where flimlib is not installed."""
    try:
        flimlib = importlib.import_module("flimlib")
    except ImportError:
        return None
    counts = np.ascontiguousarray(_frames(path)[BEGIN:END].transpose(1, 2, 0), np.float32)
    bin_ns = found.record["time_bin_ps"] / 1000
    places = found.arrays["time_of_flight_ps"] / 1000 / bin_ns - BEGIN + 0.5
    sigma_bins = found.record["pulse"]["fwhm_ps"] / FWHM_PER_SIGMA / 1000 / bin_ns
    theirs, spent = np.full(bright.shape, np.nan), 0.0
    edges = np.quantile(places[bright], np.linspace(0, 1, GROUPS + 1))
    group = np.clip(np.searchsorted(edges, places, side="right") - 1, 0, GROUPS - 1)
    for number in range(GROUPS):
        own = bright & (group == number)
        began = time.process_time()
        theirs[own] = 1000 * _fitted(
            flimlib, counts[own], bin_ns, float(np.median(places[own])), sigma_bins
        )
        spent += time.process_time() - began
    kept = bright & np.isfinite(theirs) & (theirs > 0) & (theirs < SLOWEST_PS)
    own = found.arrays["lifetime_ps"][kept]
    apart = theirs[kept] - own
    middle = np.median(apart)
    spread = np.quantile(np.abs(apart - middle), 0.6827)
    alike = np.corrcoef(theirs[kept], own)[0, 1]
    told = [
        ("flimlib: share of these pixels that it fits", kept.sum() / bright.sum(), ""),
        ("flimlib: median lifetime", np.median(theirs[kept]), "ps"),
        ("flimlib less camkit, median", middle, "ps"),
        ("flimlib less camkit, 68 % of its spread", spread, "ps"),
        ("correlation with flimlib", alike, ""),
        ("flimlib: CPU seconds of its fits", spent, "s"),
    ]
    claims = [Claim(capture=FILE, what=w, value=float(v), unit=u) for w, v, u in told]
    return claims, theirs


def _fitted(
    flimlib: Any, counts: NDArray[np.float32], bin_ns: float, at: float, sigma_bins: float
) -> NDArray[np.float64]:
    """Return lifetimes (p,) in ns of pixels whose pulse lies at a bin."""
    prompt = np.exp(-0.5 * ((np.arange(2 * int(at) + 2) - at) / sigma_bins) ** 2)
    after = int(at + 3 * sigma_bins)
    rough = flimlib.GCI_triple_integral_fitting_engine(bin_ns, counts, fit_start=after)
    start = np.stack([rough.Z, rough.A, rough.tau], axis=-1).astype(np.float32)
    fitted = flimlib.GCI_marquardt_fitting_engine(
        bin_ns,
        counts,
        np.where(np.isfinite(start), start, np.float32(1.0)),
        fit_start=1,
        instr=(prompt / prompt.sum()).astype(np.float32),
        noise_type="NOISE_MLE",
        compute_fitted=False,
        compute_residuals=False,
        compute_covar=False,
        compute_alpha=False,
        compute_erraxes=False,
    )
    return np.asarray(fitted.param[..., 2], np.float64)
