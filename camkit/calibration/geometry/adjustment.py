"""Camera and poses that explain corners best: least squares by Levenberg and Marquardt.

Every view has a pose of its own and all share the camera. The numbers of poses are eliminated first
(Schur's complement), so that a step costs little however many views there are.

References: Marquardt 1963; Triggs 2000, "Bundle adjustment: a modern synthesis", section 6.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from camkit.calibration.geometry.camera_model import (
    POSE_NUMBERS,
    Camera,
    FloatGrid,
    project_views,
)

MOST_STEPS: Final = 200
LEAST_GAIN: Final = 1e-9
"""Of the squares, below which a step ends the search."""
_FIRST_DAMPING: Final = 1e-3
_MOST_DAMPING: Final = 1e12
_TINY: Final = 1e-12
_SINGULAR: Final = 1e-15
"""Of the largest eigenvalue, up to which one counts as none."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """A camera and what it saw.

    Attributes:
        camera: The camera.
        poses: (view, 6) rotation vector and translation, in squares.
        residuals: (view, corner, 2) seen less computed, px.
        spread: (intrinsics, intrinsics) covariance of the intrinsics for corners of 1 px error.
    """

    camera: Camera
    poses: FloatGrid
    residuals: FloatGrid
    spread: FloatGrid

    @property
    def rms_px(self) -> float:
        """Return the root of the mean square distance of corners from where they were computed."""
        return rms(self.residuals)


def rms(residuals: FloatGrid) -> float:
    """Return the root of the mean square distance of (..., 2) residuals."""
    return float(np.sqrt(np.square(residuals).sum(axis=-1).mean()))


def adjust(
    camera: Camera, poses: FloatGrid, corners: FloatGrid, points: FloatGrid, *, lens: bool = True
) -> Fit:
    """Fit camera and poses.

    Args:
        camera: To start from.
        poses: (view, 6) to start from.
        corners: (view, corner, 2) as seen, px.
        points: (corner, 3) on the board.
        lens: Fit the camera too, not the poses alone.
    """
    damping = _FIRST_DAMPING
    at = _Linear.at(camera, poses, corners, points)
    for _ in range(MOST_STEPS):
        step = at.step(damping, lens=lens)
        next_camera = replace(camera, intrinsics=camera.intrinsics + step[0])
        next_poses = poses + step[1]
        next_at = _Linear.at(next_camera, next_poses, corners, points)
        if not next_at.square < at.square:
            damping *= 10
            if damping > _MOST_DAMPING:
                break
            continue
        gain = 1 - next_at.square / at.square
        camera, poses, at, damping = next_camera, next_poses, next_at, max(damping / 5, _TINY)
        if gain < LEAST_GAIN:
            break
    return Fit(camera=camera, poses=poses, residuals=at.rest, spread=at.spread())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Linear:
    """The linearised problem around one place.

    Attributes:
        rest: (view, corner, 2) residuals.
        square: Their sum of squares; infinite where a corner lies nowhere.
        pose_block: (view, 6, 6) normal matrices of the poses.
        mixed: (view, 6, intrinsics) of both.
        shared: (intrinsics, intrinsics) of the camera.
        own_side: (view, 6) right-hand sides.
        shared_side: (intrinsics,)
    """

    rest: FloatGrid
    square: float
    pose_block: FloatGrid
    mixed: FloatGrid
    shared: FloatGrid
    own_side: FloatGrid
    shared_side: FloatGrid

    @classmethod
    def at(
        cls, camera: Camera, poses: FloatGrid, corners: FloatGrid, points: FloatGrid
    ) -> "_Linear":
        places, by_number = project_views(camera, poses, points)
        rest = corners - places
        slopes = by_number.reshape(len(poses), 2 * len(points), -1)
        with np.errstate(over="ignore"):
            square = float(np.square(rest).sum())
        usable = np.isfinite(square) and bool(np.isfinite(slopes).all())
        slopes[..., [POSE_NUMBERS + number for number in camera.fixed]] = 0
        flat = rest.reshape(len(poses), -1, 1)
        if not usable:
            slopes, flat = np.zeros_like(slopes), np.zeros_like(flat)
        columns = slopes.swapaxes(1, 2)
        with np.errstate(over="ignore", invalid="ignore"):
            normal, side = columns @ slopes, (columns @ flat)[..., 0]
        return cls(
            rest=rest,
            square=square if usable else np.inf,
            pose_block=normal[:, :POSE_NUMBERS, :POSE_NUMBERS],
            mixed=normal[:, :POSE_NUMBERS, POSE_NUMBERS:],
            shared=normal[:, POSE_NUMBERS:, POSE_NUMBERS:].sum(axis=0),
            own_side=side[:, :POSE_NUMBERS],
            shared_side=side[:, POSE_NUMBERS:].sum(axis=0),
        )

    def step(self, damping: float, *, lens: bool) -> tuple[FloatGrid, FloatGrid]:
        """Return the steps of intrinsics and of poses."""
        poses_only = _with_damping(self.pose_block, damping)
        if not lens:
            own_step = _solve(poses_only, self.own_side[..., None])[..., 0]
            return np.zeros_like(self.shared_side), own_step
        solutions = _solve(
            poses_only, np.concatenate([self.mixed, self.own_side[..., None]], axis=-1)
        )
        own_mixed, own_step = solutions[..., :-1], solutions[..., -1]
        shared = _with_damping(self.shared, damping)
        reduced = shared - np.einsum("vki,vkj->ij", self.mixed, own_mixed)
        reduced_side = self.shared_side - np.einsum("vki,vk->i", self.mixed, own_step)
        lens_step = _solve(reduced, reduced_side[:, None])[:, 0]
        return lens_step, own_step - np.einsum("vki,i->vk", own_mixed, lens_step)

    def spread(self) -> FloatGrid:
        """Return the covariance of the intrinsics, poses being unknown too."""
        if not np.isfinite(self.square):
            return np.full_like(self.shared, np.inf)
        own_mixed = _solve(self.pose_block, self.mixed)
        reduced = self.shared - np.einsum("vki,vkj->ij", self.mixed, own_mixed)
        return _solve(reduced, np.eye(len(reduced)))


def _with_damping(squares: FloatGrid, damping: float) -> FloatGrid:
    """Return matrices whose diagonals are larger by a share of themselves."""
    sums = squares.copy()
    lines = np.einsum("...ii->...i", sums)
    lines += damping * np.maximum(lines, _TINY)
    return sums


def _solve(left: FloatGrid, right: FloatGrid) -> FloatGrid:
    """Solve; where numbers cannot be separated, take the least change."""
    scale = 1 / np.sqrt(np.maximum(np.einsum("...ii->...i", left), _TINY))[..., None]
    values, vectors = np.linalg.eigh(left * scale * scale.swapaxes(-1, -2))
    sizes = np.abs(values)
    clear = sizes > _SINGULAR * sizes.max(axis=-1, keepdims=True)
    inverse = np.divide(1, values, out=np.zeros_like(values), where=clear)[..., None]
    return np.asarray(scale * (vectors @ (inverse * (vectors.swapaxes(-1, -2) @ (scale * right)))))
