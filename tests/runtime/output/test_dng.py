import json

import numpy as np
import pytest
import rawpy
import tifffile

from camkit.errors import ContractError
from camkit.runtime.output.dng import camkit_description, open_linear_dng, write_bayer_dng
from tests.dng_factory import MATRIX, dng_tags, scene_mosaic


def test_rawpy_opens_the_mosaic_bit_for_bit(tmp_path):
    mosaic = np.random.default_rng(0).integers(0, 65536, (61, 83)).astype(np.uint16)
    tags = dng_tags(cfa="BGGR", black=np.array([[1, 2], [3, 4]]), white=65535)
    write_bayer_dng(tmp_path / "x.dng", mosaic, tags=tags)
    with rawpy.imread(str(tmp_path / "x.dng")) as raw:
        assert np.array_equal(raw.raw_image_visible, mosaic)
        assert raw.raw_colors_visible[:2, :2].tolist() == [[2, 3], [1, 0]]
        assert raw.black_level_per_channel == [4, 3, 1, 2]
        assert raw.white_level == 65535
        assert raw.camera_whitebalance[:3] == pytest.approx([2.0, 1.0, 1.6])


def test_rawpy_opens_planes_bit_for_bit(tmp_path):
    planes = np.random.default_rng(0).integers(0, 65536, (3, 40, 50)).astype(np.uint16)
    file = open_linear_dng(tmp_path / "x.dng", (40, 50), dng_tags(cfa=None, black=7, white=65535))
    file.append(planes.transpose(1, 2, 0))
    file.finish(np.zeros((3, 20, 25), np.float32))
    with rawpy.imread(str(tmp_path / "x.dng")) as raw:
        assert np.array_equal(raw.raw_image_visible[..., :3], planes.transpose(1, 2, 0))
        assert raw.black_level_per_channel[:3] == [7, 7, 7]


def test_the_tags_say_what_dng_readers_need(tmp_path):
    write_bayer_dng(tmp_path / "x.dng", scene_mosaic(), tags=dng_tags(orientation=6))
    with tifffile.TiffFile(tmp_path / "x.dng") as file:
        (page,) = file.pages
        value = {tag.code: tag.value for tag in page.tags}
        (sensor,) = page.pages
        inner = {tag.code: tag.value for tag in sensor.tags}
        assert np.array_equal(sensor.asarray(), scene_mosaic())
    assert (inner[254], inner[259], inner[262]) == (0, 1, 32803)
    assert (value[254], value[259], value[262]) == (1, 7, 6)
    assert value[274] == 6
    assert (value[271], value[272], value[50708]) == ("camkit", "duet", "camkit duet")
    assert bytes(value[50706]) == bytes((1, 4, 0, 0))
    assert value[50778] == 21
    assert value[34665]["ISOSpeedRatings"] == 400
    assert value[34665]["ExposureTime"] == (1, 50)
    matrix = np.array(value[50721], dtype=float).reshape(9, 2)
    assert np.allclose(matrix[:, 0] / matrix[:, 1], MATRIX.ravel(), atol=1e-6)
    assert inner[51041] == pytest.approx((1e-4, 1e-7, 2e-4, 2e-7, 3e-4, 3e-7))
    record = json.loads(value[270])["camkit"]
    assert record == {
        "bundle": "duet",
        "origin_px": [3, 4],
        "sensor_size_px": [6000, 4000],
        "pixel_pitch_um": 5.96,
    }


def test_the_same_input_gives_the_same_file(tmp_path):
    for name in ("a.dng", "b.dng"):
        write_bayer_dng(tmp_path / name, scene_mosaic(), tags=dng_tags())
    assert (tmp_path / "a.dng").read_bytes() == (tmp_path / "b.dng").read_bytes()


@pytest.mark.parametrize(
    "change",
    [
        {"cfa": "RGBG"},
        {"black": 4095},
        {"black": -1},
        {"black": 1.5},
        {"black": np.zeros(3, dtype=int)},
        {"white": 65536},
        {"cfa": None, "black": np.zeros((2, 2), dtype=int)},
        {"as_shot_neutral": (0.0, 1.0, 1.0)},
        {"as_shot_neutral": (np.nan, 1.0, 1.0)},
        {"orientation": 0},
        {"description": "Größe"},
    ],
)
def test_tags_that_cannot_be_written_are_refused(change):
    with pytest.raises(ContractError):
        dng_tags(**change)


def test_samples_of_the_wrong_kind_are_refused(tmp_path):
    path = tmp_path / "x.dng"
    with pytest.raises(ContractError, match="uint16"):
        write_bayer_dng(path, np.zeros((4, 4)), tags=dng_tags())
    with pytest.raises(ContractError, match=r"needs tags\.cfa"):
        write_bayer_dng(path, scene_mosaic(), tags=dng_tags(cfa=None))
    with pytest.raises(ContractError, match="no CFA"):
        open_linear_dng(path, (4, 4), dng_tags())
    with pytest.raises(ContractError, match="at most 4 GB"):
        open_linear_dng(path, (30000, 30000), dng_tags(cfa=None))
    assert not path.exists()


def test_the_description_is_plain_json():
    text = camkit_description(
        bundle="x", origin_px=(0, 0), sensor_size_px=(2, 2), pixel_pitch_um=1.0
    )
    assert json.loads(text)["camkit"]["bundle"] == "x"
