import io
from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image, ImageCms

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage, encode_uint16
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.png import PngWriter

STAGE = color_stage(None)


def write(path: Path, planes: FloatArray, bits: int = 16, **changes: object) -> None:
    _, height, width = planes.shape
    fields = {"width": width, "height": height, "color": STAGE} | changes
    with PngWriter(path, PictureFormat(**fields), bits=bits) as writer:  # type: ignore[arg-type]
        for top in range(0, height, 7):
            writer.write(planes[:, top : top + 7])


def picture(height: int, width: int) -> FloatArray:
    return np.random.default_rng(0).normal(0.5, 0.5, (3, height, width)).astype(np.float32)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (1, 300), (300, 1), (37, 53)])
@pytest.mark.parametrize("tone", ["srgb", "linear"])
def test_16_bit_codes_come_back(tmp_path: Path, height: int, width: int, tone: str) -> None:
    planes = picture(height, width)
    write(tmp_path / "a.png", planes, tone=tone)
    found = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    assert found is not None
    assert found.dtype == np.uint16
    codes = found[..., ::-1].transpose(2, 0, 1)
    np.testing.assert_array_equal(codes, encode_uint16(planes, tone=tone))  # type: ignore[arg-type]


def test_8_bit_codes_are_rounded(tmp_path: Path) -> None:
    planes = picture(20, 30)
    write(tmp_path / "a.png", planes, bits=8)
    found = np.asarray(Image.open(tmp_path / "a.png")).transpose(2, 0, 1)
    expected = encode_uint16(planes, tone="srgb") / 257
    assert np.abs(found - expected).max() <= 0.5


def test_profile_is_embedded_and_understood(tmp_path: Path) -> None:
    write(tmp_path / "a.png", picture(3, 4), bits=8)
    with Image.open(tmp_path / "a.png") as image:
        profile = ImageCms.ImageCmsProfile(io.BytesIO(image.info["icc_profile"]))
    assert "sRGB" in profile.profile.profile_description


def test_picture_is_turned(tmp_path: Path) -> None:
    planes = picture(10, 20)
    write(tmp_path / "a.png", planes, bits=8, orientation=3)
    found = np.asarray(Image.open(tmp_path / "a.png"))
    write(tmp_path / "b.png", planes, bits=8)
    upright = np.asarray(Image.open(tmp_path / "b.png"))
    np.testing.assert_array_equal(found, upright[::-1, ::-1])


def test_error_releases_the_file(tmp_path: Path) -> None:
    facts = PictureFormat(width=4, height=4, color=STAGE)
    with pytest.raises(ContractError), PngWriter(tmp_path / "a.png", facts) as writer:
        writer.write(np.full((3, 2, 4), np.nan, np.float32))
