import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.colorimetry import (
    ACES_WHITE,
    D65,
    REC709_PRIMARIES,
    camera_from_rec709,
    encode_srgb,
    rec709_to_acescg,
)
from camkit.errors import ContractError
from camkit.runtime.color import (
    color_stage,
    encode_uint16,
    recover_highlights,
    to_output,
    to_rec709,
)
from tests.camera_factory import COLOR_MATRIX

MATRIX = np.array(COLOR_MATRIX)
GAINS = (2.0, 1.0, 1.5)


def pixels(*rgb: tuple[float, float, float]) -> np.ndarray:
    return np.array(rgb, dtype=np.float32).T.reshape(3, 1, -1)


def test_camera_picture_of_rec709_colours_comes_back() -> None:
    scene = np.random.default_rng(0).random((3, 5, 7), dtype=np.float32)
    camera = np.tensordot(camera_from_rec709(MATRIX)[0], scene, 1).astype(np.float32)
    np.testing.assert_allclose(to_output(camera, color_stage(MATRIX)), scene, atol=1e-5)


def test_acescg_is_rec709_in_other_primaries() -> None:
    band = np.random.default_rng(0).random((3, 5, 7), dtype=np.float32)
    stage = color_stage(None, "acescg")
    expected = np.tensordot(rec709_to_acescg(), band, 1)
    np.testing.assert_allclose(to_output(band, stage), expected, atol=1e-5)
    assert stage.white == ACES_WHITE


@pytest.mark.parametrize("output", ["rec709", "acescg", "camera"])
def test_grey_stays_grey_in_every_space(output: str) -> None:
    grey = np.full((3, 1, 1), 0.18, dtype=np.float32)
    np.testing.assert_allclose(to_output(grey, color_stage(MATRIX, output)), 0.18, atol=1e-6)


@pytest.mark.parametrize("output", ["rec709", "acescg", "camera"])
def test_every_space_states_the_way_back_to_rec709(output: str) -> None:
    stage = color_stage(MATRIX, output)
    expected = np.linalg.inv(camera_from_rec709(MATRIX)[0])
    np.testing.assert_allclose(to_rec709(stage) @ stage.matrix, expected, atol=1e-9)


def test_camera_space_is_left_alone_and_names_its_primaries() -> None:
    stage = color_stage(None, "camera")
    np.testing.assert_array_equal(stage.matrix, np.eye(3))
    np.testing.assert_allclose(stage.primaries, REC709_PRIMARIES, atol=1e-9)
    assert stage.white == D65


def test_exposure_is_a_power_of_two() -> None:
    stage = color_stage(None, exposure_ev=1.5)
    np.testing.assert_allclose(stage.matrix, np.eye(3) * 2**1.5)


def test_negatives_and_highlights_pass_the_matrix() -> None:
    band = pixels((-0.1, 5.0, 100.0))
    np.testing.assert_allclose(to_output(band, color_stage(None)), band)


def test_unknown_space_is_refused() -> None:
    with pytest.raises(ContractError, match="colour must be"):
        color_stage(None, "prophoto")  # type: ignore[arg-type]


@given(st.floats(0, 10))
def test_overexposed_grey_stays_grey(level: float) -> None:
    recorded = pixels(tuple(min(level, gain) for gain in GAINS))
    found = recover_highlights(recorded, GAINS)[:, 0, 0]
    assert np.ptp(found) < 1e-5
    assert found[0] == pytest.approx(min(level, max(GAINS)), rel=1e-5)


@given(st.tuples(st.floats(0, 3), st.floats(0, 3), st.floats(0, 3)))
def test_highlights_are_never_lowered(rgb: tuple[float, float, float]) -> None:
    band = pixels(rgb)
    assert (recover_highlights(band, GAINS) >= band).all()


def test_clipped_white_is_not_magenta() -> None:
    found = recover_highlights(pixels(GAINS), GAINS)[:, 0, 0]
    assert found[1] >= 0.999 * max(found[0], found[2])


def test_saturated_lamp_keeps_its_colour() -> None:
    red = pixels((2.0, 0.4, 0.1))
    np.testing.assert_array_equal(recover_highlights(red, GAINS), red)


def test_unclipped_band_is_handed_on_untouched() -> None:
    band = np.random.default_rng(0).random((3, 4, 4), dtype=np.float32) * 0.8
    assert recover_highlights(band, GAINS) is band


def test_only_pixels_near_clipping_change() -> None:
    band = np.random.default_rng(0).random((3, 30, 30), dtype=np.float32)
    found = recover_highlights(band, (1.0, 1.0, 1.0))
    untouched = band.max(axis=0) <= 0.9
    np.testing.assert_array_equal(found[:, untouched], band[:, untouched])


def test_srgb_codes_follow_the_curve() -> None:
    x = np.linspace(-0.1, 1.2, 200_001, dtype=np.float32)[None, None]
    codes = encode_uint16(x, tone="srgb").astype(np.float64)
    assert np.abs(codes - encode_srgb(x).astype(np.float64) * 65535).max() <= 1.5


def test_linear_codes_are_rounded() -> None:
    x = np.array([[[-1.0, 0.0, 0.5, 1.0, 7.0]]], dtype=np.float32)
    np.testing.assert_array_equal(
        encode_uint16(x, tone="linear")[0, 0], [0, 0, 32768, 65535, 65535]
    )


def test_clipped_green_of_a_warm_light_leaves_no_pink() -> None:
    found = recover_highlights(pixels((1.6, 1.0, 0.9)), GAINS)[:, 0, 0]
    assert found[1] == pytest.approx((1.6 + 0.9) / 2)
    np.testing.assert_array_equal(found[[0, 2]], np.float32([1.6, 0.9]))
