"""Choice of the camera model and of the views, by the error on pictures that a fit has not seen.

The error of a fit falls with every coefficient; the error on a picture that was left out does not.
So the simplest model is taken whose held-out error is not meaningfully above the least one.

A view that contradicts the others has a large error when it is left out, larger than the
uncertainty of the others explains, and it makes their errors larger too. The view is dropped
without which the others agree best, and so on. Dropped views that agree with the final fit are
taken back.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from camkit.calibration.geometry.adjustment import Fit, adjust, rms
from camkit.calibration.geometry.camera_model import POSE_NUMBERS, FloatGrid, project
from camkit.calibration.geometry.start import fit_models

MOST_WORSE: Final = 0.1
"""Of the least mean square, that a simpler model may be worse, however uncertain that is."""
NEGLIGIBLE: Final = 0.04
"""Likewise, however certain that is: 2 % of the error are worth no number."""
TYPICAL: Final = 1.05
"""Times the least median held-out error, up to which a simpler model is as good."""
OUTLIER: Final = 3.5
"""Times the held-out error that is expected."""
LEAST_OUTLIER_PX: Final = 0.4
LEAST_VIEWS: Final = 3
LEAST_SCATTER_PX: Final = 0.02
"""Of corners, however exactly they fit: about what detectors reach."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judged:
    """A fit, and the errors of pictures that were left out.

    Attributes:
        fit: To all views.
        held_out: (view, corner, 2) residuals of every view, its pose alone fitted, with the camera
            of the others.
        others_px: (view,) rms of the fit to the others.
        others: (view, intrinsics) of the fits to the others.
        leverage: (view,) >= 1: by how much the error there exceeds that of corners, since the
            others know the camera so well only.
    """

    fit: Fit
    held_out: FloatGrid
    others_px: FloatGrid
    others: FloatGrid
    leverage: FloatGrid

    @property
    def rms_px(self) -> float:
        """Return the held-out error of all corners."""
        return rms(self.held_out)

    @property
    def of_views_px(self) -> FloatGrid:
        """Return the held-out error (view,) of every view."""
        return np.array([rms(view) for view in self.held_out])

    @property
    def expected_px(self) -> FloatGrid:
        """Return the held-out error (view,) that most views, or the fit to the others, let expect.

        Of few views, a bad one spoils the held-out error of every other, but not the fit without
        it; of many, two bad ones spoil every fit, but not the median.
        """
        usual_px = np.median(self.of_views_px / self.leverage)
        return np.asarray(np.minimum(usual_px, self.others_px) * self.leverage)

    @property
    def formal(self) -> FloatGrid:
        """Return the standard errors (intrinsics,) by the covariance; inf where it is singular."""
        variances = np.diagonal(self.fit.spread) / 2
        finite = np.where(variances >= 0, variances, np.inf)
        return np.asarray(np.sqrt(finite) * max(self.fit.rms_px, LEAST_SCATTER_PX))

    @property
    def spread(self) -> FloatGrid:
        """Return the standard errors (intrinsics,) by the jackknife over views.

        Those of the covariance, which they are no less than, hold for corners that err by chance
        alone. What a board that is not flat, or light that is bent on its way, does to all corners
        of a view is seen by the jackknife only; that no view determines something, by neither of
        them where corners are exact: then a scatter of `LEAST_SCATTER_PX` is taken.

        References: Tukey 1958; Efron and Stein 1981, "The jackknife estimate of variance".
        """
        count = len(self.others)
        deviations = self.others - self.others.mean(axis=0)
        jackknife = np.sqrt((count - 1) / count * np.square(deviations).sum(axis=0))
        return np.asarray(np.maximum(jackknife, self.formal))

    @property
    def worst_px(self) -> float:
        """Return the held-out error of the worst view."""
        return float(self.of_views_px.max())

    @property
    def median_px(self) -> float:
        """Return the median held-out error of the views, to which one bad view means little."""
        return float(np.median(self.of_views_px))


