"""The page of a display's tone curve."""

import numpy as np
import pytest

from camkit.calibration.tone import PowerCurve, ToneFacts
from camkit.report.pages.calibration.tone_page import draw_tone, tone_html

LIGHT = np.array([0.0, 0.2, 0.5, 1.0])


CURVE = PowerCurve(black=0.01, gain=1.0, offset=0.0, gamma=2.0, top=255.0)


def _facts(curve: PowerCurve | None) -> ToneFacts:
    return ToneFacts(
        levels=np.array([0.0, 80.0, 160.0, 255.0]),
        luminance=LIGHT,
        curve=curve,
        is_lit=LIGHT > 0,
        notes=("a note",),
    )


@pytest.mark.parametrize("curve", [None, CURVE])
def test_every_step_is_in_the_table_with_or_without_a_curve(curve: PowerCurve | None) -> None:
    page = tone_html(_facts(curve))
    assert page.count("<tr>") == 5
    assert page.count("<img") == 1
    assert "A note." in page
    assert ("-0.99" in page) == (curve is not None)
    # the step without light was not fitted
    assert page.count("<td>-</td>") == (4 if curve is None else 1)
    assert "+0.00" not in page


def test_residuals_are_drawn_below_in_percent() -> None:
    below = draw_tone(_facts(CURVE)).axes[2]
    assert below.get_ylabel() == "off the curve, %"
    (marks,) = (line for line in below.get_lines() if line.get_marker() == "o")
    assert marks.get_ydata() == pytest.approx([np.nan, *(100 * (LIGHT[1:] / [0.108423, 0.403702, 1.01] - 1))], abs=0.01, nan_ok=True)  # noqa: E501 # fmt: skip
