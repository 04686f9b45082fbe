"""The drawing of a lens."""

import math

import pytest
import torch

from camkit.models_def.optics.tracing.frame import Pose, rotation
from camkit.report.pages.lens import layout


def test_tilted_element_is_drawn_tilted_and_shifted() -> None:
    """x of a tilt turns y towards z, about the front vertex."""
    tilt = torch.tensor([0.2, 0.0], dtype=torch.float64)
    pose = Pose(turn=rotation(tilt), offset_mm=torch.tensor([0.0, 0.5, 0.0], dtype=torch.float64))
    z, y = torch.tensor([10.0, 12.0]), torch.tensor([2.0, 0.0])
    turned_z, turned_y = layout._stood(pose, z, y, 10.0)
    sin, cos = math.sin(0.2), math.cos(0.2)
    assert turned_z.tolist() == pytest.approx([10 + 2 * sin, 10 + 2 * cos])
    assert turned_y.tolist() == pytest.approx([0.5 + 2 * cos, 0.5 - 2 * sin])
    assert layout._stood(None, z, y, 10.0) == (z, y)
