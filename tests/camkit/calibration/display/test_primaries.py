"""The colours of a display come back from what a sensor sees of them."""

import numpy as np
import pytest

from camkit.calibration.display.primaries import fit_primaries
from camkit.calibration.display.targets import COLOURS as SHOWN
from camkit.errors import DecodeError
from tests.camkit.calibration.display.screen_factory import COLOURS, luminance

EXACT = 1e-9
LIGHT = luminance(np.array(list(SHOWN.values())))


def test_matrix_and_offset_of_a_clean_display_are_exact():
    found = fit_primaries(list(SHOWN), LIGHT, LIGHT @ COLOURS.T + 0.01)
    assert np.abs(found.matrix - COLOURS).max() < EXACT
    assert found.offset == pytest.approx([0.01] * 3, abs=EXACT)
    assert found.residual < EXACT


def test_a_display_whose_colours_do_not_add_shows_in_the_residual():
    seen = LIGHT @ COLOURS.T
    seen[-1] *= 0.9
    record = fit_primaries(list(SHOWN), LIGHT, seen).to_record()
    assert record["residual_percent"] > 1
    assert record["worst_percent"] >= record["residual_percent"]


def test_too_few_colours_or_black_ones_are_refused():
    with pytest.raises(DecodeError, match="3 colours do not tell"):
        fit_primaries(list(SHOWN)[:3], LIGHT[:3], LIGHT[:3])
    with pytest.raises(DecodeError, match="are black"):
        fit_primaries(list(SHOWN), LIGHT, np.zeros((7, 3)))
