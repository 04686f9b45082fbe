"""Small pictures as the bytes of a file, made in memory; large ones go through the writers."""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError


def png_bytes(codes: NDArray[np.uint8]) -> bytes:
    """Return the PNG of (h, w, 3) R, G, B of 8 bits."""
    return _encoded(".png", codes, np.uint8)


def tiff_bytes(codes: NDArray[np.uint16]) -> bytes:
    """Return the TIFF of (h, w, 3) R, G, B of 16 bits."""
    return _encoded(".tiff", codes, np.uint16)


def _encoded(suffix: str, codes: NDArray[Any], dtype: Any) -> bytes:
    if codes.dtype != dtype or codes.ndim != 3 or codes.shape[2] != 3:
        raise ContractError(
            f"expected (h, w, 3) of {np.dtype(dtype)}; got {codes.dtype} {codes.shape}"
        )
    is_coded, data = cv2.imencode(suffix, np.ascontiguousarray(codes[..., ::-1]))
    if not is_coded:
        raise ContractError(f"a picture of {codes.shape} cannot be coded as {suffix}")
    return data.tobytes()
