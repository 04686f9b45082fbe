"""Models of a camera, from simple to rich, and one with its numbers.

A point at (x, y) = (X/Z, Y/Z) of the camera falls on focal * (x', y') + centre. With
r^2 = x^2 + y^2 and a = atan r,

    pinhole family  (x', y') =
        (x, y) (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
        + (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y)
    fisheye         (x', y') =
        (x, y) a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8) / r

Pixels are square: one focal length.

References: Brown 1966; Kannala and Brandt 2006; the rational form and the order of coefficients are
    OpenCV's (k1, k2, p1, p2, k3, k4, k5, k6).
"""

from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

FloatGrid = NDArray[np.float64]

FOCAL: Final = 0
CENTRE: Final = (1, 2)
LENS_NUMBERS: Final = 3
"""Focal length and centre, before the coefficients in a vector of intrinsics."""
POSE_NUMBERS: Final = 6
"""Rotation vector and translation."""
_PINHOLE_COEFFICIENTS: Final = 8
_FISHEYE_COEFFICIENTS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A form of distortion.

    Attributes:
        name: As results say it.
        free: Numbers of the coefficients that are fitted; the others are 0.
        fisheye: A polynomial in the angle, not in its tangent.
    """

    name: str
    free: tuple[int, ...]
    fisheye: bool = False

    @property
    def coefficients(self) -> int:
        """Return the number of coefficients, fitted or not."""
        return _FISHEYE_COEFFICIENTS if self.fisheye else _PINHOLE_COEFFICIENTS

    @property
    def is_tangential(self) -> bool:
        """Return whether p1 and p2 are fitted, which move the centre of the distortion."""
        return not self.fisheye and not {2, 3}.isdisjoint(self.free)


MODELS: Final = (
    Model(name="pinhole", free=()),
    Model(name="radial_1", free=(0,)),
    Model(name="radial_2", free=(0, 1)),
    Model(name="radial_3", free=(0, 1, 4)),
    Model(name="fisheye", free=(0, 1, 2, 3), fisheye=True),
    Model(name="brown", free=(0, 1, 2, 3, 4)),
    Model(name="rational", free=(0, 1, 2, 3, 4, 5, 6, 7)),
)
"""From simple to rich."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Camera:
    """A model with its numbers.

    Attributes:
        model: The form.
        intrinsics: Focal length, centre x, centre y, then the free coefficients; px.
        fixed: Places in `intrinsics` of what is known and not fitted.
    """

    model: Model
    intrinsics: FloatGrid
    fixed: tuple[int, ...] = ()

    @property
    def focal_px(self) -> float:
        """Return the focal length."""
        return float(self.intrinsics[0])

    @property
    def centre_px(self) -> tuple[float, float]:
        """Return x, y of the optical centre."""
        return float(self.intrinsics[1]), float(self.intrinsics[2])

    @property
    def coefficients(self) -> FloatGrid:
        """Return all coefficients in OpenCV's order."""
        every = np.zeros(self.model.coefficients)
        every[list(self.model.free)] = self.intrinsics[LENS_NUMBERS:]
        return every

    @property
    def matrix(self) -> FloatGrid:
        """Return the (3, 3) matrix of intrinsics."""
        x, y = self.centre_px
        return np.array([[self.focal_px, 0, x], [0, self.focal_px, y], [0, 0, 1.0]])


def with_model(camera: Camera, model: Model) -> Camera:
    """Return a camera in a richer form of its own kind; it sees the same."""
    coefficients = camera.coefficients[list(model.free)]
    return replace(
        camera,
        model=model,
        intrinsics=np.concatenate([camera.intrinsics[:LENS_NUMBERS], coefficients]),
    )


def project(camera: Camera, pose: FloatGrid, points: FloatGrid) -> tuple[FloatGrid, FloatGrid]:
    """Return the places of points on the picture, and their derivatives.

    Args:
        camera: The camera.
        pose: (6,) rotation vector and translation, from the points to the camera.
        points: (point, 3).

    Returns:
        (point, 2) x, y in px; and (point, 2, 6 + intrinsics) derivatives by pose and intrinsics.
        Not finite where a point lies behind the camera.
    """
    places, slopes = project_views(camera, pose[None], points)
    return places[0], slopes[0]


def project_views(
    camera: Camera, poses: FloatGrid, points: FloatGrid
) -> tuple[FloatGrid, FloatGrid]:
    """Return what `project` does, for every pose (view, 6): places and slopes (view, point, ...).

    All views go through OpenCV at once, as points before a camera that is not turned. A rotation by
    a small angle about an axis w moves a turned point q by w x q, so g (w x q) = w (q x g) px for
    the slopes g of the picture by q.
    """
    turns, axes = _turns(poses)
    offsets = points @ turns.swapaxes(1, 2)
    places_3d = offsets + poses[:, None, 3:]
    k, model, shape = camera.coefficients, camera.model, places_3d.shape[:2]
    line, still = places_3d.reshape(1, -1, 3), np.zeros(3)
    if model.fisheye:
        places, table = cv2.fisheye.projectPoints(line, still, still, camera.matrix, k)
        shifts, lens, others = table[:, 11:14], table[:, :4], table[:, 4:8]
    else:
        places, table = cv2.projectPoints(line, still, still, camera.matrix, k)
        shifts, lens, others = table[:, 3:6], table[:, 6:10], table[:, 10:]
    at = np.asarray(places, dtype=np.float64).reshape(*shape, 2)
    at[(places_3d[..., 2] <= 0).any(axis=1)] = np.nan
    arms = np.cross(np.repeat(offsets.reshape(-1, 3), 2, axis=0), shifts)
    slopes = np.empty((len(poses), 2 * len(points), POSE_NUMBERS + camera.intrinsics.size))
    slopes[..., :3] = arms.reshape(len(poses), -1, 3) @ axes
    rows = slopes.reshape(len(table), -1)
    rows[:, 3:POSE_NUMBERS] = shifts
    rows[:, POSE_NUMBERS] = lens[:, 0] + lens[:, 1]
    rows[:, POSE_NUMBERS + 1 : POSE_NUMBERS + LENS_NUMBERS] = lens[:, 2:4]
    rows[:, POSE_NUMBERS + LENS_NUMBERS :] = others.take(model.free, axis=1)
    return at, slopes.reshape(*shape, 2, -1)


def _turns(poses: FloatGrid) -> tuple[FloatGrid, FloatGrid]:
    """Return rotations (view, 3, 3), and by number of the vector the axes (view, xyz, number)."""
    turns, slopes = (np.stack(part) for part in zip(*(cv2.Rodrigues(one[:3]) for one in poses), strict=True))  # noqa: E501 # fmt: skip
    spins = slopes.reshape(-1, 3, 3, 3) @ turns.swapaxes(1, 2)[:, None]
    return turns, np.stack([spins[..., 2, 1], spins[..., 0, 2], spins[..., 1, 0]], axis=1)


def depths(pose: FloatGrid, points: FloatGrid) -> FloatGrid:
    """Return the distances of points in front of the camera."""
    turn, _ = cv2.Rodrigues(pose[:3])
    return np.asarray(points @ turn[2] + pose[5])


def distance(pose: FloatGrid, point: FloatGrid) -> float:
    """Return the distance of a point (3,) from the camera."""
    turn, _ = cv2.Rodrigues(pose[:3])
    return float(np.linalg.norm(turn @ point + pose[3:]))
