from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.focus import FocusMerit, focus_shift_mm, with_focus
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, with_focus_shift
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import trace_spots
from tests.physics.reference_lenses import cooke_triplet, thorlabs_la1131

COLOURS = (0.4861, 0.5876, 0.6563)


def _lens(wavelengths_um: tuple[float, ...] = (0.5876,)) -> Lens:
    lens = replace(thorlabs_la1131(), aperture_value=6.0)
    return replace(lens, wavelengths_um=wavelengths_um, field_angles_rad=(0.0, 0.03))


def _mean_square(lens: Lens) -> float:
    slopes = torch.tan(torch.tensor(lens.field_angles_rad, dtype=torch.float64))
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    spots = trace_spots(lens, slopes, waves, half_disc(256))
    share = spots.weight / spots.weight.sum((1, 2), keepdim=True)
    dy = spots.y_mm - (share * spots.y_mm).sum((1, 2), keepdim=True)
    return float((spots.weight * (spots.x_mm**2 + dy**2)).sum())


@pytest.mark.parametrize("wavelengths_um", [(0.5876,), COLOURS])
def test_spot_focus_is_better_than_its_neighbours(wavelengths_um: tuple[float, ...]) -> None:
    best = with_focus(_lens(wavelengths_um), "spot")
    here = _mean_square(best)
    for step in (-0.01, 0.01):
        assert _mean_square(with_focus_shift(best, step)) > here


@pytest.mark.parametrize("merit", ["paraxial", "spot", "wavefront"])
def test_focus_of_a_focused_lens_stays(merit: FocusMerit) -> None:
    assert focus_shift_mm(with_focus(_lens(), merit), merit) == pytest.approx(0, abs=2e-6)


def test_foci_of_spherical_aberration_lie_where_third_order_says() -> None:
    """From the paraxial focus to the marginal one: 1/2 of the way for the wavefront, 2/3 for the
    spot."""
    lens = replace(_lens(), field_angles_rad=(0.0,))
    paraxial = with_focus(lens, "paraxial")
    spot, wave = (focus_shift_mm(paraxial, merit) for merit in ("spot", "wavefront"))
    assert spot < 0
    assert wave / spot == pytest.approx(0.75, rel=0.01)


def test_a_near_object_focuses_behind_the_focal_point() -> None:
    lens = replace(cooke_triplet(), object_distance_mm=1000.0)
    shift = focus_shift_mm(lens, "paraxial")
    found = shift + lens.surfaces[-1].thickness_mm
    assert found == pytest.approx(paraxial_image(lens).distance_mm)
    assert found > paraxial_data(lens).bfl_mm
    assert focus_shift_mm(lens, "wavefront") == pytest.approx(shift, abs=0.3)


def test_unknown_merits_are_refused() -> None:
    with pytest.raises(ContractError, match="merit"):
        focus_shift_mm(_lens(), "sharp")  # type: ignore[arg-type]


def test_foci_in_a_denser_medium_meet_as_the_stop_closes() -> None:
    """A path in front of the lens counts with its index, or a wavefront is bent."""
    lens = replace(_lens(), object_distance_mm=400.0, object_glass="model:1.33,0")
    focused = with_focus(replace(lens, aperture_value=0.5, field_angles_rad=(0.0,)), "paraxial")
    for merit in ("spot", "wavefront"):
        assert focus_shift_mm(focused, merit) == pytest.approx(0, abs=0.02)
