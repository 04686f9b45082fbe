"""Photographs of a board through a camera that is known to the last digit."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import Camera, FloatGrid, Model, project

BOARD = Board(columns=7, rows=5)
WIDEST_RAD = np.radians(82)


def camera_of(model: Model, focal_px: float, centre_px: Sequence[float], *coefficients: float) -> Camera:  # noqa: E501 # fmt: skip
    return Camera(model=model, intrinsics=np.array([focal_px, *centre_px, *coefficients]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """How a photograph is taken.

    Attributes:
        size: Width and height, px.
        blur_px: Sigma of the blur.
        dark, bright: Of the squares, coded.
        noise: Sigma.
        stretch: Of the squares along x: printed wrongly.
        skew: Of the squares, likewise.
        fine: Samples across a pixel.
    """

    size: tuple[int, int] = (400, 300)
    blur_px: float = 1.0
    dark: float = 0.15
    bright: float = 0.85
    noise: float = 0.004
    stretch: float = 1.0
    skew: float = 0.0
    fine: int = 3


@lru_cache(maxsize=4)
def directions(camera: Camera, size: tuple[int, int], fine: int) -> FloatGrid:
    """Give (h, w, 2) X/Z, Y/Z of every fine pixel, by inverting the camera's own projection."""
    width, height = size
    y, x = ((np.arange(n * fine) + 0.5) / fine - 0.5 for n in (height, width))
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    flat = (places - camera.centre_px) / camera.focal_px
    radius = np.linalg.norm(flat, axis=1)
    # models without tangential terms are inverted by a table of their profile
    ideal = np.tan(np.linspace(0, WIDEST_RAD, 20001))
    line = np.stack([ideal, 0 * ideal, 0 * ideal + 1], axis=-1)
    seen = project(camera, np.array([0, 0, 0, 0, 0, 1e-9]), line)[0][:, 0]
    profile = (seen - camera.centre_px[0]) / camera.focal_px
    end = int(np.argmax(np.diff(profile) <= 0)) or profile.size
    back = np.interp(radius, profile[:end], ideal[:end], right=1e3)
    scale = np.divide(back, radius, out=np.ones_like(back), where=radius > 0)
    return (flat * scale[:, None]).reshape(height * fine, width * fine, 2)


def photograph(
    camera: Camera, pose: FloatGrid, shot: Shot, board: Board = BOARD, seed: int = 0
) -> NDArray[np.uint16]:
    """Give (h, w) codes of one photograph."""
    turn, _ = cv2.Rodrigues(pose[:3])
    rays = directions(camera, shot.size, shot.fine)
    rays = np.concatenate([rays, np.ones_like(rays[..., :1])], axis=-1) @ turn
    origin = -pose[3:] @ turn
    with np.errstate(invalid="ignore", divide="ignore"):
        away = -origin[2] / rays[..., 2]
        x, y = (origin[i] + away * rays[..., i] for i in (0, 1))
        x = x / shot.stretch - shot.skew * y
        whole = np.floor(x) + np.floor(y)
        square = np.where(whole % 2 == 0, shot.dark, shot.bright)
        inside = (x >= -1) & (x < board.columns) & (y >= -1) & (y < board.rows)
        inside &= np.isfinite(x) & np.isfinite(y) & (away > 0)
    fine = np.where(inside, square, shot.bright).astype(np.float32)
    width, height = shot.size
    coarse = fine.reshape(height, shot.fine, width, shot.fine).mean((1, 3))
    blurred = cv2.GaussianBlur(coarse, (0, 0), shot.blur_px) if shot.blur_px > 0 else coarse
    noisy = blurred + np.random.default_rng(seed).normal(0, shot.noise, blurred.shape)
    return np.rint(np.clip(noisy, 0, 1) * 65535).astype(np.uint16)


PLACES = ((0, 0), (-1, -1), (1, 1), (1, -1), (-1, 1), (1, 0), (-1, 0), (0, 1), (0, -1))


@lru_cache(maxsize=32)
def poses_around(
    camera: Camera,
    size: tuple[int, int],
    count: int,
    *,
    span: float = 0.42,
    reach: float = 0.98,
    seed: int = 0,
) -> FloatGrid:
    """Give (count, 6) poses that put `BOARD` all over the picture, turned towards the camera.

    Args:
        span: Of the longer side of the picture, about what the board takes in the middle.
        reach: Of the way to the border, where boards are tried first.
    """
    rng = np.random.default_rng(seed)
    middle = np.array([(BOARD.columns - 1) / 2, (BOARD.rows - 1) / 2, 0])
    rays = directions(camera, size, 1)
    depth = (BOARD.columns + 1) * camera.focal_px / (span * max(size))
    found: list[FloatGrid] = []
    for number in range(count):
        u, v = PLACES[number % len(PLACES)]
        tilt = rng.uniform(-0.5, 0.5, 3)
        # from outside inwards, until all of the board is in the picture
        for far in np.linspace(reach, 0.0, 50):
            x, y = (round((n - 1) / 2 * (1 + far * part)) for n, part in zip(size, (u, v), strict=True))  # noqa: E501 # fmt: skip
            ray = np.array([*rays[y, x], 1.0])
            ray /= np.linalg.norm(ray)
            axis = np.cross([0, 0, 1.0], ray)
            bend = axis / max(np.linalg.norm(axis), 1e-9) * np.arccos(ray[2])
            turn = cv2.Rodrigues(bend)[0] @ cv2.Rodrigues(tilt)[0]
            pose = np.concatenate([cv2.Rodrigues(turn)[0].ravel(), ray * depth - turn @ middle])
            seen, _ = project(camera, pose, outline(BOARD))
            if np.isfinite(seen).all() and (seen > 3).all() and (seen < np.array(size) - 4).all():
                found.append(pose)
                break
    return np.stack(found)


def outline(board: Board) -> FloatGrid:
    x = np.array([-1, board.columns, board.columns, -1, (board.columns - 1) / 2])
    y = np.array([-1, -1, board.rows, board.rows, (board.rows - 1) / 2])
    return np.stack([x, y, 0 * x], axis=-1).astype(np.float64)


def write_photographs(
    folder: Path, camera: Camera, poses: FloatGrid, shot: Shot, board: Board = BOARD
) -> list[Path]:
    """Write 16-bit TIFFs of three like channels."""
    files = []
    for number, pose in enumerate(poses):
        path = folder / f"{number}.png"
        cv2.imwrite(str(path), photograph(camera, pose, shot, board, number))
        files.append(path)
    return files
