"""The page of pairs."""

from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.display.pairs import Pair, Pairs
from camkit.calibration.display.primaries import fit_primaries
from camkit.calibration.display.targets import COLOURS, Target
from camkit.report.pages.calibration.pairs_page import pairs_html

LIGHT = np.array(list(COLOURS.values())) / 255


@pytest.mark.parametrize("primaries", [None, fit_primaries(list(COLOURS), LIGHT, LIGHT)])
def test_every_pair_and_every_colour_is_in_a_table(primaries) -> None:
    pair = Pair(
        path=Path("shot.dng"),
        target=Target(file="1-sea.png", name="sea", kind="picture"),
        to_picture=np.eye(3),
        residual_px=0.0123,
        correlation=0.99,
        places_px=np.array([[10.0, 10.0], [50.0, 20.0]]),
        shifts_px=np.array([[0.01, 0.0], [0.0, -0.02]]),
        reference_px=(1, 2, 30, 20),
    )
    found = Pairs(
        pairs=(pair,),
        primaries=primaries,
        size=(80, 60),
        iso=100.0,
        white_balance=None,
        notes=("a note",),
    )
    page = pairs_html(found)
    assert page.count("<tr>") == 2 + (0 if primaries is None else 1 + 3 + len(COLOURS))
    assert page.count("<img") == 1
    for text in ("shot.dng", "0.012", "30x20", "A note.", "0.020 px"):
        assert text in page
