"""Pictures to look at: depth in colours, photons in grey, small arrays enlarged."""

from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError

Codes = NDArray[np.uint8]
UNKNOWN: Final = 48
"""Grey of a pixel that is not valid."""
LEAST_SIDE_PX: Final = 256
PERCENTILES: Final = (2.0, 98.0)
"""Percentiles of depth between which colours run."""
BRIGHTEST: Final = 99.5
"""Percentile of photons that is white."""
GAMMA: Final = 2.2
USUAL: Final = 95.0
"""Percentile of frames whose white is that of a film of light in flight."""
MOST_CLIPPED: Final = 30.0
"""Of the brightest frame: so many times brighter than white it may be."""


def depth_picture(depth_m: NDArray[np.float64]) -> Codes:
    """Return depth (h, w) as colours (h, w, 3) BGR: near is red, far blue, not known grey."""
    valid = np.isfinite(depth_m)
    if not valid.any():
        return np.full((*depth_m.shape, 3), UNKNOWN, np.uint8)
    near, far = np.percentile(depth_m[valid], PERCENTILES)
    place = (far - np.where(valid, depth_m, far)) / max(far - near, 1e-9)
    codes = np.round(np.clip(place, 0, 1) * 255).astype(np.uint8)
    colours = cv2.applyColorMap(codes, cv2.COLORMAP_TURBO)
    colours[~valid] = UNKNOWN
    return np.asarray(colours, dtype=np.uint8)


def grey_picture(photons: NDArray[np.floating], white: float) -> Codes:
    """Return photons (h, w) as grey (h, w, 3), `white` photons as white."""
    share = np.clip(photons / max(white, 1e-9), 0, 1)
    codes = np.round(share ** (1 / GAMMA) * 255).astype(np.uint8)
    return np.repeat(codes[..., None], 3, axis=2)


def white_of(photons: NDArray[np.floating]) -> float:
    """Return how many photons are shown white in a picture (h, w).

    Where so few pixels have any that the percentile is 0, it is the brightest pixel.
    """
    if not photons.size:
        return 1.0
    return float(np.percentile(photons, BRIGHTEST)) or float(photons.max())


def white_of_flight(frames: NDArray[np.floating]) -> float:
    """Return how many photons are shown white in a film of light in flight (t, h, w).

    The first surface may be hundreds of times brighter than what comes after it, in few frames:
    these may clip, or nothing else would be seen.
    """
    whites = [white_of(frame) for frame in frames]
    return max(float(np.percentile(whites, USUAL)), max(whites) / MOST_CLIPPED)


def enlarged(codes: Codes, *, even: bool = False) -> Codes:
    """Return a picture with every pixel as a square where it would be too small to look at.

    Args:
        codes: (h, w, 3).
        even: Whether sides must be even numbers, as films want them.
    """
    times = max(1, -(-LEAST_SIDE_PX // max(codes.shape[:2])))
    times += times % 2 if even and times > 1 else 0
    picture = codes.repeat(times, axis=0).repeat(times, axis=1)
    if even:
        picture = np.pad(
            picture, ((0, picture.shape[0] % 2), (0, picture.shape[1] % 2), (0, 0)), "edge"
        )
    return np.asarray(picture, dtype=np.uint8)


def write_preview(path: Path, codes: Codes) -> None:
    """Write a PNG.

    Raises:
        ContractError: If it cannot be encoded.
    """
    is_encoded, data = cv2.imencode(".png", enlarged(codes))
    if not is_encoded:
        raise ContractError(f"cannot write a PNG of {codes.shape[1]}x{codes.shape[0]}")
    path.write_bytes(data.tobytes())
