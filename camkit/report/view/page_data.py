"""Light, maps and films as data that a page holds: text of base64, decoded by its script.

coded_light   12 bits of the logarithm, which the exposure slider takes
coded_picture 8 bits of sRGB, a picture that any browser shows
coded_floats  float32 of a map
coded_bytes   grey codes of a film
"""

import base64
import zlib
from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import encode_uint8

TOP_CODE: Final = 4095
DARKEST: Final = 2.0**-12
"""Light of code 1, white = 1; what is darker is 0."""
JPEG_QUALITY: Final = 92
COLOURS: Final = {"turbo": cv2.COLORMAP_TURBO, "viridis": cv2.COLORMAP_VIRIDIS}


@dataclass(frozen=True, slots=True, kw_only=True)
class LightScale:
    """Light between its codes.

    Attributes:
        stops: Factors of two between codes 1 and `TOP_CODE`.
    """

    stops: float

    @property
    def step(self) -> float:
        """Return the share by which neighbours of codes differ."""
        return float(2 ** (self.stops / (TOP_CODE - 1)) - 1)


def light_scale(peak: float) -> LightScale:
    """Return the scale that reaches from `DARKEST` to the peak of a picture, at least to white."""
    return LightScale(stops=float(np.log2(max(peak, 1.0) / DARKEST)))


def coded_light(light: FloatArray, scale: LightScale) -> str:
    """Return light (3, h, w) as codes of its logarithm; differences along rows, then packed."""
    stops = np.log2(np.maximum(light, DARKEST / 2)) - np.log2(DARKEST)
    place = stops * (TOP_CODE - 1) / scale.stops
    codes = np.clip(np.rint(place) + 1, 0, TOP_CODE).astype(np.uint16)
    steps = np.diff(codes, axis=2, prepend=np.uint16(0))
    halves = (steps & 0xFF).astype(np.uint8).tobytes() + (steps >> 8).astype(np.uint8).tobytes()
    return _packed(halves)


def coded_picture(light: FloatArray, *, is_exact: bool) -> str:
    """Return light (3, h, w) as the address of a PNG, or of a JPEG where it need not be exact.

    Raises:
        ContractError: If it cannot be encoded.
    """
    codes = np.ascontiguousarray(encode_uint8(light, tone="srgb").transpose(1, 2, 0)[..., ::-1])
    kind = "png" if is_exact else "jpeg"
    settings = [] if is_exact else [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY]
    is_encoded, data = cv2.imencode(f".{kind}", codes, settings)
    if not is_encoded:
        raise ContractError(f"cannot write a picture of {codes.shape[1]} x {codes.shape[0]} px")
    return f"data:image/{kind};base64,{base64.b64encode(data.tobytes()).decode()}"


def coded_floats(values: NDArray[Any]) -> str:
    """Return a map (h, w) as float32; NaN stays."""
    return _packed(np.ascontiguousarray(values, dtype="<f4").tobytes())


def coded_bytes(codes: NDArray[np.uint8]) -> str:
    """Return grey codes as they are."""
    return _packed(np.ascontiguousarray(codes).tobytes())


def coded_colours(name: str) -> str:
    """Return a colour map as 256 x 3 bytes, red first; grey where it has no other name."""
    grey = np.arange(256, dtype=np.uint8)
    if name not in COLOURS:
        return base64.b64encode(grey.repeat(3).tobytes()).decode()
    table = cv2.applyColorMap(grey[:, None], COLOURS[name])[:, 0, ::-1]
    return base64.b64encode(np.ascontiguousarray(table).tobytes()).decode()


def _packed(data: bytes) -> str:
    return base64.b64encode(zlib.compress(data, 6)).decode()
