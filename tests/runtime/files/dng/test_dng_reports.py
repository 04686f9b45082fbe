"""Files that people reported to other programs are read as their table says."""

import numpy as np
import pytest

from camkit.runtime.raw import read_capture
from tests.data_folder import data_path


def read(name):
    capture = read_capture(data_path("reports") / f"dng_{name}.dng", isolate=False)
    return capture, capture.linear_rows(0, capture.height)


def balanced(capture, light):
    """Return the means of R, G, B behind the white balance."""
    means = {c: light[dy::2, dx::2].mean() for (dy, dx), c in places(capture.cfa)}
    return np.array([means[c] for c in "RGB"]) * np.array(capture.white_balance)


def places(cfa):
    return [(divmod(n, 2), letter) for n, letter in enumerate(cfa)]


def test_a_white_point_gives_a_grey_scene_grey():
    capture, light = read("asshotwhitexy")
    grey = balanced(capture, light)
    assert grey / grey[1] == pytest.approx(1, abs=5e-3)
    assert capture.notes == ()


def test_a_gain_map_takes_the_shading_of_a_lens_away():
    capture, light = read("gainmap")
    _, even = read("asshotwhitexy")
    assert np.abs(light - even).max() < 0.02
    assert np.sqrt(np.mean((light - even) ** 2)) < 2e-3
    assert any("GainMap of OpcodeList2 applied" in note for note in capture.notes)
    assert not any("damage" in note for note in capture.notes)


def test_black_of_each_row_is_its_own():
    capture, light = read("blackleveldelta_v")
    _, even = read("asshotwhitexy")
    assert np.sqrt(np.mean((light - even) ** 2)) < 1.5e-3
    rows = (light - even).mean(axis=1)
    assert np.abs(rows).max() < 1e-3
    assert capture.notes == ()


def test_measured_black_takes_the_place_of_the_stated_one():
    capture, _ = read("masked_areas")
    assert capture.black_level == pytest.approx(514.3, abs=0.6)
    assert any("measured in the masked areas" in note for note in capture.notes)


@pytest.mark.parametrize("name", ["odd_active_area", "odd_size", "checkerboard", "masked_areas"])
def test_sound_files_are_not_called_damaged(name):
    capture, _ = read(name)
    wrong = ("header is damaged", "pixel data are damaged", "rows")
    assert not [note for note in capture.notes if any(word in note for word in wrong)]


def test_brightness_of_float_samples_does_not_hang_on_the_brightest():
    (_, dim), (many, bright) = read("float_peak_1"), read("float_peak_16")
    lamps = bright > 1
    assert np.count_nonzero(lamps) == 16
    assert np.array_equal(dim[~lamps], bright[~lamps])
    assert dim[~lamps].mean() == pytest.approx(0.305, abs=0.01)
    assert any("16 samples lie above white 1" in note for note in many.notes)


def test_deflated_floats_are_read_with_and_without_a_predictor():
    (plain, one), (predicted, two) = read("float_deflate"), read("float_deflate_predictor3")
    assert np.array_equal(one, two)
    tifffile = pytest.importorskip("tifffile")
    stored = tifffile.imread(data_path("reports/dng_float_deflate.dng"))
    assert np.array_equal(plain.samples, stored.astype(np.float32))
    assert not any("damage" in note for note in (*plain.notes, *predicted.notes))
