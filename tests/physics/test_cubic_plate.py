"""A cubic phase plate keeps its MTF over defocus, by the closed form of Dowski and Cathey (1995).

In one dimension a pupil -1..1 with the phase alpha u^3 + psi u^2 has the MTF sqrt(pi / (12 alpha
s)) at the spatial frequency s (cut-off 2) as long as |psi| < 3 alpha (1 - s / 2). Both phases come
from the lens here: the plate, and the sensor moved away from the focus. The stationary phase that
the formula rests on is the same for rays, which add up with exp(i s phi').

References: Dowski and Cathey, Appl. Opt. 34, 1859 (1995).
"""

import math

import pytest
import torch

from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import PupilSamples
from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.search.problem import Problem, trace_batch
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.optics.shape.phase import Monomial, Phase

_WAVE_UM, _RADIUS_MM, _FOCAL_MM, _ALPHA = 0.55, 2.0, 1000.0, 200.0
_FREQUENCY = 0.5


def _mtf(alpha: float, psi: float) -> float:
    """Return the MTF along x of a diffractive lens at F/250 with a plate, out of focus by psi."""
    wave_mm = _WAVE_UM / 1000
    focus_rad = -math.pi * _RADIUS_MM**2 / (wave_mm * _FOCAL_MM)
    terms = (Monomial(p=3, q=0, coefficient_rad=alpha), Monomial(p=0, q=3, coefficient_rad=alpha))
    phase = Phase(radius_mm=_RADIUS_MM, radial_rad=(focus_rad,), free_rad=terms)
    # out of focus by psi = pi R^2 (1 / z - 1 / f) / wave
    sensor_mm = 1 / (1 / _FOCAL_MM + psi * wave_mm / (math.pi * _RADIUS_MM**2))
    lens = Lens(
        name="plate",
        surfaces=(Surface(curvature_per_mm=0.0, thickness_mm=sensor_mm, phase=phase),),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=_RADIUS_MM,
    )
    half_line = (torch.arange(4000, dtype=torch.float64) + 0.5) / 4000
    problem = Problem(
        free=FreeLens(lens=lens, variables=(), rides=False),
        slopes=torch.zeros(1, dtype=torch.float64),
        azimuths_rad=torch.zeros(1, dtype=torch.float64),
        wavelengths_um=torch.tensor([_WAVE_UM], dtype=torch.float64),
        samples=PupilSamples(x=half_line, y=torch.zeros_like(half_line)),
    )
    landings = trace_batch(problem, torch.zeros(1, 0, dtype=torch.float64), math.inf).landings
    x_mm = landings.x[0, 0, 0, LEAD:]
    per_mm = _FREQUENCY * _RADIUS_MM / (wave_mm * sensor_mm)
    return float(torch.polar(torch.ones_like(x_mm), 2 * math.pi * per_mm * x_mm).mean().abs())


@pytest.mark.parametrize("psi", [-300.0, -120.0, 0.0, 120.0, 300.0])
def test_mtf_behind_a_cubic_plate_is_that_of_the_closed_form_at_every_defocus(psi: float) -> None:
    wanted = math.sqrt(math.pi / (12 * _ALPHA * _FREQUENCY))
    assert _mtf(_ALPHA, psi) == pytest.approx(wanted, rel=0.06)


def test_mtf_falls_without_the_plate_and_beyond_its_range() -> None:
    wanted = math.sqrt(math.pi / (12 * _ALPHA * _FREQUENCY))
    assert _mtf(0.0, 0.0) == pytest.approx(1.0, abs=1e-6)
    assert _mtf(0.0, 121.0) < 0.2 * wanted
    assert _mtf(_ALPHA, 1000.0) < 0.2 * wanted
