"""Curves of few numbers, sRGB and powers, that may explain a bracket as well as any other.

What a curve leaves is judged by code: the median residual of each eight codes, which noise and what
moved leave alone and a wrong curve does not. Where it stays within the rounding of 8 bits, a curve
of 256 free numbers can only follow that rounding: with the same ratio of the colours everywhere, a
JPEG rounds each code always the same way, and shadows came out 10 to 20 % wrong.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from camkit.runtime.merging.response import Response, response_of, srgb_response
from camkit.runtime.merging.response_estimate import CODES, MIDDLE_CODE, residuals_codes

GAMMAS: Final = (1.0, 3.0)
MOST_MISFIT_CODES: Final = 0.75
"""Residual that rounding leaves: JPEGs of sRGB at most 0.57 with a noise of one code, other curves
1.4 and more (tests/runtime/merging/test_known_curves.py)."""
_BIN_CODES: Final = 8
_LEAST_SAMPLES: Final = 50

Codes = NDArray[np.uint8]
Times = NDArray[np.float64]


def known_curve(codes: Codes, times_s: Times) -> tuple[Response, str] | None:
    """Return a curve of few numbers that explains the frames, and its name; None if none does.

    Args:
        codes: (frame, channel, pixel) uint8.
        times_s: (frame,) exposure times.
    """
    plain = srgb_response(CODES)
    if misfit_codes(codes, times_s, plain) <= MOST_MISFIT_CODES:
        return plain, "sRGB"
    fit = minimize_scalar(
        lambda gamma: misfit_codes(codes, times_s, power_response(gamma)),
        bounds=GAMMAS,
        method="bounded",
        options={"xatol": 0.005},
    )
    if fit.fun <= MOST_MISFIT_CODES:
        return power_response(float(fit.x)), f"a gamma of {fit.x:.2f}"
    return None


def power_response(gamma: float) -> Response:
    """Return the response of codes that are a power of light; the middle code is that of sRGB."""
    with np.errstate(divide="ignore"):
        table = gamma * np.log(np.arange(CODES) / (CODES - 1))
    table += srgb_response(CODES).log_light[0, MIDDLE_CODE] - table[MIDDLE_CODE]
    return response_of("estimate", np.tile(table, (3, 1)))


def misfit_codes(codes: Codes, times_s: Times, response: Response) -> float:
    """Return the root mean square over codes of the median residual there; infinite without any.

    Args:
        codes: (frame, channel, pixel) uint8.
        times_s: (frame,) exposure times.
        response: The response that is judged.
    """
    medians: list[float] = []
    for channel_codes, residual in residuals_codes(codes, times_s, response):
        bins = channel_codes // _BIN_CODES
        filled = np.flatnonzero(np.bincount(bins) >= _LEAST_SAMPLES)
        medians.extend(float(np.median(residual[bins == number])) for number in filled)
    return float(np.sqrt(np.mean(np.square(medians)))) if medians else np.inf
