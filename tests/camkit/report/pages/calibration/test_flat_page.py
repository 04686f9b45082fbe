"""The page of a lens's vignetting."""

import numpy as np
import pytest

from camkit.calibration.flat.illumination_fit import FlatFacts
from camkit.calibration.flat.pose import Pose
from camkit.report.pages.calibration.flat_page import draw_maps, draw_profile, flat_html


def _facts(count: int, *, separated: bool) -> FlatFacts:
    maps = np.random.default_rng(0).uniform(0.9, 1.0, (count, 6, 9))
    return FlatFacts(
        files=tuple(f"<{n}>.dng" for n in range(count)),
        poses=(Pose(),) * count,
        heights_mm=np.linspace(0, 10, 17),
        relative_illumination=np.linspace(1, 0.5, 17),
        pixel_pitch_um=4.0,
        size_px=(200, 160),
        centre_px=(100.0, 80.0),
        centre_found=separated,
        separated=separated,
        display=0.1,
        display_maps=maps,
        rest_maps=maps - 0.95,
        notes=() if separated else ("a note",),
    )


@pytest.mark.parametrize("separated", [True, False])
def test_the_page_says_whether_lens_and_display_were_told_apart(separated: bool) -> None:
    page = flat_html(_facts(3, separated=separated))
    assert ("NOT told apart" in page) != separated
    assert "&lt;2&gt;.dng" in page
    assert page.count("<img") == 2


@pytest.mark.parametrize(("count", "shown"), [(1, 1), (8, 8), (11, 8)])
def test_at_most_eight_pictures_are_drawn(count: int, shown: int) -> None:
    panels = [axes for axes in draw_maps(_facts(count, separated=True)).axes if axes.images]
    assert len(panels) == 2 * shown


def test_the_profile_begins_at_one() -> None:
    (panel,) = draw_profile(_facts(1, separated=False)).axes
    (line,) = panel.get_lines()
    assert line.get_ydata()[0] == 1
    assert line.get_linestyle() == "--"
