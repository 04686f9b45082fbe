"""Tests of what poor views determine and what is held, and that good views are not touched."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.calibration.geometry.camera_model import MODELS, Camera, FloatGrid, project
from camkit.calibration.geometry.choice import judge, judge_all
from camkit.calibration.geometry.corner_file import (
    CornerFile,
    is_corner_file,
    read_corners,
)
from camkit.calibration.geometry.determination import determine
from camkit.calibration.geometry.geometry import Geometry, calibrate_corners
from camkit.calibration.geometry.start import fit_models
from camkit.errors import ContractError, DecodeError
from tests.camkit.calibration.geometry.board_factory import BOARD, camera_of, poses_around
from tests.data_folder import data_path

SIZE = (400, 300)
MIDDLE = (199.5, 149.5)
LENS = camera_of(MODELS[1], 500, (203.0, 147.0), -0.12)
POINTS = BOARD.points


def _seen(poses: FloatGrid, scatter_px: float, seed: int = 0, camera: Camera = LENS) -> FloatGrid:
    exact = np.stack([project(camera, pose, POINTS)[0] for pose in poses])
    return exact + np.random.default_rng(seed).normal(0, scatter_px / np.sqrt(2), exact.shape)


def _poses(tilts_deg: FloatGrid, places: FloatGrid, distances: FloatGrid) -> FloatGrid:
    """Return poses by tilts about x and y, the place of the middle, and its distance in squares."""
    middle = POINTS.mean(axis=0)
    poses = []
    for tilt, place, away in zip(np.radians(tilts_deg), places, distances, strict=True):
        turn, _ = cv2.Rodrigues(np.array([*tilt, 0.0]))
        at = np.array([*(np.subtract(place, LENS.centre_px) / LENS.focal_px), 1.0]) * away
        poses.append(np.concatenate([[*tilt, 0.0], at - turn @ middle]))
    return np.stack(poses)


def _bent(poses: FloatGrid, bend: float, seed: int = 1) -> FloatGrid:
    """Return corners of boards that are each bent otherwise: their scatter is no chance."""
    rng, corners = np.random.default_rng(seed), []
    for pose in poses:
        x, y, _ = POINTS.T / 6
        waves = rng.normal(0, bend, (4, 2))
        shift = np.stack([x * x, x * y, y * y, x**3], axis=1) @ waves
        corners.append(project(LENS, pose, POINTS)[0] + shift)
    return np.stack(corners) + rng.normal(0, 0.05, (len(poses), len(POINTS), 2))


def _flat(count: int, tilt_deg: float, seed: int = 2) -> FloatGrid:
    rng = np.random.default_rng(seed)
    return _poses(
        rng.normal(0, tilt_deg, (count, 2)),
        MIDDLE + rng.uniform(-1, 1, (count, 2)) * (90, 60),
        rng.uniform(16, 24, count),
    )


def _in_a_corner(count: int) -> FloatGrid:
    rng = np.random.default_rng(4)
    tilts = rng.uniform(-8, 8, (count, 2))
    return _poses(tilts, np.tile((80.0, 70.0), (count, 1)), rng.uniform(28, 34, count))


POOR = {
    "nearly parallel, boards that are not flat": _bent(_flat(7, 4), 3.0),
    "nearly parallel, half a px of scatter": _seen(_flat(6, 3), 0.5),
    "four views": _bent(_flat(4, 6), 2.0, seed=5),
    "in one corner": _seen(_in_a_corner(6), 0.8),
    "large scatter": _seen(_flat(8, 4), 0.9),
}


def _measured(corners: FloatGrid, focal_px: float | None = None) -> Geometry:
    return calibrate_corners(CornerFile(board=BOARD, size=SIZE, corners=corners), focal_px)


@pytest.mark.parametrize("name", POOR)
def test_poor_views_give_a_camera_that_a_lens_may_have_and_say_what_is_held(name: str) -> None:
    found = _measured(POOR[name], LENS.focal_px)
    assert found.undetermined == ("centre_px", "focal_px")
    assert found.camera.centre_px == MIDDLE
    assert found.camera.focal_px == LENS.focal_px
    assert np.abs(found.camera.coefficients).max() < 5
    assert len(found.camera.model.free) <= 3
    said = " ".join(found.notes)
    assert "do not determine the optical centre: it is held at the middle" in said
    assert "do not determine the focal length: it is held at its nominal 500 px" in said
    assert found.to_record()["undetermined"] == ["centre_px", "focal_px"]
    # no worse than what the true camera leaves by more than its uncertainty
    true = judge(fit_models(POOR[name], POINTS, SIZE)[1], POOR[name], POINTS)
    assert found.best.rms_px < 1.3 * true.rms_px


GOOD = {
    "tilted at one distance": _poses(
        np.array([(25, 0), (-25, 5), (0, 28), (5, -28), (20, 20), (-20, 18), (22, -20), (0, 0)]),
        np.tile(MIDDLE, (8, 1)) + np.linspace(-60, 60, 8)[:, None] * (1, 0.5),
        np.full(8, 18.0),
    ),
    "all over the picture": poses_around(LENS, SIZE, 10, seed=1),
    "twelve, tilted by 15 degrees": _flat(12, 15),
}


@pytest.mark.parametrize("name", GOOD)
def test_what_views_determine_is_fitted_whatever_the_nominal_focal_length(name: str) -> None:
    found = _measured(_seen(GOOD[name], 0.1), focal_px=350.0)
    assert found.undetermined == ()
    assert "undetermined" not in found.to_record()
    assert found.camera.focal_px == pytest.approx(LENS.focal_px, rel=0.02)
    assert np.hypot(*np.subtract(found.camera.centre_px, LENS.centre_px)) < 5


def _parallel(scatter_px: float, tilt_deg: float = 0.0) -> FloatGrid:
    """Return corners of boards at several places, all tilted alike."""
    rng = np.random.default_rng(6)
    tilts = np.tile((tilt_deg, tilt_deg / 2), (6, 1))
    places = MIDDLE + rng.uniform(-1, 1, (6, 2)) * (80, 50)
    return _seen(_poses(tilts, places, rng.uniform(18, 24, 6)), scatter_px)


@pytest.mark.parametrize("scatter_px", [0.0, 0.05, pytest.param(0.3, marks=pytest.mark.slow)])
def test_exactly_parallel_views_need_the_nominal_focal_length(scatter_px: float) -> None:
    corners = _parallel(scatter_px)
    judged, _ = judge_all(corners, POINTS, SIZE)
    with pytest.raises(DecodeError, match=r"do not tell the focal length.* or give focal_px$"):
        determine(judged, corners, POINTS, SIZE)
    found = determine(judged, corners, POINTS, SIZE, LENS.focal_px)
    assert "focal_px" in found.undetermined
    assert found.best.fit.camera.focal_px == LENS.focal_px
    assert found.best.rms_px < 1.2 * scatter_px + 0.05


def test_views_of_one_tilt_do_not_run_away_to_no_focal_length() -> None:
    found = _measured(_parallel(0.1, 20.0), LENS.focal_px)
    assert found.camera.focal_px == pytest.approx(LENS.focal_px, rel=0.05)
    assert found.camera.model.name == "radial_1"


def test_views_of_another_camera_among_many_are_named() -> None:
    corners = _seen(GOOD["all over the picture"], 0.1)
    other = camera_of(MODELS[0], 640, (203.0, 147.0))
    corners[3] = _seen(GOOD["all over the picture"], 0.1, camera=other)[3]
    corners[3, :, 0] *= 1.06
    with pytest.raises(DecodeError, match=r"does not fit picture 4 \("):
        _measured(corners)


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_views_are_refused(count: int) -> None:
    with pytest.raises(DecodeError, match=rf"{count} of {count} pictures show a board of 7x5"):
        _measured(_seen(GOOD["all over the picture"][:count], 0.1))


def test_the_jackknife_agrees_with_the_covariance_of_opencv_where_scatter_is_chance() -> None:
    corners = _seen(GOOD["all over the picture"], 0.2)
    judged = judge(fit_models(corners, POINTS, SIZE)[1], corners, POINTS)
    flags = cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3 | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_ASPECT_RATIO | cv2.CALIB_USE_INTRINSIC_GUESS
    views = [one.astype(np.float32) for one in corners]
    boards = [POINTS.astype(np.float32)] * len(views)
    found = cv2.calibrateCameraExtended(boards, views, SIZE, LENS.matrix, None, flags=flags)
    assert judged.fit.camera.focal_px == pytest.approx(found[1][0, 0], rel=1e-3)
    said = found[5].ravel()[1:4]
    assert 0.4 < np.median(judged.spread[:3] / said) < 2.5


@pytest.fixture(scope="module")
def flat() -> Geometry:
    return calibrate_corners(read_corners(data_path("reports/flat_views_corners.json")))


def test_sixteen_flat_views_get_a_model_that_they_can_carry(flat: Geometry) -> None:
    assert flat.undetermined == ("centre_px", "focal_px")
    assert flat.camera.centre_px == (2999.5, 1999.5)
    assert np.abs(flat.camera.coefficients).max() < 2
    # OpenCV with k1 and k2: 3.1 px
    assert flat.best.fit.rms_px < 3.2
    assert flat.best.rms_px < 3.5
    assert "do not determine the focal length" in " ".join(flat.notes)
    assert flat.profile.fold_px >= flat.coverage.corner_px


def test_the_covariance_alone_would_believe_the_flat_views(flat: Geometry) -> None:
    fit = flat.best.fit
    formal = np.sqrt(fit.spread[0, 0]) * fit.rms_px / np.sqrt(2)
    assert formal < 0.015 * fit.camera.focal_px
    assert flat.best.spread[0] > 5 * formal


@pytest.mark.slow
def test_models_that_no_lens_has_are_not_taken_however_well_they_explain() -> None:
    corners = POOR["nearly parallel, boards that are not flat"]
    judged, _ = judge_all(corners, POINTS, SIZE)
    found = determine(judged, corners, POINTS, SIZE)
    best = min(judged, key=lambda one: one.fit.rms_px)
    assert best.fit.rms_px < found.best.fit.rms_px
    assert not found.best.fit.camera.model.is_tangential


def _document(**changes: object) -> dict[str, object]:
    pictures = _seen(GOOD["all over the picture"], 0.1).tolist()
    fields = {"board": "7x5", "width_px": 400, "height_px": 300, "pictures": pictures}
    return fields | changes


def _written(folder: Path, text: str) -> Path:
    path = folder / "corners.json"
    path.write_text(text)
    return path


def test_a_corner_file_gives_what_its_corners_give(tmp_path: Path) -> None:
    path = _written(tmp_path, json.dumps(_document(square_mm=20, focal_px=480, more="is ignored")))
    given = read_corners(path)
    assert (given.size, given.focal_px, given.board.square_mm) == (SIZE, 480, 20)
    found = calibrate_corners(given)
    assert found.camera.focal_px == pytest.approx(LENS.focal_px, rel=0.02)
    first = found.to_record()["pictures"][0]
    assert (first["file"], first["found"]) == ("picture 1", True)
    assert first["distance_mm"] > 0


SHORT = [[[1.0, 2.0]] * 34] * 3
TWICE = [[[float(n), float(n)] for n in range(35)]] * 3
BROKEN = {
    "no JSON": ("{", "is no JSON"),
    "nested without end": ("[" * 100_000, "is no JSON"),
    "a list": ("[]", "the file"),
    "no board": (json.dumps({"width_px": 400}), "board"),
    "another board": (json.dumps(_document(board="1x1")), "3 to 100 inner corners"),
    "too few corners": (json.dumps(_document(pictures=SHORT)), "35 corners; picture 1 has 34"),
    "a picture twice": (json.dumps(_document(pictures=TWICE)), "pictures 1 and 2 are the same"),
    "corners outside": (json.dumps(_document(width_px=200)), "outside of 200x300 px"),
    "not a number": (json.dumps(_document(pictures=[[[float("nan"), 0]] * 35])), "finite"),
    "three numbers": (json.dumps(_document(pictures=[[[1, 2, 3]] * 35])), "pictures"),
    "another unit": (json.dumps(_document(unit="mm")), "the unit 'mm'"),
    "too many pictures": (json.dumps(_document(pictures=[[]] * 300)), "256"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_corner_file_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, said = BROKEN[name]
    with pytest.raises(DecodeError, match=said) as refused:
        read_corners(_written(tmp_path, text))
    assert len(str(refused.value).splitlines()) == 1


def test_what_is_no_file_is_refused(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "absent.json"):
        with pytest.raises(DecodeError):
            read_corners(path)


def test_a_corner_file_stands_alone() -> None:
    assert is_corner_file([Path("a.JSON")])
    assert not is_corner_file([Path("a.jpg"), Path("b.jpg")])
    with pytest.raises(ContractError, match="give it alone"):
        is_corner_file([Path("a.json"), Path("b.jpg")])


@pytest.mark.parametrize("focal_px", [0.0, -1.0, float("nan"), float("inf")])
def test_a_nominal_focal_length_is_a_number(focal_px: float) -> None:
    with pytest.raises(ContractError, match="focal length must be > 0 px"):
        _measured(_seen(GOOD["all over the picture"], 0.1), focal_px)
