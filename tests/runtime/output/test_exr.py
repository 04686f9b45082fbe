from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage
from camkit.runtime.output.exr import HALF_MAX, ExrWriter, _patch_chromaticities
from camkit.runtime.output.picture_writer import PictureFormat
from tests.camera_factory import COLOR_MATRIX

STAGE = color_stage(None)


def write(path: Path, planes: FloatArray, rows: int = 7, **changes: object) -> None:
    _, height, width = planes.shape
    fields = {"width": width, "height": height, "color": STAGE} | changes
    with ExrWriter(path, PictureFormat(**fields)) as writer:  # type: ignore[arg-type]
        for top in range(0, height, rows):
            writer.write(planes[:, top : top + rows])


def read(path: Path) -> tuple[np.ndarray, dict[str, object]]:
    with OpenEXR.File(str(path)) as file:
        return file.channels()["RGB"].pixels.transpose(2, 0, 1), dict(file.header())


def picture(height: int, width: int) -> FloatArray:
    return np.random.default_rng(0).normal(0.5, 1, (3, height, width)).astype(np.float32)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 300), (300, 1), (37, 53)])
def test_half_picture_comes_back(tmp_path: Path, height: int, width: int) -> None:
    planes = picture(height, width)
    write(tmp_path / "a.exr", planes)
    found, _ = read(tmp_path / "a.exr")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found, planes.astype(np.float16))


@pytest.mark.parametrize("output", ["rec709", "acescg", "camera"])
def test_chromaticities_and_white_luminance_are_always_there(tmp_path: Path, output: str) -> None:
    stage = color_stage(np.array(COLOR_MATRIX), output)  # type: ignore[arg-type]
    write(tmp_path / "a.exr", picture(4, 4), color=stage)
    _, header = read(tmp_path / "a.exr")
    expected = [v for point in (*stage.primaries, stage.white) for v in point]
    np.testing.assert_allclose(header["chromaticities"], expected, rtol=1e-6)
    assert header["whiteLuminance"] == 100


@pytest.mark.parametrize("row", [0, 3, 20, 29])
@pytest.mark.parametrize("value", [HALF_MAX * 1.5, -1e6])
def test_value_beyond_half_makes_a_float_file(tmp_path: Path, row: int, value: float) -> None:
    planes = picture(30, 20)
    planes[1, row, 5] = value
    write(tmp_path / "a.exr", planes)
    found, header = read(tmp_path / "a.exr")
    assert found.dtype == np.float32
    assert np.isfinite(found).all()
    assert found[1, row, 5] == np.float32(value)
    np.testing.assert_allclose(found, planes, rtol=1e-3, atol=1e-3)
    assert header["chromaticities"][0] == pytest.approx(0.64)  # type: ignore[index]
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_largest_half_stays_half(tmp_path: Path) -> None:
    planes = np.full((3, 2, 2), HALF_MAX, dtype=np.float32)
    write(tmp_path / "a.exr", planes)
    found, _ = read(tmp_path / "a.exr")
    assert found.dtype == np.float16
    np.testing.assert_array_equal(found, planes)


def test_turned_float_picture_comes_back(tmp_path: Path) -> None:
    planes = picture(30, 20)
    planes[0, 28, 3] = 1e6
    write(tmp_path / "a.exr", planes, orientation=6)
    found, _ = read(tmp_path / "a.exr")
    assert found.shape == (3, 20, 30)
    assert found[0, 3, 1] == 1e6


def test_error_between_bands_releases_the_file(tmp_path: Path) -> None:
    planes = np.zeros((3, 20, 4), np.float32)
    planes[0, 15] = np.nan
    with pytest.raises(ContractError, match="NaN"):
        write(tmp_path / "a.exr", planes)
    (tmp_path / "a.exr").unlink()


def test_header_without_room_for_chromaticities_is_an_error(tmp_path: Path) -> None:
    (tmp_path / "a.exr").write_bytes(b"v/1\x01")
    with pytest.raises(ContractError, match="no chromaticities"):
        _patch_chromaticities(tmp_path / "a.exr", (0.0,) * 8)
