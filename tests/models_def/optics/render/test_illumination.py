"""Light on the sensor against form factors, the renderer's integral and the cos^4 law."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import with_paraxial_focus
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.beam import find_beams, light_at, stop_labels
from camkit.models_def.optics.render.illumination import (
    relative_illumination_at,
    relative_illumination_of,
    sensor_light,
)
from camkit.models_def.optics.render.lens_view import lens_optics
from tests.physics.reference_lenses import cooke_triplet

DUET = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions" / "duet.toml"
WAVE = torch.tensor([0.55], dtype=torch.float64)


def _heights(*heights_mm: float) -> torch.Tensor:
    return torch.tensor(heights_mm, dtype=torch.float64)[:, None]


def _hole(radius_mm: float) -> Lens:
    return Lens(
        name="hole",
        surfaces=(Surface(curvature_per_mm=0.0, thickness_mm=50.0),),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=radius_mm,
    )


@pytest.fixture(scope="module")
def near_duet() -> Lens:
    lens = with_paraxial_focus(with_object_distance(read_prescription(DUET), 1000.0))
    return replace(lens, reference_wavelength_um=0.55)


@pytest.mark.parametrize(("radius_mm", "height_mm"), [(1.0, 0.0), (20.0, 0.0), (20.0, 30.0)])
def test_a_hole_gives_the_form_factor_of_a_disc(radius_mm: float, height_mm: float) -> None:
    """Foote 1915: (1 - (1 + f - h) / sqrt((1 + f + h)^2 - 4 f h)) pi / 2, up to F/1.25."""
    field, half = (height_mm / 50) ** 2, (radius_mm / 50) ** 2
    root = math.sqrt((1 + field + half) ** 2 - 4 * field * half)
    expected = math.pi / 2 * (1 - (1 + field - half) / root)
    found = sensor_light(_hole(radius_mm), _heights(height_mm), WAVE)
    # the quadrature of 1024 rays
    assert float(found) == pytest.approx(expected, rel=3e-4)


def test_a_pinhole_obeys_the_cos4_law() -> None:
    angles = torch.tensor([0.0, 0.3, 0.6], dtype=torch.float64)
    found = relative_illumination_of(_hole(1e-3), torch.tan(angles), WAVE, rays=16)
    assert torch.allclose(found[:, 0], torch.cos(angles) ** 4, rtol=1e-6)
    at_heights = relative_illumination_at(_hole(1e-3), 50 * torch.tan(angles), rays=16)
    assert torch.allclose(at_heights, torch.cos(angles) ** 4, rtol=1e-6)


def test_a_blurred_lens_is_as_bright_as_the_renderer_s_integral_says(near_duet: Lens) -> None:
    """Labels on a disc that holds the beam there, rays aimed at the stop here; 0.897 at 20 mm."""
    heights, optics = _heights(0.0, 12.0, 20.0), lens_optics(near_duet)
    labels = stop_labels(optics)
    beams = find_beams(optics, labels, 20.0, WAVE)
    rendered = light_at(optics, labels, beams, heights[:, 0])
    found = sensor_light(near_duet, heights, WAVE)[:, 0]
    # the label disc has an edge inside which rays are counted one by one
    assert torch.allclose(found, rendered, rtol=2e-3)
    # counted forward, see tests/physics/test_render.py
    assert float(found[2] / found[0]) == pytest.approx(0.897, abs=5e-3)


def test_more_rays_change_nothing() -> None:
    slopes = torch.tan(torch.tensor([0.2, 0.35], dtype=torch.float64))
    few, many = (relative_illumination_of(cooke_triplet(), slopes, WAVE, n) for n in (256, 4096))
    assert torch.allclose(few, many, rtol=1e-4)


def test_a_rim_takes_light_from_the_field_alone(near_duet: Lens) -> None:
    heights = _heights(0.0, 15.0)
    whole = sensor_light(near_duet, heights, WAVE)
    narrow = replace(near_duet.surfaces[-1], semi_diameter_mm=8.0)
    cut = sensor_light(
        replace(near_duet, surfaces=(*near_duet.surfaces[:-1], narrow)), heights, WAVE
    )
    assert float(cut[0]) == pytest.approx(float(whole[0]), rel=1e-9)
    assert float(cut[1]) < 0.97 * float(whole[1])


def test_a_field_without_chief_ray_has_no_number() -> None:
    """Beyond 90 degrees of incidence the ray is lost; the other field keeps its light."""
    found = relative_illumination_of(cooke_triplet(), torch.tensor([0.1, 40.0]).double(), WAVE)
    assert torch.isnan(found[:, 0]).tolist() == [False, True]


def test_a_stop_imaged_onto_the_sensor_is_refused() -> None:
    stop = Surface(curvature_per_mm=0.0, thickness_mm=0.0)
    lens = replace(_hole(1.0), surfaces=(stop,))
    with pytest.raises(ContractError, match="imaged onto the sensor"):
        sensor_light(lens, _heights(0.0), WAVE)
