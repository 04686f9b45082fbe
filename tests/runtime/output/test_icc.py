import io

import numpy as np
import pytest
from PIL import Image, ImageCms

from camkit.colorimetry import D65, adapt_white, rgb_to_xyz
from camkit.runtime.color import color_stage
from camkit.runtime.output.icc import PCS_WHITE, icc_profile
from tests.camera_factory import COLOR_MATRIX

FIXED_POINT = 2e-5


def parse(profile: bytes) -> ImageCms.core.CmsProfile:
    return ImageCms.ImageCmsProfile(io.BytesIO(profile)).profile


@pytest.mark.parametrize("output", ["rec709", "acescg", "camera"])
@pytest.mark.parametrize("tone", ["srgb", "linear"])
def test_profile_is_read_by_littlecms(output: str, tone: str) -> None:
    stage = color_stage(np.array(COLOR_MATRIX), output)  # type: ignore[arg-type]
    profile = icc_profile(stage, tone=tone)
    parsed = parse(profile)
    assert int.from_bytes(profile[:4], "big") == len(profile)
    assert parsed.version == 4.3
    assert parsed.is_matrix_shaper
    columns = np.stack(
        [parsed.red_colorant[0], parsed.green_colorant[0], parsed.blue_colorant[0]], 1
    )
    expected = adapt_white(stage.white, PCS_WHITE) @ rgb_to_xyz(stage.primaries, stage.white)
    np.testing.assert_allclose(columns, expected, atol=FIXED_POINT)
    np.testing.assert_allclose(columns.sum(axis=1), (0.9642, 1.0, 0.8249), atol=1e-4)


def test_title_names_space_and_tone() -> None:
    assert "linear" in parse(icc_profile(color_stage(None), tone="linear")).profile_description
    assert "sRGB" in parse(icc_profile(color_stage(None), tone="srgb")).profile_description
    assert (
        "ACEScg"
        in parse(icc_profile(color_stage(None, "acescg"), tone="linear")).profile_description
    )


def test_srgb_profile_changes_no_srgb_picture() -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (32, 32, 3), dtype=np.uint8)
    ours = ImageCms.ImageCmsProfile(io.BytesIO(icc_profile(color_stage(None), tone="srgb")))
    shown = ImageCms.profileToProfile(Image.fromarray(pixels), ours, ImageCms.createProfile("sRGB"))
    assert shown is not None
    difference = np.abs(np.asarray(shown).astype(int) - pixels)
    assert difference.max() <= 1


def test_linear_profile_shows_linear_values_as_srgb() -> None:
    grey = Image.fromarray(np.full((2, 2, 3), 55, np.uint8))
    linear = ImageCms.ImageCmsProfile(io.BytesIO(icc_profile(color_stage(None), tone="linear")))
    shown = ImageCms.profileToProfile(grey, linear, ImageCms.createProfile("sRGB"))
    assert shown is not None
    expected = 255 * (1.055 * (55 / 255) ** (1 / 2.4) - 0.055)
    assert np.abs(np.asarray(shown) - expected).max() <= 1


def test_white_point_of_srgb_is_adapted() -> None:
    parsed = parse(icc_profile(color_stage(None), tone="srgb"))
    found = np.array(parsed.chromatic_adaptation[0])
    np.testing.assert_allclose(found, adapt_white(D65, PCS_WHITE), atol=FIXED_POINT)
