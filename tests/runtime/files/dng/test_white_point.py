"""White balance and colour matrix of a DNG follow the chapter on colour of its specification."""

import math

import numpy as np
import pytest

from camkit.colorimetry import D65, white_xyz
from camkit.runtime.files.dng.white_point import color_matrix, colour_temperature_k, neutral
from camkit.runtime.files.tiff_tags import TiffTags

IDENTITY = (1.0, 0, 0, 0, 1.0, 0, 0, 0, 1.0)
WARM = (0.9, -0.1, 0.0, -0.4, 1.2, 0.2, 0.0, 0.1, 0.6)
COLD = (0.7, -0.1, -0.1, -0.4, 1.3, 0.2, -0.1, 0.2, 0.6)
LIGHT_A, LIGHT_50 = (0.44758, 0.40745), (0.34567, 0.35850)


def tags_of(**values):
    directory = {int(name[1:]): value for name, value in values.items()}
    return TiffTags(directories=(directory,), file_bytes=1)


def square(values):
    return np.array(values, dtype=float).reshape(3, 3)


def test_the_matrix_nearest_to_daylight_is_taken():
    warm = tuple(2 * v for v in IDENTITY)
    tags = tags_of(t50721=warm, t50778=(17,), t50722=IDENTITY, t50779=(21,))
    matrix, note = color_matrix(tags)
    assert np.array_equal(matrix, np.eye(3))
    assert note is None
    matrix, note = color_matrix(tags_of(t50721=warm, t50778=(17,)))
    assert np.array_equal(matrix, 2 * np.eye(3))
    assert "light source 17" in note


def test_analog_balance_scales_the_rows_of_the_matrix():
    matrix, note = color_matrix(tags_of(t50721=IDENTITY, t50727=(2.0, 1.0, 3.0)))
    assert np.array_equal(np.diag(matrix), [2, 1, 3])
    assert "an unknown light source" in note


@pytest.mark.parametrize("values", [(1.0,) * 9, (math.nan,) * 9, (1.0,) * 8])
def test_a_matrix_that_cannot_be_is_none(values):
    assert color_matrix(tags_of(t50721=values)) is None


def test_calibration_of_the_camera_holds_where_its_signature_is_that_of_the_profile():
    own = (2.0, 0, 0, 0, 1.0, 0, 0, 0, 1.5)
    tags = {"t50721": WARM, "t50723": own, "t50778": (21,), "t50727": (1.0, 1.0, 4.0)}
    expected = np.diag((1, 1, 4)) @ square(own) @ square(WARM)
    assert np.allclose(color_matrix(tags_of(**tags))[0], expected)
    signed = {"t50931": b"com.a\0", "t50932": b"com.a\0"}
    assert np.allclose(color_matrix(tags_of(**tags, **signed))[0], expected)
    other = color_matrix(tags_of(**tags, t50931=b"com.a\0", t50932=b"com.b\0"))[0]
    assert np.allclose(other, np.diag((1, 1, 4)) @ square(WARM))


@pytest.mark.parametrize(
    ("light", "kelvin"),
    [(LIGHT_A, 2856), (LIGHT_50, 5003), (D65, 6504), ((0.29902, 0.31485), 7504)],
)
def test_colour_temperatures_of_standard_lights_are_those_of_their_tables(light, kelvin):
    assert colour_temperature_k(light) == pytest.approx(kelvin, rel=4e-3)


def test_a_white_point_gives_what_its_matrix_makes_of_it():
    grey = neutral(tags_of(t50721=WARM, t50778=(21,), t50729=LIGHT_50))
    assert grey == pytest.approx(square(WARM) @ white_xyz(LIGHT_50))
    assert neutral(tags_of(t50721=WARM, t50729=LIGHT_50)) == pytest.approx(grey)


@pytest.mark.parametrize("swapped", [False, True])
def test_matrices_of_two_lights_are_mixed_by_the_inverse_of_the_temperature(swapped):
    one, two = (COLD, WARM) if swapped else (WARM, COLD)
    lights = (21, 17) if swapped else (17, 21)
    tags = {"t50721": one, "t50722": two, "t50778": lights[:1], "t50779": lights[1:]}
    part = (1 / 2856 - 1 / 5003) / (1 / 2856 - 1 / 6504)
    mixed = (1 - part) * square(WARM) + part * square(COLD)
    grey = neutral(tags_of(**tags, t50729=LIGHT_50))
    assert grey == pytest.approx(mixed @ white_xyz(LIGHT_50), rel=2e-3)
    for light, matrix in (((0.5268, 0.4133), WARM), ((0.2807, 0.2884), COLD)):
        beyond = neutral(tags_of(**tags, t50729=light))
        assert beyond == pytest.approx(square(matrix) @ white_xyz(light))


def test_a_neutral_that_is_stated_comes_before_a_white_point():
    tags = tags_of(t50721=IDENTITY, t50728=(0.5, 1.0, 0.6), t50729=LIGHT_50)
    assert neutral(tags).tolist() == [0.5, 1.0, 0.6]


@pytest.mark.parametrize(
    "values",
    [{"t50729": (0.0, 0.3)}, {"t50729": (0.8, 0.4)}, {"t50729": (math.nan, 0.3)},
     {"t50729": (0.3,)}, {"t50728": (0.5, 0.0, 1.0)}, {"t50728": (1.0, 1.0)}, {}],
)  # fmt: skip
def test_a_balance_that_cannot_be_is_none(values):
    assert neutral(tags_of(t50721=IDENTITY, **values)) is None


def test_a_white_point_without_a_matrix_is_none():
    assert neutral(tags_of(t50729=LIGHT_50)) is None
