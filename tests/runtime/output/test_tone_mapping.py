"""Previews show a picture of any range on a screen: small, upright, finite."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

from camkit.arrays import FloatArray
from camkit.runtime.color import OutputColor, color_stage, to_output
from camkit.runtime.output.preview_file import LONGEST_PREVIEW_PX, preview_path
from camkit.runtime.output.tone_mapping import ToneMappedPreview, tone_mapped


def _night() -> FloatArray:
    """Return (3, h, w) light over twenty stops, rising to the right."""
    x = np.linspace(-14, 6, 96, dtype=np.float32)
    return np.broadcast_to(2.0**x, (3, 64, 96)).astype(np.float32)


def _shown(path: Path, light: FloatArray, color: OutputColor = "rec709", turned: int = 1):
    preview = ToneMappedPreview(*light.shape[1:])
    for top in range(0, light.shape[1], 24):
        preview.add(light[:, top : top + 24])
    preview.write(path, color_stage(None, color), turned)
    with Image.open(path) as picture:
        assert picture.format == "JPEG"
        return np.asarray(picture).astype(int)


def test_twenty_stops_fit_a_screen(tmp_path: Path) -> None:
    seen = _shown(tmp_path / "a.jpg", _night())[32, :, 1]
    assert (np.diff(seen) >= -2).all()
    assert seen[0] < 20
    assert seen[-1] > 235
    assert np.count_nonzero((seen > 12) & (seen < 243)) > 40, "stops in between are told apart"


def test_the_operator_is_that_of_opencv() -> None:
    light = _night()
    light[0] *= 0.5  # the least sample is of one colour alone, which OpenCV bears
    drago = cv2.createTonemapDrago(gamma=1.0, saturation=1.0, bias=0.85)
    expected = drago.process(np.ascontiguousarray(light.transpose(1, 2, 0)))
    np.testing.assert_allclose(tone_mapped(light), expected.transpose(2, 0, 1), atol=0.02)


def test_a_grey_picture_is_as_bright_as_one_that_is_nearly_grey() -> None:
    grey, near = _night(), _night()
    near[0] *= 0.999
    assert np.isfinite(tone_mapped(grey)).all()
    np.testing.assert_allclose(tone_mapped(grey), tone_mapped(near), atol=0.01)


@pytest.mark.parametrize("color", ["rec709", "acescg"])
def test_colours_are_those_of_a_screen_whatever_the_space_of_the_picture(
    tmp_path: Path, color: OutputColor
) -> None:
    light = np.concatenate([_night()[:1], _night()[1:2] * 0.5, _night()[2:] * 0.25])
    given = to_output(light, color_stage(None, color))
    plain = _shown(tmp_path / "plain.jpg", light)
    assert np.abs(_shown(tmp_path / "a.jpg", given, color) - plain).max() <= 3


@pytest.mark.parametrize(("turned", "size"), [(1, (64, 96)), (6, (96, 64)), (8, (96, 64))])
def test_previews_are_upright(tmp_path: Path, turned: int, size: tuple[int, int]) -> None:
    assert _shown(tmp_path / "a.jpg", _night(), turned=turned).shape[:2] == size


@pytest.mark.parametrize("value", [0.0, 1.0, np.nan, np.inf, -1.0, 1e30])
def test_odd_pictures_have_previews(tmp_path: Path, value: float) -> None:
    light = _night()
    light[:, 5:9, 5:9] = value
    assert _shown(tmp_path / "some.jpg", light).shape == (64, 96, 3)
    assert _shown(tmp_path / "all.jpg", np.full_like(light, value)).shape == (64, 96, 3)


def test_large_pictures_have_small_previews(tmp_path: Path) -> None:
    light = np.full((3, 40, 2 * LONGEST_PREVIEW_PX + 7), 0.5, dtype=np.float32)
    assert max(_shown(tmp_path / "a.jpg", light).shape) <= LONGEST_PREVIEW_PX


def test_a_preview_is_named_after_its_picture() -> None:
    assert preview_path(Path("x/a.b.exr")) == Path("x/a.b.preview.jpg")
