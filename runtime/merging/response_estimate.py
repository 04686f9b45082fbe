"""The response of a camera from a bracket itself, for pictures of 8 bits.

For each colour the logarithm g of the light of every code is sought with which the frames agree:
the sum over pixels p and frames i of w (g(code_pi) - log t_i - L_p)^2 is least, with the light L_p
of each pixel free. The L_p are eliminated, which leaves one system of 256 equations whatever the
number of pixels. w is the certainty of the code under the curve so far, times a robust weight that
takes moving things out (Geman, McClure). g is held to the curvature of sRGB where few codes speak,
equals it at the middle code, and never decreases.

References: Debevec, Malik 1997, eq. (3) (the sum, there over a hundred pixels with weights that
depend on the code alone).
"""

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from camkit.caller import option_text
from camkit.errors import DecodeError
from camkit.runtime.merging.response import FloatTable, Response, response_of, srgb_response

CODES: Final = 256
MIDDLE_CODE: Final = 128
ROUNDS: Final = 6
LEAST_PIXELS: Final = 500
"""Pixels that two frames at least must hold unclipped, in each colour."""

_CODE_SPREAD: Final = 0.5
_LIGHT_SPREAD: Final = 0.03
_SMOOTH: Final = 20.0
"""Weight of the second difference of g less that of sRGB, in mean weights of a code."""
_NEAR: Final = 1e-5
_TIED: Final = 1e6
_ROBUST_SPREADS: Final = 2.5
_LEAST_STEP: Final = 1e-6
_MAD_TO_SIGMA: Final = 1.4826

Codes = NDArray[np.uint8]


def estimate_response(codes: Codes, times_s: NDArray[np.float64]) -> Response:
    """Estimate the response of three colours.

    Args:
        codes: (frame, channel, pixel) uint8, the same pixels of every frame.
        times_s: (frame,) exposure times.

    Raises:
        DecodeError: If too few pixels are unclipped in two frames of different time.
    """
    start = srgb_response(CODES)
    log_times = np.log(times_s)
    curves = [
        _curve(codes[:, channel].astype(np.intp).T, log_times, start)
        for channel in range(codes.shape[1])
    ]
    return response_of("estimate", np.stack(curves))


def disagreement(codes: Codes, times_s: NDArray[np.float64], response: Response) -> float:
    """Return by how many codes a frame misses what the frames together say of its pixels.

    Args:
        codes: (frame, channel, pixel) uint8.
        times_s: (frame,) exposure times.
        response: The response that is judged.

    Returns:
        The median over unclipped samples; infinite where no pixel is unclipped twice.
    """
    residuals = [np.abs(residual) for _, residual in residuals_codes(codes, times_s, response)]
    every = np.concatenate(residuals)
    return float(np.median(every)) if every.size else np.inf


def residuals_codes(
    codes: Codes, times_s: NDArray[np.float64], response: Response
) -> Iterator[tuple[NDArray[np.intp], FloatTable]]:
    """Yield for each channel the unclipped codes, and by how many codes a frame misses all.

    Args:
        codes: (frame, channel, pixel) uint8.
        times_s: (frame,) exposure times.
        response: The response that is judged.
    """
    for channel in range(codes.shape[1]):
        channel_codes = codes[:, channel].astype(np.intp).T
        table = response.log_light[channel].astype(np.float64)
        trust = _trusted(channel_codes, response.clipped_from)
        weights = trust * response.precision[channel].astype(np.float64)[channel_codes]
        residual = _residual(table, channel_codes, np.log(times_s), weights)
        slope = np.maximum(np.gradient(np.maximum(table, table[1])), _LEAST_STEP)
        yield channel_codes[trust], (residual / slope[channel_codes])[trust]


def _trusted(codes: NDArray[np.intp], clipped_from: int) -> NDArray[np.bool_]:
    """Return which samples of (pixel, frame) codes speak: unclipped, in two frames at least."""
    open_ = (codes > 0) & (codes < clipped_from)
    return np.asarray(open_ & (open_.sum(axis=1) >= 2)[:, None])


def _curve(codes: NDArray[np.intp], log_times: FloatTable, start: Response) -> FloatTable:
    """Return the (256,) log light of one colour's (pixel, frame) codes."""
    trust = _trusted(codes, start.clipped_from)
    pixels = int(trust.any(axis=1).sum())
    if pixels < LEAST_PIXELS or np.ptp(log_times) == 0:
        raise DecodeError(
            f"a response is estimated from {LEAST_PIXELS} pixels or more that two frames of "
            f"different times hold unclipped; there are {pixels}: use "
            f"{option_text('response', 'srgb')} or linear"
        )
    prior = start.log_light[0].astype(np.float64)
    prior[0] = prior[1] - np.log(2)
    curve: FloatTable = prior
    robust: FloatTable = np.ones(codes.shape)
    for _ in range(ROUNDS):
        slope = np.maximum(np.gradient(curve), _LEAST_STEP)
        spread = np.sqrt((_CODE_SPREAD * slope) ** 2 + _LIGHT_SPREAD**2)[codes]
        weights = trust * robust / spread**2
        curve = _solve(codes, log_times, weights, prior)
        misfit = np.abs(_residual(curve, codes, log_times, weights)) / spread
        scale = _ROBUST_SPREADS * _MAD_TO_SIGMA * max(float(np.median(misfit[trust])), 1e-3)
        robust = 1 / (1 + (misfit / scale) ** 2)
    return curve


def _solve(
    codes: NDArray[np.intp], log_times: FloatTable, weights: FloatTable, prior: FloatTable
) -> FloatTable:
    """Return the curve that fits best with these weights of the samples."""
    pixels, frames = codes.shape
    total = np.maximum(weights.sum(axis=1), 1e-300)
    rows = np.repeat(np.arange(pixels), frames)
    hits = sparse.csr_array((weights.ravel(), (rows, codes.ravel())), shape=(pixels, CODES))
    diagonal = np.bincount(codes.ravel(), weights.ravel(), CODES)
    mean_time = (weights * log_times).sum(axis=1) / total
    pulls = np.bincount(codes.ravel(), (weights * (log_times - mean_time[:, None])).ravel(), CODES)
    shared = (hits.T @ (sparse.diags_array(1 / total) @ hits)).toarray()
    matrix = np.diag(diagonal) - shared
    unit = np.trace(matrix) / CODES
    bends = np.diff(np.eye(CODES), 2, axis=0)
    penalty = unit * (_SMOOTH * bends.T @ bends + _NEAR * np.eye(CODES))
    penalty[MIDDLE_CODE, MIDDLE_CODE] += _TIED * unit
    curve = np.linalg.solve(matrix + penalty, pulls + penalty @ prior)
    return np.asarray(np.maximum.accumulate(curve + _LEAST_STEP * np.arange(CODES)))


def _residual(
    curve: FloatTable, codes: NDArray[np.intp], log_times: FloatTable, weights: FloatTable
) -> FloatTable:
    """Return the (pixel, frame) residuals of the log light against its mean over frames."""
    differences = np.where(
        weights > 0, np.where(np.isfinite(curve), curve, 0)[codes] - log_times, 0
    )
    total = np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)
    return np.asarray(differences - (weights * differences).sum(axis=1, keepdims=True) / total)
