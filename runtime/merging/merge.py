"""Frames merged into one picture: each sample of each frame by its own certainty.

Linear samples x of a frame of time t tell the light x / t with the variance (shot x + read) / t^2.
The signal in it is that which longer frames predict, since a weight by the sample's own noise
prefers those that noise made dark. Coded samples are averaged as logarithms, see `response`.

References: Robertson et al. 2003; Hasinoff, Durand, Freeman 2010, eq. (3) (noise-optimal weights).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.cfa import cfa_channels
from camkit.errors import ContractError, DecodeError
from camkit.noise import NoiseModel
from camkit.runtime.capture import SATURATION_SHARE, Capture
from camkit.runtime.merging.average import Average, BoolArray, Exposed
from camkit.runtime.merging.exposures import exposure_factors
from camkit.runtime.merging.known_curves import known_curve
from camkit.runtime.merging.response import Response, ResponseName, srgb_response
from camkit.runtime.merging.response_estimate import disagreement, estimate_response
from camkit.runtime.merging.survey import Frame, Survey, cropped, read_frame
from camkit.runtime.signal.noise import fallback_noise, measure_noise

BAND_ROWS: Final = 256
_QUANTISATION: Final = 1 / 12
_LEAST_VARIANCE: Final = 1e-14
_LEAST_CERTAINTY: Final = 1e-3
_EXPOSURE_ROUNDS: Final = 2
_SAME_FACTOR: Final = 0.005
_NAMED_FRAMES: Final = 3
_NOTED_FACTOR: Final = 0.02

DarkRows = Callable[[Frame, int, int], tuple[FloatArray, BoolArray]]
"""Gives the dark light of rows of a frame, and where it hides what came from the scene."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Merged:
    """The light of a bracket.

    Attributes:
        light: (channel, h, w) float32, a mosaic as one channel; 1.0 = white of the longest frame.
        precision: (channel, h, w) float32, one over the variance of `light` for linear frames, of
            its logarithm for coded ones; 0 where no frame was usable.
        response: What the codes were taken for.
        clipped_fraction: Share of samples that are clipped in every frame.
        times_s: Exposure times of the frames, as the frames agree on them.
    """

    light: FloatArray
    precision: FloatArray
    response: ResponseName
    clipped_fraction: float
    times_s: tuple[float, ...]


def choose_response(survey: Survey, wish: ResponseName | None) -> tuple[Response | None, str]:
    """Return what codes stand for, None for linear samples, and a note where it was a choice.

    Without a wish, pictures of 8 bits are estimated and all others are linear, as captures are
    elsewhere. The estimate gives way to a known curve that explains the frames to within the
    rounding of their codes, and to sRGB where sRGB explains them better or too little is unclipped
    in two of them.

    Raises:
        ContractError: If the frames cannot have that response.
        DecodeError: If too little is there to estimate from.
    """
    codes, coded = survey.codes, np.issubdtype(survey.like.samples.dtype, np.integer)
    if wish in ("srgb", "estimate") and (survey.is_raw or not coded):
        raise ContractError(
            f"RAW and float frames are linear; leave {option_text('response', wish)} out"
        )
    if wish == "estimate" and codes is None:
        raise ContractError(
            f"a response is estimated from 8-bit pictures; use {option_text('response', 'srgb')}"
        )
    if wish == "linear" or (wish is None and codes is None):
        is_choice = wish is None and coded and not survey.is_raw
        cure = option_text("response", "srgb")
        note = f"frames of 16 bits are taken as linear light; if they are coded, add {cure}"
        return None, note if is_choice else ""
    plain = srgb_response(int(survey.like.white_level) + 1)
    if wish == "srgb" or codes is None:
        return plain, ""
    match = known_curve(codes, survey.times_s)
    if match is not None:
        curve, name = match
        return curve, f"the response {name} fits the frames to within rounding"
    try:
        estimate = _estimated(codes, survey.times_s)
    except DecodeError:
        if wish == "estimate":
            raise
        return (
            plain,
            "too few pixels are unclipped in two frames to estimate a response: sRGB is used",
        )
    misses = [disagreement(codes, survey.times_s, r) for r in (estimate, plain)]
    if wish is None and misses[0] >= misses[1]:
        return plain, "sRGB fits the frames as well as an estimate: sRGB is used"
    return estimate, _exposure_note(survey, estimate)


