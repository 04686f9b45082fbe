"""Published numbers of real lenses: OpticStudio, Zemax files of the maker, optiland, rayoptics."""

from dataclasses import replace

import pytest
import torch

from camkit.models_def.optics.aiming.start import launch
from camkit.models_def.optics.paraxial import focal_lengths, paraxial_data, with_paraxial_focus
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import PupilSamples, hexapolar
from camkit.models_def.optics.spot import chief_heights, rms_radius, trace_spots
from camkit.models_def.optics.trace import Rays, SurfaceTensors, surface_tensors, trace
from tests.physics.reference_lenses import (
    cooke_triplet,
    thorlabs_aca254,
    thorlabs_al2550,
    thorlabs_la1131,
)

PRINTED_DIGITS = 2e-11
GRADIENT_TOLERANCE = 1e-6


def _slopes(*angles_deg: float) -> torch.Tensor:
    return torch.tan(torch.deg2rad(torch.tensor(angles_deg, dtype=torch.float64)))


def _waves(*wavelengths_um: float) -> torch.Tensor:
    return torch.tensor(wavelengths_um, dtype=torch.float64)


def _marginal(lens: Lens, wavelength_um: float) -> tuple[Rays, list[Rays]]:
    tensors = surface_tensors(lens, torch.tensor(wavelength_um, dtype=torch.float64))
    height = torch.tensor(lens.aperture_value / 2, dtype=torch.float64)
    seen: list[Rays] = []
    zero = torch.zeros_like(height)
    return trace(tensors, launch(zero, height, zero, torch.inf), surface_rays=seen), seen


def test_al2550_marginal_ray_meets_the_heights_in_the_maker_s_file() -> None:
    """The .zmx stores ray heights to 13 digits; the focus is 63 femtometres wide."""
    landed, seen = _marginal(thorlabs_al2550(), 0.78)
    assert float(seen[1].y) == pytest.approx(10.97872284132, abs=PRINTED_DIGITS)
    assert abs(float(landed.y)) == pytest.approx(6.286e-8, abs=2e-12)


def test_al2550_focal_length_is_that_of_its_closed_form() -> None:
    data = paraxial_data(thorlabs_al2550())
    assert data.efl_mm == pytest.approx(50.00163205, abs=1e-8)
    assert data.bfl_mm == pytest.approx(46.03123353, abs=1e-8)


@pytest.mark.parametrize(
    ("wavelength_um", "radius_mm", "digits"),
    [
        (0.4861, 0.3584516158236, 6e-11),
        (0.5876, 0.2295233206, 6e-11),
        # a zone inside the pupil, which the reference searched on a coarse grid
        (0.6563, 0.1895069534, 2e-6),
    ],
)
def test_la1131_spots_are_as_wide_as_the_maker_s_file_says(
    wavelength_um: float, radius_mm: float, digits: float
) -> None:
    lens = thorlabs_la1131()
    tensors = surface_tensors(lens, torch.tensor(wavelength_um, dtype=torch.float64))
    height = torch.linspace(0, 1, 100_001, dtype=torch.float64) * lens.aperture_value / 2
    zero = torch.zeros((), dtype=torch.float64)
    landed = trace(tensors, launch(zero, height, zero, torch.inf))
    assert float(landed.y.abs().max()) == pytest.approx(radius_mm, abs=digits)


def test_la1131_convex_side_first_is_four_times_sharper() -> None:
    lens = replace(thorlabs_la1131(), aperture_value=12.5)
    front, back = lens.surfaces
    flipped = replace(
        lens,
        surfaces=(
            replace(back, glass="N-BK7-Schott", thickness_mm=5.34),
            Surface(curvature_per_mm=-front.curvature_per_mm, thickness_mm=1.0),
        ),
    )
    radii = [
        float(
            rms_radius(
                trace_spots(
                    with_paraxial_focus(one),
                    _slopes(0.0),
                    _waves(0.5875618),
                    hexapolar(6),
                    definition="paraxial",
                )
            )
        )
        for one in (lens, flipped)
    ]
    assert radii == pytest.approx([0.0681405909, 0.282154431], rel=1e-8)


@pytest.mark.parametrize(
    ("wavelength_um", "efl_mm", "bfl_mm"),
    [
        (0.4861327, 50.002685, 42.727934),
        (0.55, 49.987040, 42.731215),
        (0.5875618, 49.998893, 42.749827),
        (0.6562725, 50.035520, 42.794402),
    ],
)
def test_aca254_focal_lengths_by_colour(wavelength_um: float, efl_mm: float, bfl_mm: float) -> None:
    data = paraxial_data(thorlabs_aca254(), wavelength_um)
    assert (data.efl_mm, data.bfl_mm) == pytest.approx((efl_mm, bfl_mm), abs=2e-6)


