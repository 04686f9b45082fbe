"""Two halves of a dual pixel become the picture that the whole pixel would have taken."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError, DecodeError
from camkit.noise import NoiseModel
from camkit.runtime.signal.halves import (
    mean_of_halves,
    read_halves,
    right_half,
    without_right_halves,
)
from tests.job_factory import made_mosaic, made_planes

NAMES = ("a_l.png", "a_r.png")


def test_the_mean_is_that_of_light():
    rng = np.random.default_rng(0)
    left, right = (rng.random((3, 8, 10), dtype=np.float32) for _ in range(2))
    mean = mean_of_halves(made_planes(samples=left), made_planes(samples=right), NAMES)
    np.testing.assert_allclose(mean.linear_rows(0, 8), (left + right) / 2, rtol=1e-6)
    assert mean.notes[-1] == "mean of a_l.png and a_r.png"


def test_whole_numbers_stay_whole_and_do_not_overflow():
    left, right = np.full((3, 4, 4), 60_001, np.uint16), np.full((3, 4, 4), 60_004, np.uint16)
    pair = [made_planes(samples=s, white_level=65_535.0) for s in (left, right)]
    mean = mean_of_halves(*pair, NAMES)
    assert mean.samples.dtype == np.uint16
    assert (mean.samples == 60_003).all()


def test_what_is_clipped_in_one_half_counts_as_clipped():
    left = np.full((3, 4, 4), 20_000, np.uint16)
    right = left.copy()
    right[1, 2, 3] = 65_535
    pair = [made_planes(samples=s, white_level=65_535.0) for s in (left, right)]
    clipped = mean_of_halves(*pair, NAMES).saturated_rows(0, 4)
    assert clipped[1, 2, 3]
    assert clipped.sum() == 1


def test_a_mosaic_may_come_in_halves_and_noise_halves():
    noise = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-6,) * 3)
    one = made_mosaic(noise=noise)
    mean = mean_of_halves(one, one, NAMES)
    np.testing.assert_array_equal(mean.samples, one.samples)
    assert mean.noise == NoiseModel(shot=(5e-5,) * 3, read_variance=(5e-7,) * 3)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"samples": np.zeros((3, 4, 6), np.float32)}, "size differs, 4x4 px and 6x4 px"),
        ({"samples": np.zeros((3, 4, 4), np.uint16)}, "samples differs"),
        ({"iso": 200.0}, "ISO differs, 100.0 and 200.0"),
        ({"exposure_time_s": 0.5}, "exposure time differs"),
        ({"orientation": 6}, "orientation differs"),
        ({"white_level": 2.0}, "white level differs"),
    ],
)
def test_other_exposures_are_no_halves(change, text):
    left = made_planes(samples=np.zeros((3, 4, 4), np.float32), iso=100.0)
    with pytest.raises(DecodeError, match=f"no halves of one exposure: their {text}"):
        mean_of_halves(left, replace(left, **change), NAMES)


def test_the_right_half_is_found_by_what_differs_last():
    assert right_half(Path("in/a_l.png"), ("_l", "_r")) == Path("in/a_r.png")
    assert right_half(Path("in/left/a.png"), ("left", "right")) == Path("in/right/a.png")
    assert right_half(Path("_l/b_l_l.tif"), ("_l", "_r")) == Path("_l/b_l_r.tif")
    assert right_half(Path("x/a.left"), ("x", "y")) == Path("y/a.left"), "never the suffix"
    with pytest.raises(ContractError, match=r"a\.png is no left half: halves states that '_l'"):
        right_half(Path("a.png"), ("_l", "_r"))


def test_a_folder_of_both_halves_is_a_list_of_left_ones():
    files = [Path(f"{n}_{side}.png") for n in "ab" for side in "lr"] + [Path("c.png")]
    left = without_right_halves(files, ("_l", "_r"))
    assert [path.name for path in left] == ["a_l.png", "b_l.png", "c.png"]
    assert without_right_halves(files, None) == files


@pytest.mark.parametrize("text", ["", "_l", "_l,", ",_r", "_l,_l", "a,b,c"])
def test_what_does_not_tell_two_files_apart_is_refused(text):
    with pytest.raises(ContractError, match="halves takes two texts that differ"):
        read_halves(text)
    assert read_halves("_l,_r") == ("_l", "_r")
