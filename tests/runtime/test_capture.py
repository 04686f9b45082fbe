import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.cfa import CFA_PATTERNS
from camkit.errors import ContractError
from camkit.runtime.capture import Capture, MosaicOptions

BLACK = np.array([[100, 110], [120, 130]], dtype=np.float32)


def mosaic_capture(samples, black=BLACK, white=1000.0, **more):
    return Capture(samples=samples, cfa="RGGB", black_level=black, white_level=white, **more)


def test_black_is_zero_and_white_is_one_at_every_position_of_the_cell():
    black = np.tile(BLACK, (2, 3)).astype(np.uint16)
    assert np.array_equal(mosaic_capture(black).linear_rows(0, 4), np.zeros((4, 6)))
    white = np.full((4, 6), 1000, dtype=np.uint16)
    assert np.allclose(mosaic_capture(white).linear_rows(0, 4), 1, atol=1e-6)


def test_values_below_black_stay_negative():
    rows = mosaic_capture(np.zeros((2, 2), dtype=np.uint16)).linear_rows(0, 2)
    assert (rows < 0).all()
    assert rows[0, 0] == pytest.approx(-100 / 900)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 9), st.integers(0, 9), st.integers(0, 2**32 - 1))
def test_a_band_of_rows_equals_the_same_rows_of_the_whole(first, count, seed):
    samples = np.random.default_rng(seed).integers(0, 1100, (10, 7)).astype(np.uint16)
    capture = mosaic_capture(samples)
    last = min(first + count, 10)
    assert np.array_equal(capture.linear_rows(first, last), capture.linear_rows(0, 10)[first:last])
    assert np.array_equal(
        capture.saturated_rows(first, last), capture.saturated_rows(0, 10)[first:last]
    )


def test_saturation_begins_one_percent_below_white():
    samples = np.array([[990, 991], [992, 992]], dtype=np.uint16)
    capture = mosaic_capture(samples)  # limits 991, 991.1, 991.2, 991.3
    assert capture.saturated_rows(0, 2).tolist() == [[False, False], [True, True]]


def test_planes_are_linear_rgb_with_one_black_per_colour():
    samples = np.full((3, 2, 2), 500, dtype=np.uint16)
    capture = Capture(
        samples=samples,
        cfa=None,
        black_level=np.array([0, 100, 200], dtype=np.float32),
        white_level=1000.0,
    )
    assert capture.contract == "linear_rgb_v1"
    assert capture.linear_rows(0, 1)[:, 0, 0] == pytest.approx([0.5, 400 / 900, 300 / 800])
    assert not capture.saturated_rows(0, 2).any()


def test_float_pictures_never_saturate():
    capture = Capture(
        samples=np.full((3, 1, 1), 50, dtype=np.float32),
        cfa=None,
        black_level=np.zeros(3, dtype=np.float32),
        white_level=1.0,
    )
    assert not capture.saturated_rows(0, 1).any()
    assert capture.linear_rows(0, 1).max() == 50


@pytest.mark.parametrize(
    "change",
    [
        {"samples": np.zeros((2, 2), dtype=np.int32)},
        {"samples": np.zeros((3, 2, 2), dtype=np.uint16)},
        {"samples": np.zeros((0, 2), dtype=np.uint16)},
        {"cfa": "RGBG"},
        {"cfa": None},
        {"black_level": np.zeros(3, dtype=np.float32)},
        {"black_level": np.zeros((2, 2))},
        {"white_level": 130.0},
        {"white_level": float("nan")},
        {"white_balance": (2.0, 1.1, 1.0)},
        {"white_balance": (0.0, 1.0, 1.0)},
        {"color_matrix": np.full((3, 3), np.nan)},
        {"orientation": 9},
    ],
)
def test_a_capture_that_contradicts_itself_is_refused(change):
    good = {
        "samples": np.zeros((2, 2), dtype=np.uint16),
        "cfa": "RGGB",
        "black_level": BLACK,
        "white_level": 1000.0,
    }
    with pytest.raises(ContractError):
        Capture(**(good | change))


def test_rows_outside_the_picture_are_refused():
    capture = mosaic_capture(np.zeros((4, 4), dtype=np.uint16))
    with pytest.raises(ContractError, match=r"0\.\.4"):
        capture.linear_rows(2, 5)


@pytest.mark.parametrize(
    ("cfa", "black", "white"), [("RGB", 0, 1), ("RGGB", 5, 5), ("RGGB", -1, 5)]
)
def test_mosaic_options_that_cannot_be_are_refused(cfa, black, white):
    with pytest.raises(ContractError):
        MosaicOptions(cfa=cfa, black_level=black, white_level=white)


def test_all_patterns_are_taken():
    for cfa in CFA_PATTERNS:
        assert MosaicOptions(cfa=cfa, black_level=0, white_level=1).cfa == cfa


def test_levels_that_cannot_be_are_named_as_they_were_given() -> None:
    with pytest.raises(ContractError, match=r"black < white; got white nan$"):
        MosaicOptions(white_level=float("nan"))
