"""The lenses that the library has from patents and a book are what their sources state."""

import math

import pytest
import torch

from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.pupil import hexapolar
from camkit.models_def.optics.scaling import scale_to_efl
from camkit.models_def.optics.spot import rms_radius, trace_spots

INCH_MM = 25.4


@pytest.mark.parametrize(
    ("name", "efl_mm", "source"),
    [
        ("tessar", 35 * 1.0, "4,487,484"),
        ("triplet-flattener", 23.5, "3,961,844"),
        ("retrofocus", 1.181 * INCH_MM, "Laikin"),
    ],
)
def test_the_focal_length_is_that_of_the_source(name: str, efl_mm: float, source: str) -> None:
    lens = find_lens(name)
    # a wrong digit of one radius moves it by more than the sources round
    assert paraxial_data(lens).efl_mm == pytest.approx(efl_mm, rel=1e-3)
    assert source in lens.note


def test_the_inverted_telephoto_has_its_printed_back_focus() -> None:
    data = paraxial_data(find_lens("retrofocus"))
    assert data.bfl_mm == pytest.approx(2.2253 * INCH_MM, rel=2e-3)
    assert data.bfl_mm > 1.8 * data.efl_mm


@pytest.mark.parametrize(
    ("name", "field_deg", "most_um"),
    [
        ("tessar", 0.0, 40),
        ("tessar", 20.0, 80),
        ("triplet-flattener", 0.0, 15),
        ("triplet-flattener", 25.0, 50),
        ("retrofocus", 0.0, 20),
        ("retrofocus", 20.0, 30),
    ],
)
def test_spots_of_a_50_mm_lens_are_those_of_a_corrected_one(
    name: str, field_deg: float, most_um: float
) -> None:
    lens = scale_to_efl(find_lens(name), 50.0)
    slope = torch.tensor([math.tan(math.radians(field_deg))], dtype=torch.float64)
    waves = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    spots = trace_spots(lens, slope, waves, hexapolar(6))
    assert float(rms_radius(spots)) < most_um / 1000