def _estimated(codes: NDArray[np.uint8], times_s: NDArray[np.float64]) -> Response:
    """Return the response, with the exposures on which the frames agree under it."""
    response = estimate_response(codes, times_s)
    factors = np.ones(times_s.size)
    for _ in range(_EXPOSURE_ROUNDS):
        old_factors, factors = factors, exposure_factors(codes, times_s, response)
        if np.allclose(factors, old_factors, rtol=_SAME_FACTOR):
            break
        response = estimate_response(codes, times_s * factors)
    return replace(response, factors=() if (factors == 1).all() else tuple(factors.tolist()))


def _exposure_note(survey: Survey, response: Response) -> str:
    pairs = list(zip(survey.frames, response.factors, strict=False))
    outliers = sorted(
        ((f.path.name, x) for f, x in pairs if abs(x - 1) > _NOTED_FACTOR),
        key=lambda pair: -abs(np.log(pair[1])),
    )
    if not outliers:
        return ""
    text = ", ".join(f"{name} {factor:.2f} times" for name, factor in outliers[:_NAMED_FRAMES])
    more = (
        f", and {len(outliers) - _NAMED_FRAMES} more by smaller factors"
        if len(outliers) > _NAMED_FRAMES
        else ""
    )
    return (
        "exposures were corrected, since frames are brighter or darker than their stated times: "
        f"{text}{more}"
    )


def merge(survey: Survey, response: Response | None, dark: DarkRows | None = None) -> Merged:
    """Merge the frames of a bracket.

    Args:
        survey: The bracket.
        response: What codes stand for; None for linear samples.
        dark: Taken off linear samples.

    Raises:
        DecodeError: If a frame cannot be read any more, or changed in between.
    """
    average = Average.empty(survey.like.plane_shape)
    clipped_samples, noise = 0, None
    times_s = survey.times_s
    if response is not None and response.factors:
        times_s = times_s * response.factors
    for frame, time_s in zip(survey.frames, times_s.tolist(), strict=True):
        capture = read_frame(frame.path, survey.mosaic)
        if capture.sha256 != frame.sha256:
            raise DecodeError(f"{frame.path.name} changed while it was read; merge again")
        capture = cropped(capture, survey.like.window)
        if response is not None:
            expose: _Coded | _Linear = _Coded(response)
        else:
            # what files do not state is measured where there is most light
            noise = noise or frame.noise or measure_noise(capture)
            expose = _Linear(survey.like, frame, frame.noise or noise, dark)
        share = time_s / times_s[0]
        clipped_samples = 0
        for top in range(0, capture.height, BAND_ROWS):
            bottom = min(top + BAND_ROWS, capture.height)
            state = average.value[:, top:bottom], average.precision[:, top:bottom]
            exposed = expose.rows(capture, top, bottom, share, state)
            average.add(top, bottom, exposed)
            clipped_samples += int(np.count_nonzero(exposed.clipped & (state[1] == 0)))
    light = average.value
    if response is not None:
        np.exp(light, out=light)
    return Merged(
        light=np.nan_to_num(light, copy=False, nan=0.0),
        precision=average.precision,
        response="linear" if response is None else response.name,
        clipped_fraction=clipped_samples / light.size,
        times_s=tuple(times_s.tolist()),
    )


class _Coded:
    """Codes of pictures as logarithms of light."""

    def __init__(self, response: Response) -> None:
        self._response = response

    def rows(
        self,
        capture: Capture,
        top: int,
        bottom: int,
        share: float,
        _state: tuple[FloatArray, FloatArray],
    ) -> Exposed:
        """Return what rows say, exposed by a share of the longest time."""
        codes, tables = capture.samples[:, top:bottom], self._response
        clipped = codes >= tables.clipped_from
        inside = _certainty(codes, tables.log_light.shape[1])
        value = np.stack([t[c] for t, c in zip(tables.log_light, codes, strict=True)])
        return Exposed(
            value=value - np.float32(np.log(share)),
            precision=inside
            * np.stack([t[c] for t, c in zip(tables.precision, codes, strict=True)]),
            usable=~clipped & (codes > 0),
            clipped=clipped,
        )


