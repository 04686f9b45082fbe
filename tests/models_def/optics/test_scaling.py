import math
from dataclasses import replace

import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.lens_file.placing import stopped_lens
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image, with_paraxial_focus
from camkit.models_def.optics.scaling import scale_lens, scale_to_efl, with_f_number
from tests.physics.reference_lenses import cooke_triplet, thorlabs_al2550

EXACT = 1e-12


def test_scaling_to_a_focal_length_keeps_the_f_number() -> None:
    lens = scale_to_efl(cooke_triplet(), 25.0)
    data = paraxial_data(lens)
    assert data.efl_mm == pytest.approx(25.0, rel=EXACT)
    assert data.f_number == pytest.approx(paraxial_data(cooke_triplet()).f_number, rel=EXACT)
    assert paraxial_data(replace(lens, object_distance_mm=500.0)).bfl_mm == data.bfl_mm


def test_scaling_there_and_back_gives_every_asphere_term() -> None:
    lens = scale_lens(scale_lens(thorlabs_al2550(), 0.37), 1 / 0.37)
    found, wanted = lens.surfaces[0].even_asphere, thorlabs_al2550().surfaces[0].even_asphere
    assert found == pytest.approx(wanted, rel=EXACT)


@pytest.mark.parametrize("distance_mm", [math.inf, 300.0])
def test_a_working_f_number_is_that_of_the_image(distance_mm: float) -> None:
    lens = replace(cooke_triplet(), object_distance_mm=distance_mm)
    stopped = with_f_number(lens, 8.0, working=True)
    assert paraxial_image(stopped).working_f_number == pytest.approx(8.0, rel=EXACT)
    plain = with_f_number(lens, 8.0)
    assert paraxial_data(plain).f_number == pytest.approx(8.0, rel=EXACT)
    same = math.isinf(distance_mm)
    assert (paraxial_image(plain).working_f_number == pytest.approx(8.0, rel=1e-9)) == same


def test_an_opened_lens_lets_its_wider_beam_through_the_stop() -> None:
    lens = find_lens("duet")
    fast = with_f_number(lens, 2.8)
    rim_mm = fast.surfaces[fast.stop].semi_diameter_mm
    assert rim_mm == pytest.approx(paraxial_data(fast).stop_semi_diameter_mm, rel=EXACT)
    assert rim_mm > lens.surfaces[lens.stop].semi_diameter_mm
    assert with_f_number(lens, 8.0).surfaces == lens.surfaces


def test_a_name_has_no_old_f_number() -> None:
    assert with_f_number(find_lens("double-gauss"), 5.6).name == "double Gauss F/5.6"
    assert with_f_number(find_lens("duet"), 5.6).name == "duet"
    stopped = stopped_lens(find_lens("double-gauss"), f_number=None, stop_radius_mm=2.0)
    assert stopped.name == "double Gauss F/7.92"


def test_a_thick_lens_images_by_newton_s_equation() -> None:
    """z z' = -f^2 about the focal points, magnification f / z."""
    data = paraxial_data(cooke_triplet())
    lens = replace(cooke_triplet(), object_distance_mm=400.0)
    image = paraxial_image(lens)
    z = -400.0 - data.ffl_mm
    assert image.distance_mm - data.bfl_mm == pytest.approx(-(data.efl_mm**2) / z, rel=1e-10)
    assert image.magnification == pytest.approx(data.efl_mm / z, rel=1e-10)
    focused = with_paraxial_focus(lens)
    assert focused.surfaces[-1].thickness_mm == pytest.approx(image.distance_mm, rel=EXACT)


@pytest.mark.parametrize("factor", [0.0, -1.0, math.nan])
def test_senseless_scales_are_refused(factor: float) -> None:
    with pytest.raises(ContractError, match="scale"):
        scale_lens(cooke_triplet(), factor)
    with pytest.raises(ContractError, match="F-number"):
        with_f_number(cooke_triplet(), factor)
