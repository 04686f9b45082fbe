"""Spots of the Cooke triplet, by optiland, rayoptics and an independent tracer."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import (
    chief_landings,
    field_slopes,
    max_from_chief,
    rms_about_centroid,
    rms_about_chief,
    rms_of_all_waves,
    spot_convergence,
    spot_diagram,
)
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import PupilDefinition, real_stop_radius_mm
from camkit.models_def.optics.spot import Spots
from tests.physics.reference_lenses import cooke_triplet

ANGLES_RAD = tuple(map(math.radians, (0, 14, 20)))
PRINTED_MM = 6e-9


def _cooke() -> Lens:
    return replace(cooke_triplet(), field_angles_rad=ANGLES_RAD, wavelengths_um=(0.48, 0.55, 0.65))


def _spots(definition: PupilDefinition, sampling: str = "hexapolar:6") -> Spots:
    lens = _cooke()
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    pupil = Pupil(definition=definition, sampling=sampling)
    return spot_diagram(lens, field_slopes(lens), waves, pupil)


@pytest.mark.parametrize(
    ("definition", "expected_mm", "tolerance_mm"),
    [
        ("paraxial", (0.004293689564258, 0.016786721284464, 0.012081348897955), 1e-12),
        ("chief", (0.00429369, 0.01658072, 0.01229450), 8e-9),
        ("stop", (0.00427282389, 0.01770872, 0.01632124), PRINTED_MM),
    ],
)
def test_rms_radius_follows_the_definition_of_the_pupil(
    definition: PupilDefinition, expected_mm: tuple[float, ...], tolerance_mm: float
) -> None:
    found = rms_about_centroid(_spots(definition))[:, 1].tolist()
    assert found == pytest.approx(expected_mm, abs=tolerance_mm)


def _by_hand_mm(spots: Spots, field: int) -> float:
    """Return the RMS radius of all wavelengths ray by ray; each wavelength weighs 1."""
    rays = []
    for wave in torch.stack([spots.x_mm, spots.y_mm, spots.weight], dim=-1)[field]:
        total = float(wave[:, 2].sum())
        rays += [(x, y, weight / total) for x, y, weight in wave.tolist() if weight > 0]
    whole = sum(share for *_, share in rays)
    middle_x, middle_y = (sum(ray[axis] * ray[2] for ray in rays) / whole for axis in (0, 1))
    square = sum(share * ((x - middle_x) ** 2 + (y - middle_y) ** 2) for x, y, share in rays)
    return math.sqrt(square / whole)


def test_all_wavelengths_together_are_what_a_sum_over_rays_says_with_rays_lost() -> None:
    rim = replace(_cooke().surfaces[0], semi_diameter_mm=4.7)
    lens = replace(_cooke(), surfaces=(rim, *_cooke().surfaces[1:]))
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    spots = spot_diagram(lens, field_slopes(lens), waves, Pupil(sampling="fibonacci:64"))
    kept = (spots.weight > 0).sum(-1)
    assert kept[0].tolist() != kept[2].tolist()
    expected_mm = [_by_hand_mm(spots, field) for field in range(len(ANGLES_RAD))]
    assert rms_of_all_waves(spots).tolist() == pytest.approx(expected_mm, rel=1e-12)


@pytest.mark.parametrize("light", [1.0, 0.3])
def test_lateral_colour_alone_adds_half_its_size_in_squares(light: float) -> None:
    """Two wavelengths, alike but for a shift d: RMS^2 = r^2 + (d / 2)^2, with unequal light too."""
    d_mm, radius_mm, rays = 0.012, 0.004, 10
    angle = torch.arange(rays, dtype=torch.float64) * (2 * math.pi / rays)
    x, y = (radius_mm * f(angle).expand(1, 2, -1) for f in (torch.cos, torch.sin))
    weight = torch.ones(1, 2, rays, dtype=torch.float64)
    weight[:, 1] = light
    spots = Spots(
        x_mm=x,
        y_mm=y + torch.tensor([-d_mm / 2, d_mm / 2], dtype=torch.float64)[:, None],
        weight=weight,
        chief_y_mm=torch.zeros(1, dtype=torch.float64),
        fate=torch.zeros(1, 2, rays, dtype=torch.int8),
    )
    assert rms_about_centroid(spots)[0].tolist() == pytest.approx([radius_mm] * 2, rel=1e-12)
    expected_mm = math.hypot(radius_mm, d_mm / 2)
    assert float(rms_of_all_waves(spots)[0]) == pytest.approx(expected_mm, rel=1e-12)


def test_real_marginal_ray_meets_the_stop_where_the_independent_tracer_says() -> None:
    assert real_stop_radius_mm(cooke_triplet()) == pytest.approx(3.85751464, abs=PRINTED_MM)


@pytest.mark.parametrize(
    ("wavelength", "expected_mm"),
    [
        (0, (0.003791335, 0.015824800, 0.013236233)),
        (1, (0.004293689564258, 0.016918412809702, 0.012116688566408)),
        (2, (0.006195619, 0.019221166, 0.013648685)),
    ],
)
def test_rms_about_the_chief_ray_equals_optiland(
    wavelength: int, expected_mm: tuple[float, ...]
) -> None:
    spots = _spots("paraxial")
    found = rms_about_chief(spots)[:, wavelength].tolist()
    assert found == pytest.approx(expected_mm, abs=6e-10)


def test_largest_distance_from_the_chief_ray_equals_optiland() -> None:
    found = max_from_chief(_spots("paraxial"))[:, 1].tolist()
    assert found == pytest.approx([0.0062864577, 0.0407529516, 0.0225018474], abs=PRINTED_MM)


def test_six_hexapolar_rings_overstate_the_spot_at_14_degrees_by_15_percent() -> None:
    """Published: 125 k points of a uniform grid give 4.1806, 14.5615 and 11.2921 um."""
    lens = _cooke()
    found = spot_convergence(lens, field_slopes(lens), "paraxial")
    finest = found.rms_mm[-1]
    assert finest.tolist() == pytest.approx([0.0041806, 0.0145615, 0.0112921], rel=5e-4)
    coarse = found.rms_mm[found.samplings.index("hexapolar:6")]
    assert float(coarse[1] / finest[1]) == pytest.approx(1.152, abs=2e-3)
    quadrature = [found.rms_mm[found.samplings.index(n)] for n in ("gauss:8x16", "gauss:16x32")]
    assert torch.allclose(quadrature[0], quadrature[1], rtol=1e-6)
    assert torch.allclose(quadrature[1], finest, rtol=5e-4)


def test_every_fine_sampling_gives_the_same_rms() -> None:
    fine = [
        rms_about_centroid(_spots("paraxial", name))[:, 1]
        for name in ("gauss:8x16", "radau:9x18", "grid:60", "fibonacci:4000", "hexapolar:48")
    ]
    for found in fine[1:]:
        assert torch.allclose(found, fine[0], rtol=3e-2)
    assert torch.allclose(fine[1], fine[0], rtol=1e-7)
    assert torch.allclose(fine[3], fine[0], rtol=1e-3)


def test_field_without_rays_has_no_spot_and_the_others_stay() -> None:
    lens = _cooke()
    blocked = replace(lens.surfaces[-1], semi_diameter_mm=5.2)
    front = replace(lens.surfaces[0], semi_diameter_mm=5.2)
    narrow = replace(lens, surfaces=(front, *lens.surfaces[1:-1], blocked))
    wide = replace(narrow, field_angles_rad=(0.0, math.radians(35)))
    wave = torch.tensor([0.55], dtype=torch.float64)
    spots = spot_diagram(wide, field_slopes(wide), wave, Pupil())
    rms, largest = rms_about_centroid(spots)[:, 0], max_from_chief(spots)[:, 0]
    assert torch.isnan(rms).tolist() == [False, True]
    assert torch.isnan(largest).tolist() == [False, True]


def test_rays_on_the_rim_of_a_stop_that_is_stated_are_not_lost_to_rounding() -> None:
    stop = Surface(curvature_per_mm=0.0, thickness_mm=50.0, semi_diameter_mm=6.25)
    pinhole = Lens(
        name="rim",
        surfaces=(stop,),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=6.25,
        field_angles_rad=ANGLES_RAD,
    )
    wave = torch.tensor([0.55], dtype=torch.float64)
    for definition in ("paraxial", "chief", "stop"):
        pupil = Pupil(definition=definition, sampling="hexapolar:20")
        spots = spot_diagram(pinhole, field_slopes(pinhole), wave, pupil)
        assert bool((spots.fate == 0).all())


def test_near_object_s_rays_fill_the_entrance_pupil_and_meet_in_its_image() -> None:
    """1/s' = 1/f - 1/s about a thin lens: a point 200 mm away of f 50 is imaged at 66.667 mm."""
    radius_mm = 2 * 50 * 0.5168000345
    thin = (
        Surface(curvature_per_mm=1 / radius_mm, thickness_mm=1e-6, glass="N-BK7-Schott"),
        Surface(curvature_per_mm=-1 / radius_mm, thickness_mm=200 * 50 / 150),
    )
    lens = Lens(
        name="thin",
        surfaces=thin,
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=0.2,
        object_distance_mm=200.0,
        reference_wavelength_um=0.5875618,
    )
    wave = torch.tensor([0.5875618], dtype=torch.float64)
    slopes = torch.tensor([0.0, 0.03], dtype=torch.float64)
    for definition in ("paraxial", "chief", "stop"):
        spots = spot_diagram(lens, slopes, wave, Pupil(definition=definition))
        assert float(rms_about_centroid(spots).max()) < 2e-4
        assert float(spots.chief_y_mm[1]) == pytest.approx(0.03 * 200 / 3, rel=1e-3)


def test_chief_rays_of_both_definitions_differ_at_20_degrees() -> None:
    lens, wave = _cooke(), torch.tensor([0.55], dtype=torch.float64)
    slopes = field_slopes(lens)
    paraxial = chief_landings(lens, slopes, wave, "paraxial")[2]
    assert float(paraxial) == pytest.approx(18.136025932761, abs=2e-11)
    assert float(chief_landings(lens, slopes, wave, "stop")[2]) == pytest.approx(18.1385, abs=1e-4)
