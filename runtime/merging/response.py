"""The light of a code, and its standard error.

Codes of pictures are averaged as logarithms of light: what is wrong with a response, a shutter or
a veil is a share of the light and not an amount. The spread of such a logarithm is that of the
code, propagated through the slope of the response, and a share that no weighting may undercut.

References: Debevec, Malik 1997, eq. (2) to (4) (the logarithm of a response); Robertson et al.
2003 (weights by the certainty of each exposure).
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import decode_srgb
from camkit.runtime.capture import SATURATION_SHARE

ResponseName = Literal["linear", "srgb", "estimate"]
FloatTable = NDArray[np.float64]

CODE_SPREAD: Final = 0.5 / 255
"""Standard deviation of a code, as a share of the top one: that of 8 bits (0.29 codes) with some
noise."""
LIGHT_SPREAD: Final = 0.01
"""Share of the light by which frames differ however exact their codes are; of 0, 1 and 3 % the one
that predicts left-out frames of two brackets best."""
_LEAST_SLOPE: Final = 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class Response:
    """The light of every code.

    Attributes:
        name: How it was come by.
        log_light: (channel, code) natural logarithm of the light, 1.0 = white; -inf is no light.
        precision: (channel, code) one over the variance of that logarithm.
        clipped_from: The first code that is taken as clipped; code 0 is taken as black.
        factors: By what the stated times of the frames are to be multiplied; empty for nothing.
    """

    name: ResponseName
    log_light: FloatArray
    precision: FloatArray
    clipped_from: int
    factors: tuple[float, ...] = ()


def response_of(name: ResponseName, log_light: FloatTable) -> Response:
    """Return a response with the precision of its codes.

    Args:
        name: How it was come by.
        log_light: (channel, code), not decreasing.
    """
    codes = log_light.shape[1]
    finite = np.where(np.isfinite(log_light), log_light, log_light[:, 1:2])
    slope = np.maximum(np.gradient(finite, axis=1), _LEAST_SLOPE * 255 / (codes - 1))
    variance = (CODE_SPREAD * (codes - 1) * slope) ** 2 + LIGHT_SPREAD**2
    return Response(
        name=name,
        log_light=log_light.astype(np.float32),
        precision=(1 / variance).astype(np.float32),
        clipped_from=int(np.ceil(SATURATION_SHARE * (codes - 1))),
    )


def srgb_response(codes: int) -> Response:
    """Return the response of pictures in sRGB, 256 or 65536 codes."""
    light = decode_srgb(np.linspace(0, 1, codes, dtype=np.float32)).astype(np.float64)
    with np.errstate(divide="ignore"):
        table = np.log(light)
    return response_of("srgb", np.tile(table, (3, 1)))