def _certainty(codes: NDArray[Any], count: int) -> FloatArray:
    """Return (rows, w) how far the colours of a pixel are from both ends of their codes, 0..1.

    A camera mixes its colours before it codes them: one that is clipped, or lost in the dark, makes
    the others of its pixel doubtful too.
    """
    top = count - 1
    margin = np.minimum(codes, top - codes).mean(axis=0, dtype=np.float32) / np.float32(top / 2)
    return np.asarray(np.maximum(margin, np.float32(_LEAST_CERTAINTY)))


class _Linear:
    """Linear samples as light."""

    def __init__(
        self, like: Capture, frame: Frame, noise: NoiseModel, dark: DarkRows | None
    ) -> None:
        if like.cfa is None and len(noise.shot) != like.channels:
            noise = fallback_noise(like.channels)
        self._frame, self._dark = frame, dark
        self._shot = _spread_over(like, noise.shot)
        self._read = _spread_over(like, _read_variance(like, noise))

    def rows(
        self,
        capture: Capture,
        top: int,
        bottom: int,
        share: float,
        state: tuple[FloatArray, FloatArray],
    ) -> Exposed:
        """Return what rows say, exposed by a share of the longest time."""
        shape = (-1, bottom - top, capture.width)
        light = capture.linear_rows(top, bottom).reshape(shape)
        clipped = clipped_rows(capture, top, bottom).reshape(shape)
        usable = ~clipped & np.isfinite(light)
        shot, read = (_rows_of(part, bottom - top) for part in (self._shot, self._read))
        hidden: FloatArray | np.float32 = np.float32(0)
        if self._dark is not None:
            dark, broken = self._dark(self._frame, top, bottom)
            light, hidden = light - dark, dark
            usable &= ~broken
            clipped &= ~broken
        value, precision = state
        expected = np.where(precision > 0, value * np.float32(share), light) + hidden
        variance = shot * np.maximum(expected, 0) + read
        return Exposed(
            value=light / np.float32(share),
            precision=np.float32(share) ** 2 / np.maximum(variance, np.float32(_LEAST_VARIANCE)),
            usable=usable,
            clipped=clipped,
        )


def clipped_rows(capture: Capture, top: int, bottom: int) -> BoolArray:
    """Return which samples of rows are clipped; those of floats clip at 1, as exposures do."""
    if np.issubdtype(capture.samples.dtype, np.floating):
        limit = SATURATION_SHARE * capture.white_level
        return np.asarray(capture.samples[..., top:bottom, :] >= limit)
    return capture.saturated_rows(top, bottom)


def _read_variance(like: Capture, noise: NoiseModel) -> tuple[float, ...]:
    """Add the rounding of integer samples to the read noise."""
    step = 0.0
    if np.issubdtype(like.samples.dtype, np.integer):
        step = 1 / (like.white_level - float(like.black_level.max()))
    return tuple(read + _QUANTISATION * step**2 for read in noise.read_variance)


def _spread_over(like: Capture, per_channel: tuple[float, ...]) -> FloatArray:
    """Return numbers per colour as (1, 2, w) of a mosaic, or (channel, 1, 1)."""
    values = np.array(per_channel, dtype=np.float32)
    if like.cfa is None:
        return values[:, None, None]
    cell = values[np.array(cfa_channels(like.cfa))]
    return np.tile(cell, (1, (like.width + 1) // 2))[None, :, : like.width]


def _rows_of(pattern: NDArray[Any], rows: int) -> NDArray[Any]:
    """Repeat the rows of a cell; bands begin with an even row."""
    if pattern.shape[1] == 1:
        return pattern
    return np.tile(pattern, (1, (rows + 1) // 2, 1))[:, :rows]
