"""White is what the data show where they contradict the file, and what the caller says."""

import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import Levels
from camkit.runtime.files.white_level import believable_white, check_said_white
from tests.runtime.files.test_doubts import photograph


def levels(white):
    return Levels(black=np.full((2, 2), 256, dtype=np.float32), white=white)


def test_levels_that_fit_stay_as_they_are():
    stated = levels(4095.0)
    assert believable_white(photograph(), stated, "RGGB", 12) == (stated, "")


@pytest.mark.parametrize(("bits", "white"), [(14, 16383), (12, 4095), (8, 4095), (0, 4095)])
def test_a_white_far_below_the_data_is_raised_to_what_their_bits_hold(bits, white):
    raised, note = believable_white(photograph(), levels(600.0), "RGGB", bits)
    assert raised.white == white
    assert f"stated white 600, which is damaged or of another scale: {white}" in note
    assert "MosaicOptions.white_level" in note


def test_planes_beyond_the_bits_of_their_file_were_spread_over_16():
    planes = np.stack([photograph()[::2, ::2]] * 3)
    flat = Levels(black=np.zeros(3, np.float32), white=255.0)
    assert believable_white(planes, flat, None, 8)[0].white == 65535


def test_pure_noise_keeps_its_white_and_is_refused_later():
    noise = np.random.default_rng(0).integers(0, 16383, (128, 128)).astype(np.uint16)
    assert believable_white(noise, levels(1000.0), "RGGB", 14)[1] == ""


def test_a_white_of_the_caller_that_the_data_contradict_is_refused_by_name():
    check_said_white(photograph(), 4095.0)
    with pytest.raises(DecodeError, match=r"MosaicOptions.white_level=600 "):
        check_said_white(photograph(), 600.0)
