"""The model among those that a lens may have, whose distortion does not fold inside the picture.

A profile that turns back has no inverse there: two directions fall on one place. Often it does so
where nothing was seen, and another model, as good where corners were, does not.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from camkit.calibration.geometry.camera_model import Camera, FloatGrid
from camkit.calibration.geometry.choice import Judged, simplest
from camkit.calibration.geometry.coverage import Coverage, coverage_of
from camkit.calibration.geometry.distortion_profile import Profile, profile_of
from camkit.calibration.geometry.start import is_lens
from camkit.errors import DecodeError

MOST_FACTOR: Final = 1e6
"""A coefficient beyond it is none of a lens: its terms cancel where corners are, nowhere else."""
MOST_TERM: Final = 2.0
"""Of a coefficient at the covered radius, against the radius: likewise."""
MIDDLE: Final = 0.5
"""Of either side of the picture: the middle part, in which the optical centre lies."""
FOLDED: Final = 1.25
"""Times the held-out error that a model may have to take the place of one that folds."""


def unfolded(
    judged: Sequence[Judged], corners: FloatGrid, size: tuple[int, int]
) -> tuple[Judged, Coverage, Profile]:
    """Choose among the models whose profile grows to the corners of the picture.

    Args:
        judged: All models, from simple to rich.
        corners: (view, corner, 2) as seen, px.
        size: Width and height.

    Raises:
        DecodeError: If none of them is about as good as the best that folds.
    """
    every = [(one, *_coverage_and_profile(one, corners, size)) for one in judged]
    usable = [
        candidate
        for candidate in every
        if candidate[2].fold_px >= candidate[1].corner_px
        and not _doubt(candidate[0].fit.camera, candidate[2], size)
    ]
    best = simplest(judged)
    if usable:
        best_usable = simplest([one for one, _, _ in usable])
        if best_usable.rms_px <= FOLDED * best.rms_px:
            return next(candidate for candidate in usable if candidate[0] is best_usable)
    _, coverage, profile = next(candidate for candidate in every if candidate[0] is best)
    if profile.fold_px >= coverage.corner_px:
        raise DecodeError(
            f"the distortion that explains the corners ({best.fit.camera.model.name}) has "
            f"{_doubt(best.fit.camera, profile, size)}: photograph the board at more places and "
            "tilts"
        )
    raise DecodeError(
        f"the distortion that explains the corners ({best.fit.camera.model.name}) folds back at "
        f"{profile.fold_px:.0f} px from the optical centre, inside the picture, whose corner lies "
        f"at {coverage.corner_px:.0f} px; corners were seen to {coverage.radius_px:.0f} px: "
        "photograph the board farther out"
    )


def _doubt(camera: Camera, profile: Profile, size: tuple[int, int]) -> str:
    """Return the property of a camera that no lens has; "" for none."""
    if not is_lens(camera, size):
        return f"a focal length of {camera.focal_px:.0f} px, which is none of a lens"
    for at, side in zip(camera.centre_px, size, strict=True):
        if abs(at - (side - 1) / 2) > MIDDLE * side / 2:
            x, y = camera.centre_px
            return (
                f"its centre at ({x:.0f}, {y:.0f}) px, outside the middle part of the picture of "
                f"{size[0]}x{size[1]} px"
            )
    if (
        np.abs(camera.coefficients).max(initial=0.0) > MOST_FACTOR
        or _largest_term(camera, profile) > MOST_TERM
    ):
        return "coefficients that are none of a lens and cancel each other"
    return ""


def _largest_term(camera: Camera, profile: Profile) -> float:
    """Return the most that a coefficient adds at the covered radius, against the radius."""
    angle = float(np.interp(profile.covered_px, profile.radii_px, profile.angles_rad))
    u = (angle if camera.model.fisheye else np.tan(angle)) ** 2
    powers = u ** np.array([1, 2, 3, 4] if camera.model.fisheye else [1, 2, 0.5, 0.5, 3, 1, 2, 3])
    return float(np.abs(camera.coefficients * powers).max(initial=0.0))


def _coverage_and_profile(
    one: Judged, corners: FloatGrid, size: tuple[int, int]
) -> tuple[Coverage, Profile]:
    coverage = coverage_of(corners, one.fit.camera.centre_px, size)
    return coverage, profile_of(one.fit.camera, coverage.radius_px)