def test_aca254_spots_grow_from_axis_to_20_degrees() -> None:
    spots = trace_spots(
        with_paraxial_focus(thorlabs_aca254()),
        _slopes(0, 10, 20),
        _waves(0.55),
        hexapolar(6),
        definition="paraxial",
    )
    found = rms_radius(spots)[:, 0].tolist()
    assert found == pytest.approx([3.5400e-3, 0.23028, 1.00138], rel=3e-5)


def test_cooke_triplet_first_order_data_equal_opticstudio() -> None:
    data = paraxial_data(cooke_triplet())
    assert data.efl_mm == pytest.approx(49.9997830714319, abs=1e-11)
    assert data.bfl_mm == pytest.approx(42.4148575590, abs=1e-9)
    assert data.ffl_mm == pytest.approx(-37.3456729744, abs=1e-9)
    assert data.entrance_pupil_mm == pytest.approx(11.5121586737, abs=1e-9)
    image_mm = cooke_triplet().surfaces[-1].thickness_mm
    assert data.exit_pupil_mm - image_mm == pytest.approx(-50.9613478024, abs=2e-7)
    assert data.exit_pupil_diameter_mm == pytest.approx(10.2337295640, abs=2e-7)
    assert data.stop_semi_diameter_mm == pytest.approx(3.80084966, abs=1e-8)
    assert data.f_number == pytest.approx(4.99997830714, abs=1e-10)


@pytest.mark.parametrize(
    ("hy", "px", "py", "x_mm", "y_mm"),
    [
        (0.0, 0.0, 1.0, 0.0, -0.0041956770813),
        (0.7, 0.0, 0.0, 0.0, 12.419794670773),
        (1.0, 0.0, 0.0, 0.0, 18.136025932761),
        (1.0, 0.0, 1.0, 0.0, 18.158527780121),
        (1.0, 0.0, -1.0, 0.0, 18.118974522683),
        (1.0, 1.0, 0.0, -0.016936433774, 18.131811492539),
        (0.7, 0.3, 0.6, -0.003327403658, 12.432590478652),
    ],
)
def test_cooke_triplet_real_rays_equal_optiland(
    hy: float, px: float, py: float, x_mm: float, y_mm: float
) -> None:
    # optiland's Hy scales the angle, not its tangent
    spots = trace_spots(
        cooke_triplet(),
        _slopes(20 * hy),
        _waves(0.55),
        PupilSamples(x=_waves(px), y=_waves(py)),
        definition="paraxial",
    )
    assert float(spots.x_mm) == pytest.approx(x_mm, abs=PRINTED_DIGITS)
    assert float(spots.y_mm) == pytest.approx(y_mm, abs=PRINTED_DIGITS)


def test_cooke_triplet_spots_in_the_paraxial_pupil_equal_optiland() -> None:
    spots = trace_spots(
        cooke_triplet(), _slopes(0, 14, 20), _waves(0.55), hexapolar(6), definition="paraxial"
    )
    expected = [0.004293689564258, 0.016786721284464, 0.012081348897955]
    assert rms_radius(spots)[:, 0].tolist() == pytest.approx(expected, abs=1e-12)


def test_cooke_triplet_spots_with_every_ray_aimed_at_the_stop() -> None:
    spots = trace_spots(cooke_triplet(), _slopes(0, 14, 20), _waves(0.55), hexapolar(6))
    even = replace(spots, weight=torch.ones_like(spots.weight))
    expected = [0.00420639, 0.01717004, 0.01543721]
    assert rms_radius(even)[:, 0].tolist() == pytest.approx(expected, abs=6e-9)


def test_chief_ray_passes_the_middle_of_the_stop() -> None:
    """The real chief ray at 20 degrees differs from the ray through the paraxial pupil centre."""
    assert float(chief_heights(cooke_triplet(), _slopes(20.0))) == pytest.approx(18.1385, abs=1e-4)


def _mean_square(tensors: SurfaceTensors, angle_deg: float) -> torch.Tensor:
    pupil = hexapolar(6)
    slope = _slopes(angle_deg)[0]
    y = pupil.y * 5.0 - 11.512158673746793 * slope
    landed = trace(tensors, launch(pupil.x * 5.0, y, slope, torch.inf))
    dx, dy = landed.x - landed.x.mean(), landed.y - landed.y.mean()
    return (dx**2 + dy**2).mean()


