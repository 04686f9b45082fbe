from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.beam import find_beams, light_at, rays_from, stop_labels
from camkit.models_def.optics.render.lens_view import lens_optics
from camkit.models_def.optics.reverse import trace_to_scene

WAVES = torch.tensor([0.46, 0.54, 0.6], dtype=torch.float64)


def test_labels_are_points_of_the_paraxial_exit_pupil(near_duet: Lens) -> None:
    """Seen from any sensor point the label s lies at s radii of the exit pupil."""
    data, labels = paraxial_data(near_duet), stop_labels(lens_optics(near_duet))
    away_mm = near_duet.surfaces[-1].thickness_mm - data.exit_pupil_mm
    for x_mm, label in ((0.0, 1.0), (10.0, -0.5)):
        slope = labels.slope(torch.tensor(label), torch.tensor(x_mm, dtype=torch.float64))
        met = x_mm + float(slope) * away_mm
        assert met == pytest.approx(label * data.exit_pupil_diameter_mm / 2, abs=1e-9)


def test_what_passes_lies_inside_the_disc_that_is_drawn(near_duet: Lens) -> None:
    """A dense ring just outside it passes nowhere, also between the heights of the table."""
    optics = lens_optics(near_duet)
    labels = stop_labels(optics)
    beams = find_beams(optics, labels, 20.0, WAVES)
    heights = torch.linspace(0, 20, 21, dtype=torch.float64)
    middle, radius = (v.double()[:, None] for v in beams.at(heights.numpy()))
    angle = torch.linspace(0, 6.283, 361, dtype=torch.float64)
    for wave in WAVES:
        for factor, passes in ((1.0, False), (0.85, True)):
            x, y = factor * radius * torch.cos(angle), middle + factor * radius * torch.sin(angle)
            start = rays_from(labels, 0 * heights[:, None], heights[:, None], x, y)
            end = trace_to_scene(optics.stopped(wave), start, optics.object_distance_mm)
            assert bool(end.valid.any()) is passes


def test_light_does_not_depend_on_the_disc_that_is_drawn(near_duet: Lens) -> None:
    optics = lens_optics(near_duet)
    labels = stop_labels(optics)
    beams = find_beams(optics, labels, 20.0, WAVES)
    heights = torch.tensor([0.0, 12.0, 20.0])
    tight = light_at(optics, labels, beams, heights)
    wide = light_at(optics, labels, replace(beams, radius=1.3 * beams.radius), heights)
    assert torch.allclose(tight, wide, rtol=2e-3)


def test_a_lens_that_nothing_limits_is_refused(near_duet: Lens) -> None:
    optics = lens_optics(near_duet)
    labels = replace(stop_labels(optics), radius_mm=3.5)
    with pytest.raises(ContractError, match="edge of the search"):
        find_beams(optics, labels, 1.0, WAVES)


def test_a_stop_that_blocks_the_axis_is_refused(near_duet: Lens) -> None:
    shut = replace(
        near_duet,
        surfaces=tuple(replace(s, semi_diameter_mm=1e-9) for s in near_duet.surfaces),
    )
    optics = lens_optics(shut)
    labels = stop_labels(optics)
    beams = find_beams(optics, labels, 1.0, WAVES)
    with pytest.raises(ContractError, match="no light"):
        light_at(optics, labels, beams, torch.zeros(1))