def judge(fit: Fit, corners: FloatGrid, points: FloatGrid) -> Judged:
    """Fit again without each view in turn.

    Args:
        fit: Of all views.
        corners: (view, corner, 2) as seen, px.
        points: (corner, 3) on the board.
    """
    rests, others_px, cameras, leverage = [], [], [], []
    for view in range(len(corners)):
        is_other = np.arange(len(corners)) != view
        others = adjust(fit.camera, fit.poses[is_other], corners[is_other], points)
        alone = adjust(
            others.camera, fit.poses[view : view + 1], corners[~is_other], points, lens=False
        )
        rests.append(alone.residuals[0])
        others_px.append(others.rms_px)
        cameras.append(others.camera.intrinsics)
        leverage.append(_leverage(others, alone.poses[0], points))
    return Judged(
        fit=fit,
        held_out=np.stack(rests),
        others_px=np.array(others_px),
        others=np.stack(cameras),
        leverage=np.array(leverage),
    )


def _leverage(others: Fit, pose: FloatGrid, points: FloatGrid) -> float:
    """Return by how much a camera's uncertainty raises the error of a view whose pose is fitted."""
    _, slopes = project(others.camera, pose, points)
    flat = slopes.reshape(2 * len(points), -1)
    by_pose, by_lens = flat[:, :POSE_NUMBERS], flat[:, POSE_NUMBERS:]
    basis, _ = np.linalg.qr(by_pose)
    rest = by_lens - basis @ (basis.T @ by_lens)
    added = float(np.einsum("ni,ij,nj->", rest, others.spread, rest)) / len(flat)
    return float(np.sqrt(1 + max(0.0, added)))


def simplest(judged: Sequence[Judged]) -> Judged:
    """Return the first that is not meaningfully worse than the best.

    The same pictures judge all models, so what counts is by how much more one misses each: the mean
    over the pictures must exceed its own standard error, and be worth a number.
    """
    best = min(judged, key=lambda one: one.rms_px)
    least = np.square(best.of_views_px)
    for one in judged:
        more = np.square(one.of_views_px) - least
        error = float(more.std(ddof=1)) / np.sqrt(len(more))
        usual = float(least.mean())
        allowed = max(min(error, MOST_WORSE * usual), NEGLIGIBLE * usual)
        if one is best or float(more.mean()) <= allowed:
            return one
    return best


def _typical(judged: Sequence[Judged]) -> Judged:
    """Return the simplest model that fits most pictures, whatever one bad picture shows."""
    limit = TYPICAL * min(one.median_px for one in judged)
    return next(one for one in judged if one.median_px <= limit)


def judge_all(
    corners: FloatGrid, points: FloatGrid, size: tuple[int, int]
) -> tuple[list[Judged], dict[int, float]]:
    """Fit and judge every model, and find the views that contradict the others.

    Args:
        corners: (view, corner, 2) as seen, px.
        points: (corner, 3) on the board.
        size: Width and height of the pictures.

    Returns:
        The models from simple to rich, of all views; and the numbers of views that contradict the
        others with the errors of their corners, worst first.
    """
    views, dropped = list(range(len(corners))), list[int]()
    first: list[Judged] | None = None
    while True:
        judged = [
            judge(fit, corners[views], points) for fit in fit_models(corners[views], points, size)
        ]
        first = judged if first is None else first
        if not judged:
            return first, {}
        typical = _typical(judged)
        worst = _outlier(typical)
        if worst is not None and len(views) > LEAST_VIEWS:
            dropped.append(views.pop(worst))
            continue
        model = typical.fit.camera.model
        poses = next(one.fit.poses for one in first if one.fit.camera.model is model)
        disagreeing = _disagreeing(dropped, typical, poses, corners, points)
        if worst is not None:
            disagreeing[views[worst]] = float(typical.of_views_px[worst])
        return first, disagreeing


def _outlier(judged: Judged) -> int | None:
    """Return the number of the view to drop first; None if all agree."""
    views = judged.of_views_px
    bad = (views > LEAST_OUTLIER_PX) & (views > OUTLIER * judged.expected_px)
    return int(judged.others_px.argmin()) if bad.any() else None


def _disagreeing(
    dropped: Sequence[int], rest: Judged, poses: FloatGrid, corners: FloatGrid, points: FloatGrid
) -> dict[int, float]:
    """Return the error of each dropped view that the rest does not explain; poses to start from."""
    usual_px = float(np.median(rest.of_views_px / rest.leverage))
    errors = {}
    for view in dropped:
        one = slice(view, view + 1)
        alone = adjust(rest.fit.camera, poses[one], corners[one], points, lens=False)
        expected_px = usual_px * _leverage(rest.fit, alone.poses[0], points)
        if not alone.rms_px <= max(LEAST_OUTLIER_PX, OUTLIER * expected_px):
            errors[view] = alone.rms_px
    return errors
