"""Parts of a camera that views determine; the rest is held at its nominal value.

    all free -> is the optical centre determined? the focal length? -> held where not -> again

By the jackknife over views: the numbers that a camera has when each view is left out once. Views
that are nearly parallel to the sensor, few, or all of one corner tell the shape of the distortion,
but shift and scale of the picture go with the poses of the boards.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from camkit.calibration.geometry.camera_model import CENTRE, FOCAL, FloatGrid
from camkit.calibration.geometry.choice import Judged, judge, simplest
from camkit.calibration.geometry.coverage import Coverage
from camkit.calibration.geometry.distortion_profile import Profile
from camkit.calibration.geometry.start import (
    FREE,
    Nominal,
    fit_models,
    is_lens,
)
from camkit.calibration.geometry.unfolded import unfolded
from camkit.caller import option_text
from camkit.errors import DecodeError

WORST_CENTRE: Final = 0.01
"""Standard error of the optical centre, of the diagonal, from which on it is not determined; two
public sets of photographs have 0.001 and 0.002."""
WORST_FOCAL: Final = 0.03
"""Likewise of the focal length, of itself; they have 0.001 and 0.005."""
WORST_GUESS: Final = 0.1
"""Likewise by the covariance, beyond which what explains the corners best is no guess either."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Determined:
    """The camera that the views determine.

    Attributes:
        judged: All models with what is held.
        best: The one taken.
        coverage: Where the board was seen.
        profile: Its distortion along a radius.
        undetermined: "centre_px" and "focal_px" where the views do not tell them.
        nominal: What was held.
    """

    judged: Sequence[Judged]
    best: Judged
    coverage: Coverage
    profile: Profile
    undetermined: tuple[str, ...] = ()
    nominal: Nominal = FREE

    @property
    def focal_error(self) -> float:
        """Return the standard error of the focal length by views left out, of itself."""
        return float(self.best.spread[FOCAL]) / self.best.fit.camera.focal_px


def determine(
    judged: Sequence[Judged],
    corners: FloatGrid,
    points: FloatGrid,
    size: tuple[int, int],
    focal_px: float | None = None,
) -> Determined:
    """Choose a model, and keep the numbers fixed that the views do not determine.

    Args:
        judged: All models with nothing held, from simple to rich.
        corners: (view, corner, 2) as seen, px.
        points: (corner, 3) on the board.
        size: Width and height, px.
        focal_px: Nominal focal length, taken where the views do not determine it.

    Raises:
        DecodeError: If no model that a lens may have explains the corners, or the focal length is
            as good as unknown and no nominal one is given.
    """
    best, nominal = simplest(judged), Nominal(centre=True)
    try:
        result = _best(judged, corners, size)
    except DecodeError:
        # What folds or cancels itself may do so because nothing ties it down.
        if _is_loose(best, size):
            _check_nominal(best, size, focal_px)
            nominal = replace(nominal, focal_px=focal_px)
        elif not _is_open(best, size):
            raise
        result = None
    if result is None or _is_open(result.best, size):
        result = _with_nominal(nominal, corners, points, size)
    if not _is_loose(result.best, size):
        return result
    if focal_px is not None:
        return _with_nominal(replace(result.nominal, focal_px=focal_px), corners, points, size)
    _check_nominal(result.best, size, focal_px)
    return replace(result, undetermined=(*result.undetermined, "focal_px"))


def _best(judged: Sequence[Judged], corners: FloatGrid, size: tuple[int, int]) -> Determined:
    best, coverage, profile = unfolded(judged, corners, size)
    return Determined(judged=judged, best=best, coverage=coverage, profile=profile)


def _with_nominal(
    nominal: Nominal, corners: FloatGrid, points: FloatGrid, size: tuple[int, int]
) -> Determined:
    """Fit and judge again with fixed numbers."""
    fits = fit_models(corners, points, size, nominal)
    if not fits:
        raise DecodeError("no camera explains the corners: the pictures are not of one flat board")
    result = _best([judge(fit, corners, points) for fit in fits], corners, size)
    centre = ("centre_px",) if nominal.centre else ()
    focal = ("focal_px",) if nominal.focal_px is not None else ()
    return replace(result, undetermined=(*centre, *focal), nominal=nominal)


def _is_open(judged: Judged, size: tuple[int, int]) -> bool:
    """Return whether the optical centre is not determined."""
    error = float(np.hypot(*judged.spread[list(CENTRE)]))
    return not error <= WORST_CENTRE * float(np.hypot(*size))


def _is_loose(judged: Judged, size: tuple[int, int]) -> bool:
    """Return whether the focal length is not determined."""
    camera = judged.fit.camera
    error = float(judged.spread[FOCAL]) / camera.focal_px
    return not (is_lens(camera, size) and error <= WORST_FOCAL)


def _check_nominal(judged: Judged, size: tuple[int, int], focal_px: float | None) -> None:
    """Refuse a focal length that no view determines and nobody states."""
    camera = judged.fit.camera
    error = float(judged.formal[FOCAL]) / camera.focal_px
    if focal_px is not None or (is_lens(camera, size) and error <= WORST_GUESS):
        return
    doubt = f" ({error:.0%} uncertain)" if is_lens(camera, size) and error < 1 else ""
    raise DecodeError(
        f"the pictures do not tell the focal length{doubt}: "
        f"tilt the board by 20 degrees or more, to every side, or give {option_text('focal_px')}"
    )
