"""Strehl ratios and encircled energy against closed forms and another program."""

import math
from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.point_image import (
    PointImage,
    encircled_airy,
    encircled_energy,
    encircled_rays,
    radius_of_share,
    trace_point_image,
)
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import field_slopes, spot_diagram
from camkit.models_def.optics.prescription import Lens, Surface, with_focus_shift
from tests.physics.reference_lenses import cooke_triplet

WAVE_UM = 0.55
RINGS = (1.21966989, 2.23313059, 3.23831548)
ENERGY = (0.83778487, 0.90993054, 0.93764747)


def _perfect(f_number: float = 16.0, index: float = 1.5) -> Lens:
    """A plane and a hyperboloid of conic -n^2: no aberration of a distant point on the axis."""
    focal_mm = 50.0
    back = Surface(
        curvature_per_mm=-1 / (focal_mm * (index - 1)), thickness_mm=focal_mm, conic=-(index**2)
    )
    front = Surface(curvature_per_mm=0.0, thickness_mm=4.0, glass=f"model:{index},0")
    return Lens(
        name="hyperboloid",
        surfaces=(front, back),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=focal_mm / f_number,
        field_angles_rad=(0.0,),
        wavelengths_um=(WAVE_UM,),
        reference_wavelength_um=WAVE_UM,
    )


def _image(lens: Lens, field: int = 0) -> PointImage:
    slope = field_slopes(lens)[field : field + 1]
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    spots = spot_diagram(lens, slope, waves, Pupil(sampling="gauss:8x16"))
    return trace_point_image(lens, slope, waves, spots, "paraxial")


def _airy_mm(lens: Lens) -> float:
    return RINGS[0] * WAVE_UM / 1000 / (2 * math.sin(math.atan(lens.aperture_value / 2 / 50.0)))


def test_perfect_lens_has_strehl_1_and_the_energy_of_an_airy_disc() -> None:
    """83.8 % within the first dark ring; at f/16 the rays of this lens lie a little uneven."""
    lens = _perfect(64.0)
    image = _image(lens)
    assert float(image.strehl[0]) == pytest.approx(1, abs=1e-6)
    rings_mm = torch.tensor(RINGS, dtype=torch.float64) * _airy_mm(lens) / RINGS[0]
    assert encircled_energy(image, rings_mm).tolist() == pytest.approx(ENERGY, abs=5e-5)


def test_closed_form_of_encircled_energy_has_the_published_values() -> None:
    radii = torch.tensor([0.0, *RINGS, 0.5, 1.0], dtype=torch.float64) / RINGS[0]
    found = encircled_airy(radii, torch.ones(1, dtype=torch.float64)).tolist()
    assert found == pytest.approx([0.0, *ENERGY, 0.45592530, 0.82643080], abs=2e-8)


@pytest.mark.parametrize(("waves", "strehl"), [(0.25, 0.81056947), (0.5, 0.40528473)])
def test_strehl_of_a_defocused_perfect_lens(waves: float, strehl: float) -> None:
    """sinc^2(W) for a defocus of W waves at the rim: r^2 / 2 times the change of 1 / distance."""
    lens = _perfect()
    change_per_mm = 2 * waves * WAVE_UM / 1000 / (lens.aperture_value / 2) ** 2
    shift_mm = 1 / (1 / 50.0 - change_per_mm) - 50.0
    found = _image(with_focus_shift(lens, shift_mm)).strehl
    assert float(found[0]) == pytest.approx(strehl, abs=2e-3)


def _cooke() -> Lens:
    return replace(
        cooke_triplet(),
        field_angles_rad=tuple(map(math.radians, (0, 14, 20))),
        wavelengths_um=(0.55,),
        reference_wavelength_um=0.55,
    )


@pytest.mark.parametrize(
    ("field", "optiland"),
    [(0, 0.3085462154582256), (1, 0.024930560276815675), (2, 0.10250348042298739)],
)
def test_strehl_of_the_cooke_triplet_equals_optiland(field: int, optiland: float) -> None:
    """FFTPSF of optiland 0.6.3, 256 rays across a grid of 2048; it sums on a square grid."""
    assert float(_image(_cooke(), field).strehl[0]) == pytest.approx(optiland, rel=6e-3)


def test_energy_of_rays_equals_optiland() -> None:
    """Rays and centroid of optiland 0.6.3's EncircledEnergy, 40 rings, within 3, 6, 10, 20 um."""
    lens = _cooke()
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    spots = spot_diagram(lens, field_slopes(lens), waves, Pupil(sampling="hexapolar:40"))
    radii_mm = torch.tensor([0.003, 0.006, 0.010, 0.020], dtype=torch.float64)
    expected = (
        [0.36232473074578336, 0.8195488721804511, 1.0, 1.0],
        [0.051412314570209304, 0.16419426945742735, 0.35460272302377566, 0.8512497459865881],
        [0.05100589311115627, 0.1658199552936395, 0.4011379800853485, 0.994919731761837],
    )
    for field, shares in enumerate(expected):
        assert encircled_rays(spots, field, radii_mm).tolist() == pytest.approx(shares, abs=5e-4)


def test_energy_by_frequencies_equals_the_sum_of_samples() -> None:
    image = _image(_cooke(), 1)
    light = image.light_per_mm2.mean(0)
    share = light / light.sum()
    x, y = (share.sum(0) * image.x_mm).sum(), (share.sum(1) * image.y_mm).sum()
    distance = torch.hypot(image.x_mm - x, image.y_mm[:, None] - y)
    radii_mm = torch.tensor([0.01, 0.02, 0.03], dtype=torch.float64)
    slow = [float(light[distance <= radius].sum()) * image.pitch_mm**2 for radius in radii_mm]
    assert encircled_energy(image, radii_mm).tolist() == pytest.approx(slow, abs=5e-3)
    beyond = torch.tensor([1.0], dtype=torch.float64)
    assert bool(torch.isnan(encircled_energy(image, beyond)).all())


def test_radius_of_a_share_lies_between_the_samples() -> None:
    radii = torch.tensor([0.0, 1.0, 2.0, 3.0], dtype=torch.float64)
    shares = torch.tensor([0.0, 0.4, 0.8, math.nan], dtype=torch.float64)
    assert radius_of_share(radii, shares, 0.6) == pytest.approx(1.5)
    assert math.isnan(radius_of_share(radii, shares, 0.9))


def test_a_blur_far_too_wide_for_waves_is_refused() -> None:
    with pytest.raises(ContractError, match="rays"):
        _image(with_focus_shift(_perfect(2.0), 5.0))
