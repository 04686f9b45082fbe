"""Starting values for the fit of a camera: many focal lengths, for straight and fisheye lenses.

    a focal length and the middle of the picture -> directions of the corners
      -> the pose of every board by its homography -> distances of the corners from the predicted

The best few of each kind are adjusted, and the richer models start from the simpler ones.

References: Zhang 2000, "A flexible new technique for camera calibration" (pose from homography).
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from camkit.calibration.geometry.adjustment import Fit, adjust, rms
from camkit.calibration.geometry.camera_model import (
    CENTRE,
    FOCAL,
    MODELS,
    POSE_NUMBERS,
    Camera,
    FloatGrid,
    Model,
    depths,
    project,
    with_model,
)

FOCALS: Final = (0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.2, 3.3, 5.0, 8.0)
"""Tried, of the longer side."""
POSSIBLE_FOCALS: Final = (0.1, 20.0)
"""Least and most that a lens has, likewise."""
BEST_STARTS: Final = 3
WIDEST_RAD: Final = 1.45
"""Half angle beyond which a direction is no place on a plane."""
_MIDDLE: Final = Model(name="middle", free=())
_FISHEYE_MIDDLE: Final = Model(name="fisheye_middle", free=(), fisheye=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Nominal:
    """The numbers that are not fitted, and the reasons.

    Attributes:
        centre: Whether the optical centre is fixed at the middle of the picture; then nothing is
            fitted that moves it, tangential terms among them.
        focal_px: Focal length that is fixed; None to fit it.
    """

    centre: bool = False
    focal_px: float | None = None

    @property
    def fixed(self) -> tuple[int, ...]:
        """Return the indices of the fixed numbers in a vector of intrinsics."""
        return (() if self.focal_px is None else (FOCAL,)) + (CENTRE if self.centre else ())

    @property
    def models(self) -> tuple[Model, ...]:
        """Return the models that can be fitted."""
        return tuple(m for m in MODELS if not (self.centre and m.is_tangential))


FREE: Final = Nominal()


def fit_models(
    corners: FloatGrid, points: FloatGrid, size: tuple[int, int], nominal: Nominal = FREE
) -> list[Fit]:
    """Fit every model to all views.

    Args:
        corners: (view, corner, 2) x, y as seen, px.
        points: (corner, 3) on the board.
        size: Width and height of the pictures.
        nominal: What is not fitted.

    Returns:
        A fit for each of the models, in their order; without those that fit nowhere.
    """
    straight = _started(corners, points, size, (_MIDDLE, nominal))
    bent = _started(corners, points, size, (_FISHEYE_MIDDLE, nominal))
    fits: list[Fit] = []
    for model in nominal.models:
        kin = [fit for fit in fits if fit.camera.model.fisheye == model.fisheye]
        first = bent if model.fisheye else straight
        starts = [fit for fit in kin[-1:] if is_lens(fit.camera, size)] or first
        adjusted = [
            adjust(with_model(start.camera, model), start.poses, corners, points)
            for start in starts
        ]
        adjusted = [fit for fit in adjusted if np.isfinite(fit.residuals).all()]
        adjusted = [fit for fit in adjusted if is_lens(fit.camera, size)] or adjusted
        fits += [min(adjusted, key=lambda fit: fit.rms_px)] if adjusted else []
    return fits


def is_lens(camera: Camera, size: tuple[int, int]) -> bool:
    """Return whether a lens may have the focal length of a camera with pictures of a size."""
    least, most = (share * max(size) for share in POSSIBLE_FOCALS)
    return least <= camera.focal_px <= most


def _started(
    corners: FloatGrid, points: FloatGrid, size: tuple[int, int], kind: tuple[Model, Nominal]
) -> list[Fit]:
    """Return the few best starts of one kind, poses adjusted."""
    (width, height), (model, nominal) = size, kind
    starts: list[tuple[float, Fit]] = []
    focals = [share * max(size) for share in FOCALS]
    for focal in focals if nominal.focal_px is None else [nominal.focal_px]:
        camera = Camera(
            model=model,
            intrinsics=np.array([focal, (width - 1) / 2, (height - 1) / 2]),
            fixed=nominal.fixed,
        )
        poses = [_pose(camera, corners_px, points) for corners_px in corners]
        valid = [pose for pose in poses if pose is not None]
        if len(valid) < len(corners):
            continue
        fit = adjust(camera, np.stack(valid), corners, points, lens=False)
        if np.isfinite(fit.residuals).all():
            starts.append((fit.rms_px, fit))
    starts.sort(key=lambda one: one[0])
    return [fit for _, fit in starts[:BEST_STARTS]]


def _pose(camera: Camera, corners_px: FloatGrid, points: FloatGrid) -> FloatGrid | None:
    """Return the pose (6,) of a board from the directions of its corners; None if it has none."""
    flat = (corners_px - camera.centre_px) / camera.focal_px
    if camera.model.fisheye:
        angle = np.linalg.norm(flat, axis=1, keepdims=True)
        if angle.max() > WIDEST_RAD:
            return None
        flat = flat * np.divide(np.tan(angle), angle, out=np.ones_like(angle), where=angle > 0)
    try:
        _, turns, shifts, _ = cv2.solvePnPGeneric(
            points, flat, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE
        )
    except cv2.error:
        return None
    poses = [np.concatenate([t.ravel(), s.ravel()]) for t, s in zip(turns, shifts, strict=True)]
    poses = [pose for pose in poses if pose.shape == (POSE_NUMBERS,) and np.isfinite(pose).all()]
    poses = [pose for pose in poses if (depths(pose, points) > 0).all()]
    if not poses:
        return None
    return min(poses, key=lambda pose: rms(corners_px - project(camera, pose, points)[0]))
