"""Colours of the output are raised there and turned back, bright ones untouched; luma."""

import numpy as np

from camkit.colorimetry import OutputColours, luma

TURN = np.array([[1.8, -0.6, -0.2], [-0.3, 1.6, -0.3], [0.1, -0.7, 1.6]])
LIGHT = np.random.default_rng(0).uniform(0, 4, (3, 50)).astype(np.float32)


def test_raised_light_has_the_least_in_the_output_and_nothing_else_changes() -> None:
    colours = OutputColours(TURN)
    seen = colours.of(LIGHT)
    np.testing.assert_allclose(seen, TURN @ LIGHT, rtol=1e-4, atol=1e-5)
    raised = colours.raised(LIGHT, np.full(50, 0.5, np.float32))
    short = (seen < 0.5).any(axis=0)
    assert 0 < short.sum() < 50
    np.testing.assert_array_equal(raised[:, ~short], LIGHT[:, ~short])
    np.testing.assert_allclose(TURN @ raised, np.maximum(seen, 0.5), atol=1e-5)


def test_the_bits_of_a_colour_do_not_depend_on_how_many_are_turned() -> None:
    colours, least = OutputColours(TURN), np.ones((3, 50), np.float32)
    whole = colours.raised(LIGHT, least)
    for n in range(50):
        part = np.s_[:, n : n + 1]
        np.testing.assert_array_equal(colours.raised(LIGHT[part], least[part]), whole[part])


def test_luma_is_that_of_coded_values_at_full_range() -> None:
    coded = np.eye(3, dtype=np.float32).reshape(3, 1, 3)
    np.testing.assert_allclose(luma(coded), [[0.299, 0.587, 0.114]])
    np.testing.assert_allclose(luma(np.ones((3, 2, 2), np.float32)), np.ones((2, 2)))
