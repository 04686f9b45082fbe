from pathlib import Path

import numpy as np
import pytest
import tifffile

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage, encode_uint16
from camkit.runtime.output.icc import icc_profile
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.tiff_writer import TiffWriter

STAGE = color_stage(None)


def write(path: Path, planes: FloatArray, **changes: object) -> None:
    _, height, width = planes.shape
    fields = {"width": width, "height": height, "color": STAGE} | changes
    with TiffWriter(path, PictureFormat(**fields)) as writer:  # type: ignore[arg-type]
        for top in range(0, height, 7):
            writer.write(planes[:, top : top + 7])


def picture(height: int, width: int) -> FloatArray:
    return np.random.default_rng(0).normal(0.5, 0.5, (3, height, width)).astype(np.float32)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 300), (300, 1), (37, 53)])
@pytest.mark.parametrize("tone", ["srgb", "linear"])
def test_codes_come_back(tmp_path: Path, height: int, width: int, tone: str) -> None:
    planes = picture(height, width)
    write(tmp_path / "a.tif", planes, tone=tone)
    found = tifffile.imread(tmp_path / "a.tif").reshape(height, width, 3)
    assert found.dtype == np.uint16
    np.testing.assert_array_equal(found.transpose(2, 0, 1), encode_uint16(planes, tone=tone))  # type: ignore[arg-type]


@pytest.mark.parametrize("tone", ["srgb", "linear"])
def test_profile_of_the_tone_is_embedded(tmp_path: Path, tone: str) -> None:
    write(tmp_path / "a.tif", picture(3, 4), tone=tone)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        tags = file.pages[0].tags  # type: ignore[union-attr]
        assert tags["InterColorProfile"].value == icc_profile(STAGE, tone=tone)
        assert tags["PhotometricInterpretation"].value == 2


def test_picture_is_turned(tmp_path: Path) -> None:
    planes = picture(10, 20)
    write(tmp_path / "a.tif", planes, orientation=8)
    found = tifffile.imread(tmp_path / "a.tif").transpose(2, 0, 1)
    np.testing.assert_array_equal(found, np.rot90(encode_uint16(planes, tone="srgb"), axes=(1, 2)))


def test_error_releases_the_file(tmp_path: Path) -> None:
    facts = PictureFormat(width=4, height=4, color=STAGE)
    with pytest.raises(ContractError), TiffWriter(tmp_path / "a.tif", facts) as writer:
        writer.write(np.full((3, 2, 4), np.nan, np.float32))
