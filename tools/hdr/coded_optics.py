"""A measured PSF made ready, its parts, and how far they explain a capture of a known scene.

    PSF as stated -> background off, core in the middle -> which way up -> parts against a capture

The reference is what the lens without plate saw, so its blur is in it twice when the PSF spreads
it: small beside what is told apart here.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final
from zipfile import BadZipFile

import numpy as np
import scipy.ndimage
import scipy.optimize
from numpy.typing import NDArray

from camkit.calibration.lattice import Lattice
from camkit.calibration.light import background, fit_core
from camkit.contracts import FloatArray
from camkit.errors import DecodeError
from camkit.runtime.kinds.hdr.streaks.convolution import Convolution

CORE_PX: Final = 12.0
PEAK_PX: Final = 14.0
"""Radius of a peak beside the core: it is drawn out by colour."""
APART_PX: Final = CORE_PX + PEAK_PX / 2
DARK: Final = 0.1
"""Added to light where misfits are weighed by it."""

Mask = NDArray[np.bool_]
TURNS: Final[dict[str, Callable[[FloatArray], FloatArray]]] = {
    "as stated": lambda psf: psf,
    "half turn": lambda psf: np.ascontiguousarray(psf[:, ::-1, ::-1]),
    "left for right": lambda psf: np.ascontiguousarray(psf[:, :, ::-1]),
    "upside down": lambda psf: np.ascontiguousarray(psf[:, ::-1]),
}


def read_psf(file: Path) -> FloatArray:
    """Read `psf_val` (n, n, 1, 3) of an npz file as (3, n, n), each of sum 1.

    Raises:
        DecodeError: If it is not there, or is no PSF with a middle.
    """
    try:
        with np.load(file, allow_pickle=False) as arrays:
            values = np.asarray(arrays["psf_val"], np.float64)
    except (OSError, KeyError, TypeError, ValueError, BadZipFile) as error:
        raise DecodeError(f"{file}: expected an npz file with psf_val ({error})") from error
    side = values.shape[0] if values.ndim else 0
    if values.shape != (side, side, 1, 3) or side % 2 == 0:
        raise DecodeError(f"{file}: psf_val must be (n, n, 1, 3), n odd; got {values.shape}")
    psf = values[:, :, 0].transpose(2, 0, 1)
    sums = psf.sum(axis=(1, 2), keepdims=True)
    if not (np.isfinite(sums).all() and sums.min() > 0 and psf.min() >= 0):
        raise DecodeError(f"{file}: psf_val must be finite and >= 0, with light in every colour")
    return np.asarray(psf / sums, np.float32)


def cleaned_psf(psf: FloatArray) -> tuple[FloatArray, dict[str, Any]]:
    """Take the background off a PSF and put its core in the middle, as `calibrate psf` does.

    Returns:
        (3, n, n), each of sum 1, and what was found.
    """
    half = psf.shape[1] // 2
    levels = [background([plane])[0] for plane in psf]
    rest = [plane.astype(np.float64) - level for plane, level in zip(psf, levels, strict=True)]
    middle = fit_core(Lattice.of_plane(rest[1]), half, half)
    to_middle = (half - middle.y, half - middle.x)
    moved = [scipy.ndimage.shift(plane, to_middle, order=3) for plane in rest]
    clean = np.maximum(np.stack(moved), 0)
    clean /= clean.sum(axis=(1, 2), keepdims=True)
    found = clean.astype(np.float32)
    facts = {
        "side_px": psf.shape[1],
        "background_share": [round(float(level * psf[0].size), 4) for level in levels],
        "core_off_middle_px": [round(-side, 2) for side in to_middle],
        "shares": {name: _shares(found, part) for name, part in parts_of(found).items()},
        "within_3_px": _shares(found, _disc(found, (0, 0), 3.0)),
    }
    return found, facts


def parts_of(psf: FloatArray) -> dict[str, Mask]:
    """Tell core, the brightest peak beside it, the one opposite, and the haze of a PSF."""
    far = ~_disc(psf, (0, 0), APART_PX)
    smooth = scipy.ndimage.uniform_filter(psf.mean(axis=0), int(PEAK_PX))
    half = psf.shape[1] // 2
    row, column = np.unravel_index(int(np.where(far, smooth, 0).argmax()), smooth.shape)
    place = int(row) - half, int(column) - half
    core = _disc(psf, (0, 0), CORE_PX)
    peak = _disc(psf, place, PEAK_PX) & ~core
    opposite = _disc(psf, (-place[0], -place[1]), PEAK_PX) & ~core & ~peak
    return {"core": core, "peak": peak, "opposite": opposite, "haze": ~(core | peak | opposite)}


def seen_through(light: FloatArray, psf: FloatArray) -> FloatArray:
    """Return light (3, h, w) spread by a PSF; what lies outside the frame is dark."""
    shape = light.shape[1], light.shape[2]
    thrown = [Convolution(k, shape).spread(p) for k, p in zip(psf, light, strict=True)]
    return np.asarray(np.maximum(np.stack(thrown), 0), np.float32)


def explained(
    capture: FloatArray, reference: FloatArray, psf: FloatArray, where: Mask
) -> dict[str, Any]:
    """Return how far the reference through each part of the PSF explains a capture.

    Args:
        capture: (3, h, w).
        reference: (3, h, w), laid on it.
        psf: (3, n, n).
        where: (h, w) pixels that are compared.

    Returns:
        `factors` of core, peak, opposite, haze and an even light (of white) for every colour, not
        negative, in least squares of the misfit as a share of the light; `misfit` with them,
        `misfit_as_stated` with the PSF as it is.
    """
    parts = parts_of(psf)
    thrown = [seen_through(reference, np.where(part, psf, 0)) for part in parts.values()]
    factors, free, stated = [], [], []
    for colour in range(3):
        seen = capture[colour][where].astype(np.float64)
        weight = 1 / (DARK + seen)
        columns = [t[colour][where] for t in thrown] + [np.ones(seen.size)]
        matrix = np.stack(columns, axis=1) * weight[:, None]
        found, rest = scipy.optimize.nnls(matrix, seen * weight)
        size = float(np.linalg.norm(seen * weight))
        factors.append([round(float(f), 3) for f in found])
        free.append(round(float(rest) / size, 4))
        plain = matrix[:, :-1].sum(axis=1) - seen * weight
        stated.append(round(float(np.linalg.norm(plain)) / size, 4))
    named = dict(zip([*parts, "even"], np.array(factors).T.tolist(), strict=True))
    return {"factors": named, "misfit": free, "misfit_as_stated": stated}


def _disc(psf: FloatArray, place: tuple[int, int], radius_px: float) -> Mask:
    offset = np.arange(psf.shape[1]) - psf.shape[1] // 2
    y, x = offset[:, None] - place[0], offset[None, :] - place[1]
    return np.asarray(np.hypot(y, x) <= radius_px)


def _shares(psf: FloatArray, part: Mask) -> list[float]:
    return [round(float(plane[part].sum(dtype=np.float64)), 4) for plane in psf]
