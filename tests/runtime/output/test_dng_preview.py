import io

import numpy as np
import pytest
import rawpy
from PIL import Image

from camkit.runtime.output.dng import write_bayer_dng
from camkit.runtime.output.dng_preview import LONGEST_SIDE_PX, Averages, preview_jpeg
from tests.camera_factory import COLOR_MATRIX
from tests.dng_factory import dng_tags


@pytest.mark.parametrize("rows", [1, 5, 64, 400])
def test_averages_do_not_depend_on_the_bands(rows: int) -> None:
    planes = np.random.default_rng(0).random((3, 131, 2 * LONGEST_SIDE_PX + 5), dtype=np.float32)
    averages = Averages(*planes.shape[1:])
    for top in range(0, planes.shape[1], rows):
        averages.add(planes[:, top : top + rows])
    step = 3
    height, width = 131 // step, planes.shape[2] // step
    blocks = planes[:, : height * step, : width * step].reshape(3, height, step, width, step)
    np.testing.assert_allclose(averages.planes(), blocks.mean(axis=(2, 4)), atol=1e-5)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (9, 1), (3, 2)])
def test_small_pictures_have_a_preview(shape: tuple[int, int]) -> None:
    averages = Averages(*shape, least_step=2)
    averages.add(np.ones((3, *shape), np.float32))
    assert averages.planes().min() == averages.planes().max() == 1


def test_burnt_out_light_is_white() -> None:
    """All channels of the sensor clip at once, whatever their gains and their matrix."""
    full = np.ones((3, 16, 16), np.float32)
    coded = preview_jpeg(full, (2.0, 1.0, 1.6), np.array(COLOR_MATRIX))
    with Image.open(io.BytesIO(coded)) as image:
        assert np.asarray(image).min() >= 254


def test_libraw_gives_out_the_preview_and_the_samples(tmp_path) -> None:
    """Grey that brightens to the right, in every CFA the same."""
    ramp = np.linspace(0, 1, 100).repeat(2)[None].repeat(100, axis=0)
    for cfa in ("RGGB", "GBRG"):
        neutral = np.array([0.5, 1.0, 0.625])
        letters = np.array(["RGB".index(c) for c in cfa]).reshape(2, 2)
        mosaic = (256 + 3839 * 0.9 * ramp * neutral[np.tile(letters, (50, 100))]).astype(np.uint16)
        write_bayer_dng(tmp_path / "x.dng", mosaic, tags=dng_tags(cfa=cfa))
        with rawpy.imread(str(tmp_path / "x.dng")) as raw:
            assert np.array_equal(raw.raw_image_visible, mosaic)
            preview = raw.extract_thumb()
        assert preview.format == rawpy.ThumbFormat.JPEG
        with Image.open(io.BytesIO(preview.data)) as image:
            found = np.asarray(image).astype(float)
        assert found.shape == (50, 100, 3)
        assert np.ptp(found, axis=2).max() <= 6, "grey"
        linear = 0.9 * ramp[0, ::2]
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        np.testing.assert_allclose(found[25, :, 1], 255 * srgb, atol=4)
