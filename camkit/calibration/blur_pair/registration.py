"""The shift and scale between two pictures of one plane, one of them blurred."""

from dataclasses import dataclass
from typing import Any, Final

import cv2
import numpy as np

from camkit.calibration.blur_pair.picture_pair import PicturePair
from camkit.errors import DecodeError

MOST_SHIFT_PX: Final = 1.0
LEAST_CORRELATION: Final = 0.7
_CRITERIA: Final = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 200, 1e-6)
_FILTER_PX: Final = 5
_GREEN: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class Registration:
    """Position of the sharp picture in the wide one.

    Attributes:
        shift_px: (x, y) of the sharp picture from the wide one, in the middle.
        scale: Of the sharp picture over the wide one.
        most_px: Largest shift, of the four corners.
        correlation: Of both.
    """

    shift_px: tuple[float, float]
    scale: float
    most_px: float
    correlation: float

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "shift_px": [round(value, 4) for value in self.shift_px],
            "scale": round(self.scale, 6),
            "most_px": round(self.most_px, 4),
            "correlation": round(self.correlation, 5),
        }


def register_pair(
    pair: PicturePair, blurred: np.ndarray[Any, Any], names: tuple[str, str]
) -> Registration:
    """Find the affine map between the wide picture and the sharp one, blurred about as much.

    Args:
        pair: The pictures.
        blurred: (3, h, w) light of the sharp picture, blurred.
        names: Of both, for people.

    Raises:
        DecodeError: If they are not of one scene, or more than a pixel apart.

    References: Evangelidis and Psarakis 2008 (ECC).
    """
    height, width = pair.size
    template = np.ascontiguousarray(pair.codes_of(pair.wide[_GREEN]))
    other = np.ascontiguousarray(pair.codes_of(np.maximum(blurred[_GREEN], 0)))
    mask = (~pair.clipped[_GREEN]).astype(np.uint8)
    warp = np.eye(2, 3, dtype=np.float32)
    plain = float(np.corrcoef(template.ravel(), other.ravel())[0, 1])
    try:
        correlation, warp = cv2.findTransformECC(
            template, other, warp, cv2.MOTION_AFFINE, _CRITERIA, mask, _FILTER_PX
        )
    except cv2.error:
        correlation = min(plain, 0.0)
    if not correlation >= LEAST_CORRELATION:
        raise DecodeError(
            f"{names[0]} and {names[1]} do not show one scene: their correlation is "
            f"{max(correlation, plain):.2f}, at least {LEAST_CORRELATION:g} is expected; give two "
            "pictures of one plane from one place"
        )
    middle = np.array([(width - 1) / 2, (height - 1) / 2])
    corners = np.array([[x, y] for x in (0, width - 1) for y in (0, height - 1)], dtype=np.float64)
    turn, shift = warp[:, :2].astype(np.float64), warp[:, 2].astype(np.float64)
    offsets_px = corners @ turn.T + shift - corners
    at_middle = turn @ middle + shift - middle
    most = float(np.hypot(*offsets_px.T).max())
    scale = float(np.sqrt(abs(np.linalg.det(turn))))
    if most > MOST_SHIFT_PX:
        raise DecodeError(
            f"{names[1]} lies up to {most:.2f} px off {names[0]} (scale {scale:.4f}); at most "
            f"{MOST_SHIFT_PX:g} px is read: leave the camera on a tripod, or register the pictures"
        )
    return Registration(
        shift_px=(float(at_middle[0]), float(at_middle[1])),
        scale=scale,
        most_px=most,
        correlation=float(correlation),
    )
