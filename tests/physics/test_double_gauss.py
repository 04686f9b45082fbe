"""The f/2 double Gauss against the CODE V listing that is public with rayoptics."""

import math

import pytest
import torch

from camkit.models_def.optics.aiming.newton import newton_aim
from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.paraxial import (
    entrance_pupil,
    focal_lengths,
    image_of_stop,
    trace_paraxial,
)
from camkit.models_def.optics.reverse import reverse
from camkit.models_def.optics.trace import Rays, refract, trace
from tests.physics.printed_lenses import double_gauss, rays_at

STOP = 5
SIX_DIGITS = 6e-7
WAVE_MM = 587.6e-6
EXIT_PUPIL_MM = -53.1569


def _column(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_focal_lengths_are_those_of_the_listing() -> None:
    efl, bfl = focal_lengths(double_gauss())
    ffl = -focal_lengths(reverse(double_gauss()))[1]
    assert float(efl) == pytest.approx(100.00375703, abs=1e-8)
    assert float(bfl) == pytest.approx(61.48753642, abs=1e-8)
    assert float(ffl) == pytest.approx(-29.32078245, abs=1e-8)


def test_pupils_and_lengths_are_those_of_the_listing() -> None:
    lens, four_digits = double_gauss(), 6e-5
    stop_mm = 15.852527
    place, scale = entrance_pupil(lens, STOP)
    assert (float(place), 2 * stop_mm * float(scale)) == pytest.approx((57.9120, 50), abs=6e-5)
    place, scale = image_of_stop(lens, STOP)
    assert float(place) == pytest.approx(EXIT_PUPIL_MM, abs=four_digits)
    assert 2 * stop_mm * float(scale) == pytest.approx(57.3201, abs=four_digits)
    assert float(lens.thickness_mm[:-1].sum()) == pytest.approx(77.9674, abs=four_digits)
    efl = float(focal_lengths(lens)[0])
    assert efl / 50 == pytest.approx(2.0001, abs=four_digits)
    assert efl * math.tan(math.radians(14)) == pytest.approx(24.9337, abs=four_digits)


def test_paraxial_marginal_heights_are_those_of_the_listing() -> None:
    expected = (
        *(25, 23.507005, 23.416630, 19.075817, 17.752950, 15.852527),
        *(14.256448, 14.699756, 15.969559, 15.932466, 15.371307),
    )
    start, flat = _column(25.0)[0], _column(0.0)[0]
    rows = [trace_paraxial(double_gauss(), start, flat, range(i + 1)) for i in range(11)]
    assert [float(y) for y, _ in rows] == pytest.approx(expected, abs=SIX_DIGITS)
    assert float(rows[-1][1]) == pytest.approx(-0.249991, abs=SIX_DIGITS)


def test_axial_marginal_ray_passes_the_listed_heights_and_sags() -> None:
    heights = (
        *(25, 24.109772, 22.844992, 20.958242, 16.784894, 15.702464),
        *(14.610682, 15.815163, 16.882946, 16.583956, 16.261006),
    )
    sags = (
        *(5.866433, 1.920632, 7.714534, 0, 6.754936, 0),
        *(-4.050377, 0, -3.965091, 0.776812, -1.682704),
    )
    seen: list[Rays] = []
    pupil = _column(1.0, 0.8, 0.6, 0.4)
    landed = trace(double_gauss(), rays_at(0 * pupil, 25 * pupil, 0.0), surface_rays=seen)
    assert [float(on.y[0]) for on in seen] == pytest.approx(heights, abs=SIX_DIGITS)
    assert [float(on.z[0]) for on in seen] == pytest.approx(sags, abs=SIX_DIGITS)
    assert float(landed.m[0] / landed.n[0]) == pytest.approx(-0.258832, abs=SIX_DIGITS)
    misses = (0.014138, -0.012851, 0.007971, 0.022285)
    assert landed.y.tolist() == pytest.approx(misses, abs=SIX_DIGITS)


def test_axial_wavefront_is_that_of_the_listing() -> None:
    """Path to the reference sphere about the axial image point, through the exit pupil."""
    lens = double_gauss()
    pupil = _column(0.0, 1.0, 0.8, 0.6, 0.4)
    landed = trace(lens, rays_at(0 * pupil, 25 * pupil, 0.0), path=True)
    assert landed.path_mm is not None
    radius = float(lens.thickness_mm[-1]) - EXIT_PUPIL_MM
    # the sphere is met before the image plane: |(0, y, 0) - way d| = radius
    along = landed.y * landed.m
    way = along + torch.sqrt(along**2 - landed.y**2 + radius**2)
    path = landed.path_mm - way
    waves = (path[0] - path[1:]) / WAVE_MM
    assert waves.tolist() == pytest.approx((-3.137, -3.775, -4.052, -2.636), abs=1.5e-3)


@pytest.mark.parametrize(
    ("angle_deg", "image_y_mm", "first_y_mm", "pupil_mm"),
    [(10.0, 17.485856, -10.199122, 58.7753), (14.0, 24.588739, -14.406114, 59.6575)],
)
def test_real_chief_rays_are_those_of_the_listing(
    angle_deg: float, image_y_mm: float, first_y_mm: float, pupil_mm: float
) -> None:
    slope = _column(math.tan(math.radians(angle_deg)))

    def at_stop(x: torch.Tensor, y: torch.Tensor) -> Rays:
        rays = trace(double_gauss(), launch(x, y, slope, math.inf), surfaces=range(STOP))
        return refract(double_gauss(), rays, STOP)

    zero = _column(0.0)
    aimed = newton_aim(at_stop, (zero, zero), (zero, zero))
    seen: list[Rays] = []
    landed = trace(double_gauss(), launch(aimed.x, aimed.y, slope, math.inf), surface_rays=seen)
    assert float(landed.y) == pytest.approx(image_y_mm, abs=SIX_DIGITS)
    assert float(seen[0].y) == pytest.approx(first_y_mm, abs=SIX_DIGITS)
    assert float(-aimed.y / slope) == pytest.approx(pupil_mm, abs=6e-5)


def test_a_skew_ray_lands_where_the_listing_says() -> None:
    slope = math.tan(math.radians(10.0))
    start = rays_at(_column(25.0), _column(-9.180390), slope, z=_column(6.710684))
    landed = trace(double_gauss(), start)
    assert float(landed.x) == pytest.approx(0.0547497, abs=SIX_DIGITS)
    assert float(landed.y) - 17.485856 == pytest.approx(0.0010213, abs=2 * SIX_DIGITS)
