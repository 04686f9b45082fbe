from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.color import color_stage, encode_uint8
from camkit.runtime.output.icc import icc_profile
from camkit.runtime.output.jpeg import JpegWriter
from camkit.runtime.output.picture_writer import PictureFormat

STAGE = color_stage(None)


def write(path: Path, planes: FloatArray, **changes: object) -> None:
    _, height, width = planes.shape
    fields = {"width": width, "height": height, "color": STAGE} | changes
    with JpegWriter(path, PictureFormat(**fields)) as writer:  # type: ignore[arg-type]
        for top in range(0, height, 7):
            writer.write(planes[:, top : top + 7])


def picture(height: int = 40, width: int = 60) -> FloatArray:
    """Give smooth colours, as JPEG is made for."""
    y, x = np.mgrid[:height, :width] / max(height, width)
    return np.stack([x, y, 1 - x]).astype(np.float32)


@pytest.mark.parametrize("orientation", [1, 6])
def test_codes_come_back_nearly_and_stand_upright(tmp_path: Path, orientation: int) -> None:
    write(tmp_path / "a.jpg", picture(), orientation=orientation, jpeg_quality=100)
    with Image.open(tmp_path / "a.jpg") as image:
        found = np.asarray(image).transpose(2, 0, 1).astype(int)
        assert image.info["icc_profile"] == icc_profile(STAGE, tone="srgb")
    wanted = encode_uint8(picture(), tone="srgb")
    wanted = np.rot90(wanted, -1, axes=(1, 2)) if orientation == 6 else wanted
    assert np.abs(found - wanted).max() <= 4


def test_colour_keeps_its_resolution(tmp_path: Path) -> None:
    stripes = np.zeros((3, 16, 16), np.float32)
    stripes[0, :, ::2] = stripes[2, :, 1::2] = 1.0
    write(tmp_path / "a.jpg", stripes, jpeg_quality=100)
    with Image.open(tmp_path / "a.jpg") as image:
        found = np.asarray(image)
    assert (found[:, ::2, 0] > 200).all()
    assert (found[:, 1::2, 0] < 50).all()


def test_quality_sets_the_size(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).random((3, 64, 64), dtype=np.float32)
    sizes = []
    for quality in (20, 92, 100):
        write(tmp_path / "a.jpg", noise, jpeg_quality=quality)
        sizes.append((tmp_path / "a.jpg").stat().st_size)
    assert sizes == sorted(set(sizes))


def test_a_picture_that_no_jpeg_can_hold_is_refused_before_any_row(tmp_path: Path) -> None:
    facts = PictureFormat(width=70_000, height=2, color=STAGE)
    with pytest.raises(ContractError, match="65500 px; got 70000x2; choose"):
        JpegWriter(tmp_path / "a.jpg", facts)


def test_an_error_leaves_no_file(tmp_path: Path) -> None:
    facts = PictureFormat(width=4, height=4, color=STAGE)
    with pytest.raises(ContractError), JpegWriter(tmp_path / "a.jpg", facts) as writer:
        writer.write(np.full((3, 2, 4), np.nan, np.float32))
    assert list(tmp_path.iterdir()) == []
