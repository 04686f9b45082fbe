"""A pair of photographs aligned: one camera, one place, the reference sharper than the capture.

    both as they are -> least squares on the pixels -> homography close to none
                     -> gain of each colour, and its fall towards the corners -> light as captured

Lens and place are the same, so distortion is in both and stays. What the two stops differ by in
vignetting and exposure is fitted; a reference that is itself a little blurred stays so.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.alignment import (
    COLOUR_STEP_PX,
    LEAST_COLOUR_POINTS,
    AlignedPair,
    Points,
    display_coded,
)
from camkit.models_def.kinds.bayer.fine_tuning.homography import (
    Homography,
    map_points,
    refine_homography,
    warp_to,
)
from camkit.models_def.kinds.bayer.fine_tuning.pair_photographs import Photograph

CLIPPED_REACH_PX: Final = 8
"""How far from clipped light blur is taken to carry it."""
MOST_SHIFT: Final = 0.02
"""Of the diagonal: two photographs that lie further apart are not of one place."""
_SAME: Final = Homography(matrix=np.eye(3), matches=0, inliers=0, residual_px=0.0, correlation=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Falloff:
    """The gain between two photographs of one scene: for each colour a + b (r / corner)^2.

    Attributes:
        middle: (3,) gain in the middle.
        corner: (3,) what is added to it in the corner.
    """

    middle: NDArray[np.float64]
    corner: NDArray[np.float64]

    def at(self, points_px: Points, size_px: tuple[int, int]) -> NDArray[np.float64]:
        """Return the (3, n) gains at (n, 2) positions of a picture of (width, height)."""
        centre = (np.array(size_px) - 1) / 2
        square = ((points_px - centre) ** 2).sum(1) / (centre**2).sum()
        return np.asarray(self.middle[:, None] + self.corner[:, None] * square)

    def shade(self, picture: FloatArray) -> FloatArray:
        """Return a (3, h, w) picture multiplied by the gains at its pixels."""
        height, width = picture.shape[1:]
        rows, columns = np.mgrid[0:height, 0:width]
        points = np.stack([columns, rows], -1).reshape(-1, 2).astype(np.float64)
        gains = self.at(points, (width, height)).reshape(3, height, width)
        return np.asarray(picture * gains, dtype=np.float32)


def align_photographs(capture: Photograph, reference: Photograph) -> AlignedPair:
    """Align the reference of a pair that one camera took from one place.

    Raises:
        ContractError: If they have not one size, do not correlate, or are of two places.
    """
    sizes = [one.light.shape[:0:-1] for one in (reference, capture)]
    if sizes[0] != sizes[1]:
        raise ContractError(
            "a reference photographed by the same camera has the size of the capture, "
            f"{sizes[1][0]}x{sizes[1][1]} px; got {sizes[0][0]}x{sizes[0][1]}"
        )
    clipped = widened(capture.clipped | reference.clipped)
    sharp, blurred = (display_coded(one.light.mean(0)) for one in (reference, capture))
    homography = refine_homography(_SAME, sharp, blurred, clipped)
    _check_place(homography, sizes[0])
    # In one exposure and in linear light, blur and noise are all that differs.
    light = _fit_falloff(capture, reference, homography).shade(reference.light)
    homography = refine_homography(homography, light.mean(0), capture.light.mean(0), clipped)
    falloff = _fit_falloff(capture, reference, homography)
    back = np.asarray(np.linalg.inv(homography.matrix), dtype=np.float64)
    return AlignedPair(
        capture=capture.light,
        clipped=capture.clipped,
        reference=falloff.shade(reference.light),
        unknown=reference.clipped,
        to_reference=lambda points_px: map_points(back, points_px),
        illumination=lambda points_px: np.ones(len(points_px)),
        homography=homography,
    )


def widened(clipped: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (h, w) clipped pixels with those that blur carries their light to."""
    side = 2 * CLIPPED_REACH_PX + 1
    return np.asarray(cv2.dilate(clipped.astype(np.uint8), np.ones((side, side))) > 0)


def _check_place(homography: Homography, size_px: tuple[int, ...]) -> None:
    width, height = size_px
    corners = np.array([[x, y] for x in (0, width - 1) for y in (0, height - 1)], dtype=np.float64)
    shift_px = np.linalg.norm(map_points(homography.matrix, corners) - corners, axis=1).max()
    if shift_px > MOST_SHIFT * np.hypot(width, height):
        raise ContractError(
            f"reference and capture are shifted by {shift_px:.0f} px; photograph both from one "
            'place, or state reference = "shown" for a plane'
        )


def _fit_falloff(capture: Photograph, reference: Photograph, homography: Homography) -> Falloff:
    """Fit the gains on means over squares in which nothing clipped."""
    step = COLOUR_STEP_PX
    height, width = (side // step * step for side in capture.clipped.shape)
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float64)
    back = np.asarray(np.linalg.inv(homography.matrix), dtype=np.float64)
    at = map_points(back, np.stack([columns, rows], -1).reshape(-1, 2)).reshape(height, width, 2)
    light, inside = warp_to(reference.light, at[..., 0], at[..., 1])

    def squares(picture: FloatArray) -> NDArray[np.float64]:
        parts = picture.reshape(*picture.shape[:-2], height // step, step, width // step, step)
        return np.asarray(parts.mean((-3, -1), dtype=np.float64))

    bad = capture.clipped[:height, :width] | reference.clipped[:height, :width] | ~inside
    good = squares(widened(bad).astype(np.float32)) == 0
    if good.sum() < LEAST_COLOUR_POINTS:
        raise ContractError("nearly all of the capture or of its reference is clipped")
    middle, corner = np.empty(3), np.empty(3)
    places = (np.argwhere(good)[:, ::-1] * step + (step - 1) / 2).astype(np.float64)
    unit = Falloff(middle=np.zeros(1), corner=np.ones(1))
    square = unit.at(places, capture.clipped.shape[::-1])[0]
    for colour in range(3):
        source = squares(light[colour])[good]
        target = squares(capture.light[colour, :height, :width])[good]
        # Sums, which blur keeps: least squares on the squares would take blur for less light.
        moments = np.stack([np.ones_like(square), square])
        system = (moments * source) @ moments.T
        middle[colour], corner[colour] = np.linalg.solve(system, moments @ target)
    return Falloff(middle=middle, corner=corner)
