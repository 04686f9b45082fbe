"""Light is gathered about a peak where one stands out, else about the chief ray."""

import math
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.spot import chief_heights
from camkit.models_def.optics.thin.middle import CHIEF_RAY, PEAK, find_middles
from camkit.models_def.optics.thin.peak import land_light, peak_height_px
from tests.thin_factory import perfect_lens

PITCH_UM = 60.0
CORNER_PX = 350.0
RAYS = 2000


def test_a_plate_has_peaks_and_an_asphere_has_none_far_out() -> None:
    plate = find_middles(read_lens(Path("thin-plate")), CORNER_PX, PITCH_UM, RAYS)
    assert plate.middle == PEAK
    asphere = read_lens(Path("al2550-a"))
    assert find_middles(asphere, CORNER_PX, 5.0, RAYS).middle == PEAK  # 1.75 mm from the axis
    assert find_middles(asphere, 3600.0, 5.96, RAYS).middle == CHIEF_RAY
    # what was chosen for another distance holds
    for lens, about in ((read_lens(Path("thin-plate")), CHIEF_RAY), (asphere, PEAK)):
        told = find_middles(lens, 2000.0, 5.96, RAYS, about)
        assert told.middle == about
        assert told.heights_px(lens, np.array([told.corner_rad]), 5.96, RAYS)[0] == pytest.approx(
            2000.0, rel=0.01
        )


def test_middles_are_where_peaks_or_chief_rays_land() -> None:
    asphere = read_lens(Path("al2550-a"))
    found = find_middles(asphere, 3600.0, 5.96, RAYS)
    angles = np.array([0.0, found.corner_rad / 2, found.corner_rad])
    heights = found.heights_px(asphere, angles, 5.96, RAYS)
    assert heights[0] == 0
    assert heights[2] == pytest.approx(3600.0, abs=0.5)
    chief_mm = chief_heights(asphere, torch.tensor([math.tan(angles[1])], dtype=torch.float64))
    assert heights[1] * 5.96e-3 == pytest.approx(float(chief_mm[0]), abs=1e-6)
    lens = perfect_lens(40.0, 3.0, defocus_mm=6.4)
    peaks = find_middles(lens, 50.0, PITCH_UM, RAYS)
    corner = np.array([peaks.corner_rad])
    at = peak_height_px(land_light(lens, float(corner[0]), 0.55, PITCH_UM, RAYS))
    assert peaks.heights_px(lens, corner, PITCH_UM, RAYS)[0] == at


def test_a_corner_that_no_light_reaches_is_said() -> None:
    with pytest.raises(ContractError, match="reaches the corner"):
        find_middles(perfect_lens(40.0, 3.0, defocus_mm=6.4), 1e5, PITCH_UM, RAYS)
