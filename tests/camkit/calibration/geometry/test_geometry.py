"""Photographs to the geometry of a camera: what is found, how well, and what is refused."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.geometry.board import Board
from camkit.calibration.geometry.camera_model import (
    MODELS,
    POSE_NUMBERS,
    Camera,
    FloatGrid,
    project,
)
from camkit.calibration.geometry.geometry import Geometry, calibrate_geometry
from camkit.errors import DecodeError
from tests.camkit.calibration.geometry.board_factory import (
    BOARD,
    Shot,
    camera_of,
    directions,
    photograph,
    poses_around,
    write_photographs,
)
from tests.data_folder import data_path

DISTORTION_PX = 0.15
"""Anywhere within the covered radius, of the distortion alone: a turn of the camera and its focal
length are free, since they bend no straight line."""
CENTRE_PX = 1.2
FOCAL = 5e-3
NINE_BY_SIX = Board(columns=9, rows=6)


def _missed_px(found: Geometry, true: Camera) -> float:
    """Give the largest error of the distortion within the covered radius."""
    rays = directions(true, found.size, 1)
    y, x = np.mgrid[: found.size[1], : found.size[0]]
    places = np.stack([x, y], axis=-1)
    near = np.linalg.norm(places - found.camera.centre_px, axis=-1) <= found.coverage.radius_px
    seen = places[near].astype(np.float64)
    points = np.concatenate([rays[near], np.ones((len(seen), 1))], axis=1)
    pose, scale = np.zeros(POSE_NUMBERS), 1.0
    for _ in range(5):
        at, slopes = project(found.camera, pose, points * [scale, scale, 1])
        more, _ = project(found.camera, pose, points * [scale + 1e-6, scale + 1e-6, 1])
        by = np.concatenate([slopes[..., :3], (more - at)[..., None] / 1e-6], axis=-1)
        step = np.linalg.lstsq(by.reshape(-1, 4), (seen - at).ravel(), rcond=None)[0]
        pose[:3] += step[:3]
        scale += step[3]
    at, _ = project(found.camera, pose, points * [scale, scale, 1])
    return float(np.linalg.norm(at - seen, axis=1).max())


def _check_like(found: Geometry, true: Camera) -> None:
    assert found.camera.focal_px == pytest.approx(true.focal_px, rel=FOCAL)
    assert np.linalg.norm(np.subtract(found.camera.centre_px, true.centre_px)) < CENTRE_PX
    assert _missed_px(found, true) < DISTORTION_PX


@pytest.fixture(scope="module")
def found(photographs: list[Path]) -> Geometry:
    return calibrate_geometry(photographs, Board(columns=7, rows=5, square_mm=20))


def test_a_known_camera_is_found(found: Geometry, barrel: Camera) -> None:
    assert found.camera.model.name == "radial_2"
    _check_like(found, barrel)
    assert found.radial.residual_px < 0.01


def test_the_record_says_all_of_it(found: Geometry, photographs: list[Path]) -> None:
    record = found.to_record()
    assert [picture["file"] for picture in record["pictures"]] == [p.name for p in photographs]
    assert all(picture["found"] for picture in record["pictures"])
    assert (record["width_px"], record["height_px"]) == (400, 300)
    assert record["held_out_worst_px"] >= record["held_out_rms_px"] > record["rms_px"]
    assert len(record["coefficients"]) == 8
    assert len(record["radial"]["coefficients"]) == 4
    assert 150 < record["covered_radius_px"] < 250


def test_distances_are_those_of_the_boards(found: Geometry, barrel: Camera) -> None:
    poses = poses_around(barrel, found.size, 10, seed=1)
    middle = BOARD.points.mean(axis=0)
    told = [picture["distance_mm"] for picture in found.to_record()["pictures"]]
    true = [20 * np.linalg.norm(cv2.Rodrigues(p[:3])[0] @ middle + p[3:]) for p in poses]
    assert told == pytest.approx(true, rel=FOCAL)


def test_what_was_not_seen_is_said(found: Geometry) -> None:
    assert any("the distortion beyond is a guess" in note for note in found.notes)
    assert any("px off the middle" in note for note in found.notes)


HAZY = Shot(blur_px=3.5, dark=0.35, bright=0.65)
CAMERAS = {
    "pincushion": camera_of(MODELS[2], 500, (189.5, 160.0), 0.2, 0.1),
    "fisheye": camera_of(MODELS[4], 185, (204.5, 153.0), 0.03, -0.01, 0, 0),
    "no distortion": camera_of(MODELS[0], 700, (195.5, 158.0)),
}


@pytest.mark.parametrize(
    ("name", "shot"),
    [*((name, Shot()) for name in CAMERAS), ("fisheye", HAZY)],
    ids=[*CAMERAS, "fisheye, strong blur in haze"],
)
def test_distortion_of_any_kind_is_found(tmp_path: Path, name: str, shot: Shot) -> None:
    camera = CAMERAS[name]
    files = write_photographs(tmp_path, camera, poses_around(camera, shot.size, 10, seed=1), shot)
    _check_like(calibrate_geometry(files, BOARD), camera)


def test_checkerboards_are_calibrated() -> None:
    files = sorted(data_path("lens/checkerboard_left").glob("*.jpg"))
    found = calibrate_geometry(files, NINE_BY_SIX)
    assert all(view.corners is not None for view in found.views)
    assert found.best.rms_px <= 0.25
    assert found.best.worst_px <= 0.25


def test_a_fisheye_is_calibrated() -> None:
    files = sorted(data_path("lens/fisheye_left").glob("*.jpg"))
    found = calibrate_geometry(files, NINE_BY_SIX)
    assert found.best.rms_px <= 0.35
    assert found.best.worst_px <= 0.35


def _with(photographs: list[Path], extra: FloatGrid | np.ndarray, folder: Path) -> list[Path]:
    path = folder / "odd.png"
    cv2.imwrite(str(path), extra)
    return [*photographs, path]


def test_a_picture_of_another_board_is_named(
    photographs: list[Path], barrel: Camera, tmp_path: Path
) -> None:
    shot = Shot(stretch=1.1)
    pose = poses_around(barrel, shot.size, 12, seed=3)[10]
    files = _with(photographs, photograph(barrel, pose, shot), tmp_path)
    with pytest.raises(DecodeError, match=r"does not fit odd\.png \("):
        calibrate_geometry(files, BOARD)


def test_a_picture_at_another_zoom_is_named(
    photographs: list[Path], barrel: Camera, tmp_path: Path
) -> None:
    numbers = barrel.intrinsics * [1.3, 1, 1, 1, 1]
    zoomed = Camera(model=barrel.model, intrinsics=numbers)
    pose = poses_around(zoomed, (400, 300), 2, seed=5)[1]
    files = _with(photographs, photograph(zoomed, pose, Shot()), tmp_path)
    with pytest.raises(DecodeError, match=r"odd\.png"):
        calibrate_geometry(files, BOARD)


def test_a_picture_without_a_board_is_left_out_and_named(
    photographs: list[Path], tmp_path: Path
) -> None:
    blank = np.random.default_rng(0).integers(0, 255, (300, 400, 3), np.uint8)
    found = calibrate_geometry(_with(photographs, blank, tmp_path), BOARD)
    assert found.notes[0] == "odd.png: no board found"
    odd = {"file": "odd.png", "found": False, "rms_px": None}
    assert found.to_record()["pictures"][-1] == odd


def test_another_size_is_named(photographs: list[Path], tmp_path: Path) -> None:
    turned = cv2.imread(str(photographs[0])).transpose(1, 0, 2)
    with pytest.raises(DecodeError, match=r"odd\.png has 300x400 px, others 400x300"):
        calibrate_geometry(_with(photographs, turned, tmp_path), BOARD)


def test_a_picture_given_twice_is_refused(photographs: list[Path], tmp_path: Path) -> None:
    copy = shutil.copy(photographs[0], tmp_path / "copy.png")
    for again in (photographs[0], Path(copy)):
        with pytest.raises(DecodeError, match="are the same picture"):
            calibrate_geometry([*photographs[:3], again], BOARD)


def test_too_few_views_are_refused(photographs: list[Path]) -> None:
    with pytest.raises(
        DecodeError, match="2 of 2 pictures show a board of 7x5 inner corners, 3 are"
    ):
        calibrate_geometry(photographs[:2], BOARD)


def test_a_board_that_is_not_there_is_named(photographs: list[Path]) -> None:
    with pytest.raises(DecodeError, match="no picture shows a board of 9x6 inner corners"):
        calibrate_geometry(photographs[:3], NINE_BY_SIX)


def test_boards_that_face_the_camera_do_not_tell_the_focal_length(
    tmp_path: Path,
) -> None:
    straight = camera_of(MODELS[0], 2000, (199.5, 149.5))
    poses = np.zeros((4, POSE_NUMBERS))
    poses[:, 3:] = [(-3 + u, -2 + v, 60 + w) for u, v, w in [(0, 0, 0), (1, 1, 0), (-1, 0, 0), (0, -1, 0)]]  # noqa: E501 # fmt: skip
    files = write_photographs(tmp_path, straight, poses, Shot())
    with pytest.raises(DecodeError, match="do not tell the focal length"):
        calibrate_geometry(files, BOARD)