GRADIENTS = {
    0.0: {
        "value": 1.84357700742e-5,
        "curvature": (
            -0.054625949,
            0.048854478,
            -0.017548957,
            0.021275447,
            -0.032606622,
            0.020337519,
        ),
        "thickness": (
            *(-4.2205771e-5, -7.2457084e-5, -9.2110767e-6),
            *(1.6407017e-5, 8.7414201e-6, -4.2614468e-5),
        ),
        "conic": (
            *(2.698029e-4, 2.7891622e-8, -1.0664608e-4),
            *(-1.3087121e-4, 2.957118e-6, 2.8547329e-4),
        ),
        "r4": (20.578008, -18.458625, 8.774443, -8.1099159, 11.899625, -12.663872),
    },
    14.0: {
        "value": 2.81794011482e-4,
        "curvature": (-0.74480634, 0.88820343, -0.4907463, 0.50518207, -0.67989624, 0.52034661),
        "thickness": (
            *(-4.4225071e-4, -1.1700077e-3, 6.8345127e-4),
            *(-1.7357126e-4, 2.0451461e-4, -4.2825998e-4),
        ),
        "conic": (
            *(-2.1118308e-3, -2.2803944e-7, 2.5750312e-4),
            *(3.6589751e-4, -2.6151919e-5, -2.4101216e-3),
        ),
        "r4": (-148.36176, 150.89644, -21.719329, 23.314099, -104.96985, 98.228392),
    },
    20.0: {
        "value": 1.45958991194e-4,
        "curvature": (1.1976966, -1.1615621, 0.75971808, -0.74638768, 0.90326612, -0.8883692),
        "thickness": (
            *(8.7406331e-4, 1.6833539e-3, -2.0607728e-4),
            *(3.6296681e-4, 2.9651601e-6, 7.3666746e-4),
        ),
        "conic": (
            *(1.3575632e-3, 1.0018282e-7, -1.9295265e-4),
            *(-2.4209284e-4, 9.4232981e-6, 1.2898734e-3),
        ),
        "r4": (116.74101, -66.335694, 16.582592, -15.846766, 38.460403, -65.986386),
    },
}


@pytest.mark.parametrize("angle_deg", [0.0, 14.0, 20.0])
def test_cooke_triplet_gradients_equal_fourth_order_differences(angle_deg: float) -> None:
    tensors = surface_tensors(cooke_triplet(), torch.tensor(0.55, dtype=torch.float64))
    leaves = {
        "curvature": tensors.curvature_per_mm.clone().requires_grad_(),
        "thickness": tensors.thickness_mm.clone().requires_grad_(),
        "conic": tensors.conic.clone().requires_grad_(),
        "r4": torch.zeros(6, 2, dtype=torch.float64).requires_grad_(),
    }
    free = replace(
        tensors,
        curvature_per_mm=leaves["curvature"],
        thickness_mm=leaves["thickness"],
        conic=leaves["conic"],
        even_asphere=leaves["r4"],
        aspheric=(True,) * 6,
    )
    value = _mean_square(free, angle_deg)
    value.backward()
    expected = GRADIENTS[angle_deg]
    assert float(value.detach()) == pytest.approx(expected["value"], rel=1e-10)
    for name, leaf in leaves.items():
        assert leaf.grad is not None
        found = leaf.grad[:, 1] if name == "r4" else leaf.grad
        wanted = torch.tensor(expected[name], dtype=torch.float64)
        # printed to about 7 digits, small components with fewer
        scale = wanted.abs().max()
        assert float((found - wanted).abs().max() / scale) < GRADIENT_TOLERANCE, name


def test_r2_term_of_an_asphere_counts_in_the_focal_length() -> None:
    """f = 1 / ((n - 1) (c + 2 a2)) for a convex-plano singlet; some programs forget a2."""
    lens = Lens(
        name="a2",
        surfaces=(
            Surface(
                curvature_per_mm=1 / 20,
                thickness_mm=7.0,
                glass="N-BK7-Schott",
                even_asphere=(-2.248851e-4, -4.690412e-6),
            ),
            Surface(curvature_per_mm=0.0, thickness_mm=20.0),
        ),
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=1.0,
    )
    tensors = surface_tensors(lens, torch.tensor(0.5875618, dtype=torch.float64))
    index = float(tensors.index[1])
    expected = 1 / ((index - 1) * (1 / 20 - 2 * 2.248851e-4))
    assert float(focal_lengths(tensors)[0]) == pytest.approx(expected, rel=1e-13)
    zero = torch.zeros((), dtype=torch.float64)
    low = torch.tensor(0.01, dtype=torch.float64)
    landed = trace(tensors, launch(zero, low, zero, torch.inf))
    real = float(0.01 / -(landed.m / landed.n))
    assert real == pytest.approx(expected, rel=1e-6)
