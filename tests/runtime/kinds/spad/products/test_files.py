"""Products as files: what is read back by other programs is what was written."""

from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.runtime.kinds.spad.captures.strips import KEPT_BYTES, check_room, pieces
from camkit.runtime.kinds.spad.products.archive import write_archive
from camkit.runtime.kinds.spad.products.picture import write_exr, write_tiff
from camkit.runtime.kinds.spad.products.points import directions, write_points
from camkit.runtime.kinds.spad.products.preview import (
    UNKNOWN,
    depth_picture,
    enlarged,
    grey_picture,
    white_of,
    white_of_flight,
    write_preview,
)
from camkit.runtime.kinds.spad.products.video import write_video


def test_an_archive_is_numpys_and_equal_arrays_give_equal_bytes(tmp_path: Path) -> None:
    arrays = {"depth_m": np.array([[1.5, np.nan]]), "valid": np.array([[True, False]])}
    for name in ("a.part", "b.part"):
        write_archive(tmp_path / name, arrays)
    with np.load(tmp_path / "a.part", allow_pickle=False) as found:
        for name, values in arrays.items():
            np.testing.assert_array_equal(found[name], values)
            assert found[name].dtype == values.dtype
    assert (tmp_path / "a.part").read_bytes() == (tmp_path / "b.part").read_bytes()


def test_a_bright_first_surface_does_not_darken_a_film() -> None:
    frames = np.full((200, 8, 8), 10.0)
    assert white_of_flight(frames) == 10.0
    frames[:4] = 200.0
    assert white_of_flight(frames) == 10.0
    frames[:4] = 3000.0
    assert white_of_flight(frames) == 100.0
    # light in few frames alone is not blown up beyond all bounds
    assert white_of_flight(np.where(np.arange(200)[:, None, None] < 4, frames, 0.0)) == 100.0


def _read_ply(path: Path) -> np.ndarray:
    """Read a binary PLY by its own header, as any reader does."""
    header, _, body = path.read_bytes().partition(b"end_header\n")
    lines = header.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    kinds = {"float": "<f4", "uchar": "u1"}
    rows = [line.split() for line in lines if line.startswith("property")]
    dtype = np.dtype([(name, kinds[kind]) for _, kind, name in rows])
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    assert len(body) == count * dtype.itemsize
    return np.frombuffer(body, dtype)


def test_points_lie_as_far_along_their_rays_as_light_went(tmp_path: Path) -> None:
    depth = np.full((2, 3, 5), np.nan)
    depth[0, 1, 2], depth[0, 0, 4], depth[1, 1, 2] = 2.0, 3.0, 4.0
    photons = np.arange(30.0).reshape(2, 3, 5)
    write_points(tmp_path / "p.ply", depth, photons, pitch_um=150, focal_length_mm=0.6)
    points = _read_ply(tmp_path / "p.ply")
    assert points["return"].tolist() == [1, 1, 2]
    assert points["intensity"].tolist() == [4, 7, 22]
    places = np.stack([points[name] for name in "xyz"], axis=1)
    np.testing.assert_allclose(np.linalg.norm(places, axis=1), [3, 2, 4], rtol=1e-6)
    # the middle of the array looks along z; a pixel 2 right and 1 up of it, at f = 4 pixels
    np.testing.assert_allclose(places[1], [0, 0, 2], atol=1e-6)
    np.testing.assert_allclose(places[0], np.array([2, -1, 4]) / np.sqrt(21) * 3, rtol=1e-5)


def test_a_plane_stays_a_plane() -> None:
    towards = directions((40, 60), 150, 5)
    range_m = 1.7 / towards[..., 2]  # what light measures of a plane 1.7 m in front of the lens
    np.testing.assert_allclose((towards * range_m[..., None])[..., 2], 1.7)


def test_a_sub_pixel_looks_where_the_pixel_does_on_whose_middle_it_lies() -> None:
    coarse = directions((8, 12), 150, 5)
    fine = directions((32, 48), 37.5, 5, scale=4, phase=2)
    np.testing.assert_allclose(fine[2::4, 2::4], coarse, atol=1e-12)


def test_what_does_not_fit_the_memory_as_a_whole_says_what_it_needs() -> None:
    check_room((32, 64), 125, 290, 400_000_000)
    with pytest.raises(
        ContractError, match=r"64x32 pixels of 4096 bins.*need max_mem_bytes=2_692_"
    ):
        check_room((32, 64), 4096, 290, 930_000_000)


def test_previews_show_near_and_far_and_what_is_not_known(tmp_path: Path) -> None:
    depth = np.linspace(1, 2, 50)[None].repeat(4, axis=0)
    depth[2, 3] = np.nan
    colours = depth_picture(depth).astype(int)
    assert colours[2, 3].tolist() == [UNKNOWN] * 3
    blue, _, red = colours[0].T
    assert red[2] > blue[2]
    assert blue[-3] > red[-3]
    assert (depth_picture(np.full((2, 2), np.nan)) == UNKNOWN).all()
    write_preview(tmp_path / "a.part", depth_picture(depth))
    shown = cv2.imdecode(np.fromfile(tmp_path / "a.part", np.uint8), cv2.IMREAD_COLOR)
    assert shown.shape == (4 * 6, 50 * 6, 3)
    np.testing.assert_array_equal(shown[::6, ::6], colours)


def test_grey_is_photons_against_white() -> None:
    photons = np.array([[0.0, 25.0, 100.0, 400.0, -3.0]])
    grey = grey_picture(photons, 100.0)[0, :, 0]
    assert grey.tolist() == [0, round(0.25 ** (1 / 2.2) * 255), 255, 255, 0]
    assert white_of(np.arange(1001.0)) == pytest.approx(995)


@pytest.mark.parametrize("shape", [(3, 3), (7, 100), (128, 256), (300, 401)])
def test_films_have_even_sides_and_every_frame(tmp_path: Path, shape: tuple[int, int]) -> None:
    codes = enlarged(np.zeros((*shape, 3), np.uint8), even=True)
    assert codes.shape[0] % 2 == codes.shape[1] % 2 == 0
    frames = np.zeros((12, *shape), np.float32)
    frames[6:, :, shape[1] // 2 :] = 50
    path = tmp_path / "film.mp4.part"
    write_video(path, frames, 50)
    assert [p.name for p in tmp_path.iterdir()] == ["film.mp4.part"]
    film = cv2.VideoCapture(str(path))
    seen = []
    while (got := film.read())[0]:
        seen.append(got[1])
    assert len(seen) == 12
    assert seen[0].shape == codes.shape
    assert seen[2].max() < 40
    assert seen[10][:, : codes.shape[1] // 3].max() < 60
    assert seen[10][:, -codes.shape[1] // 3 :].min() > 200


def test_float_pictures_keep_every_value(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).normal(size=(3, 5, 7)).astype(np.float32)
    frames[1, 2, 3] = np.nan
    write_exr(tmp_path / "a.exr", frames, "Z")
    parts = OpenEXR.File(str(tmp_path / "a.exr")).parts
    np.testing.assert_array_equal([part.channels["Z"].pixels for part in parts], frames)
    write_tiff(tmp_path / "a.tif", frames)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "a.tif"), frames)
    write_tiff(tmp_path / "one.tif", frames[:1])
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "one.tif"), frames[0])


@given(
    height=st.integers(1, 600),
    width=st.integers(1, 600),
    bins=st.integers(8, 4096),
    reach=st.integers(0, 4),
    cap_mb=st.integers(400, 3000),
)
def test_pieces_hold_every_row_once_and_stay_under_the_cap(
    height: int, width: int, bins: int, reach: int, cap_mb: int
) -> None:
    cap, held = cap_mb * 10**6, 150 * height * width
    of_row = width * bins * 32
    try:
        cut = pieces((height, width), bins, reach=reach, max_mem_bytes=cap, held_bytes=held)
    except ContractError as error:
        assert "need max_mem_bytes" in str(error)  # noqa: PT017 - either it fits or it is refused
        assert KEPT_BYTES + held + of_row * min(height, 2 * reach + 1) > cap
        return
    assert [piece.top for piece in cut] == [0, *(piece.bottom for piece in cut[:-1])]
    assert cut[-1].bottom == height
    for piece in cut:
        assert piece.first == max(0, piece.top - reach)
        assert piece.end == min(height, piece.bottom + reach)
        assert KEPT_BYTES + held + of_row * (piece.end - piece.first) <= cap
        assert np.arange(piece.first, piece.end)[piece.core].tolist() == list(
            range(piece.top, piece.bottom)
        )
