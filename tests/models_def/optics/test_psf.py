import math
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens, Surface, read_prescription, with_focus_shift
from camkit.models_def.optics.psf import energy_diameter, splat, trace_psf
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import (
    Spots,
    chief_heights,
    slopes_for_heights,
    trace_spots,
)

DUET = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"
PITCH_UM = 5.96


def _f64(*values: float) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def _spots(x_px: float, y_px: float) -> Spots:
    shape = (1, 1, 1)
    return Spots(
        x_mm=torch.full(shape, x_px * PITCH_UM / 1000, dtype=torch.float64),
        y_mm=torch.full(shape, 7.0 + y_px * PITCH_UM / 1000, dtype=torch.float64),
        weight=torch.ones(shape, dtype=torch.float64),
        chief_y_mm=_f64(7.0),
        fate=torch.zeros(shape, dtype=torch.int8),
    )


def _perfect_lens() -> Lens:
    """A plano-hyperbolic lens: no aberration on the axis; focal length 50, stop in front."""
    glass = "N-BK7-Schott"
    index = 1.5168000345
    return Lens(
        name="perfect",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=1.0),
            Surface(curvature_per_mm=0.0, thickness_mm=4.0, glass=glass),
            Surface(curvature_per_mm=-1 / (50 * (index - 1)), thickness_mm=50.0, conic=-(index**2)),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=6.25,
        reference_wavelength_um=0.5875618,
    )


def test_ray_at_a_fraction_of_a_pixel_is_shared_like_a_tent() -> None:
    kernel = splat(_spots(1.25, -0.5), 9, PITCH_UM).kernels[0, 0]
    # the mirrored half doubles it at -1.25
    expected = torch.zeros(9, 9, dtype=torch.float64)
    for row in (3, 4):
        expected[row, 5] += 0.5 * 0.75 / 2
        expected[row, 6] += 0.5 * 0.25 / 2
        expected[row, 3] += 0.5 * 0.75 / 2
        expected[row, 2] += 0.5 * 0.25 / 2
    assert torch.allclose(kernel, expected, rtol=0, atol=1e-10)


def test_light_outside_the_window_is_counted_as_lost() -> None:
    near, far = _spots(0, 0), _spots(0, 40)
    both = replace(
        near,
        x_mm=torch.cat([near.x_mm, far.x_mm], -1),
        y_mm=torch.cat([near.y_mm, far.y_mm], -1),
        weight=torch.tensor([[[3.0, 1.0]]], dtype=torch.float64),
    )
    assert float(splat(both, 9, PITCH_UM).energy_kept) == pytest.approx(0.75, abs=1e-12)


@pytest.mark.parametrize("size_px", [0, 8, -1])
def test_even_kernel_side_is_refused(size_px: int) -> None:
    with pytest.raises(ContractError, match="odd"):
        splat(_spots(0, 0), size_px, PITCH_UM)


def test_kernel_without_light_is_refused() -> None:
    with pytest.raises(ContractError, match="no light"):
        splat(_spots(0, 100), 9, PITCH_UM)


def test_kernels_sum_to_one_and_are_mirror_symmetric() -> None:
    lens = read_prescription(DUET)
    kernels = trace_psf(lens, _f64(0, 10, 21), _f64(0.45, 0.54), 129, PITCH_UM, rays=1000).kernels
    assert kernels.shape == (3, 2, 129, 129)
    assert torch.allclose(kernels.sum((-2, -1)), torch.ones(3, 2, dtype=torch.float64))
    assert torch.equal(kernels, kernels.flip(-1))
    assert bool((kernels >= 0).all())


def test_perfect_lens_puts_all_light_on_the_middle_pixel() -> None:
    traced = trace_psf(_perfect_lens(), _f64(0), _f64(0.5875618), 5, PITCH_UM, rays=200)
    assert float(traced.kernels[0, 0, 2, 2]) == pytest.approx(1, abs=1e-3)


def test_defocus_disc_has_the_size_of_the_cone() -> None:
    """A uniform disc of diameter shift / f-number: 95 % of its light lie within sqrt(0.95)."""
    lens = with_focus_shift(_perfect_lens(), 0.4)
    spots = trace_spots(lens, _f64(0), _f64(0.5875618), half_disc(4000))
    cone = 2 * 0.4 * math.tan(math.asin(6.25 / math.hypot(50.0, 6.25)))
    assert float(energy_diameter(spots)) == pytest.approx(cone * math.sqrt(0.95), rel=0.02)


def test_kernel_s_first_moment_is_the_offset_of_the_centroid_from_the_chief_ray() -> None:
    """Rows grow outward: blue, refracted differently, lands where the rays say."""
    lens = read_prescription(DUET)
    heights, waves = _f64(18.0), _f64(0.46, 0.54, 0.6)
    kernels = trace_psf(lens, heights, waves, 129, PITCH_UM, rays=2000).kernels[0]
    row = torch.arange(129, dtype=torch.float64) - 64
    found = (kernels.sum(-1) * row).sum(-1)
    spots = trace_spots(lens, slopes_for_heights(lens, heights), waves, half_disc(2000))
    assert float(spots.chief_y_mm) == pytest.approx(18.0, abs=1e-6)
    expected = (spots.y_mm[0] - 18.0).mean(-1) * 1000 / PITCH_UM
    assert torch.allclose(found, expected, rtol=0, atol=1e-6)
    assert float(found[2]) > float(found[0]) + 5


def test_outward_tilt_moves_the_kernel_outward() -> None:
    """Light that lands further from the axis than the chief ray lies in later rows."""
    kernel = splat(_spots(0, 3), 9, PITCH_UM).kernels[0, 0]
    assert int(kernel.sum(-1).argmax()) == 7


def test_splat_carries_gradients_to_the_ray_positions() -> None:
    x = torch.full((1, 1, 1), 0.001, dtype=torch.float64, requires_grad=True)
    spots = replace(_spots(0, 0.3), x_mm=x)
    row = torch.arange(9, dtype=torch.float64) - 4

    def second_moment(position: torch.Tensor) -> torch.Tensor:
        kernel = splat(replace(spots, x_mm=position), 9, PITCH_UM).kernels[0, 0]
        return (kernel.sum(0) * row.abs()).sum()

    (slope,) = torch.autograd.grad(second_moment(x), x)
    assert float(slope) == pytest.approx(1000 / PITCH_UM, rel=1e-9)


def test_slopes_are_found_for_sensor_heights() -> None:
    lens = read_prescription(DUET)
    heights = _f64(0, 5, 12, 21.49)
    landed = chief_heights(lens, slopes_for_heights(lens, heights))
    assert torch.allclose(landed, heights, rtol=0, atol=1e-8)


def test_unreachable_sensor_height_is_refused() -> None:
    with pytest.raises(
        ContractError, match=r"aimed to 7\d\.\d degrees = 4\d.* corner is at 200\.00 mm"
    ):
        slopes_for_heights(read_prescription(DUET), _f64(200.0))


def test_energy_kept_grows_with_the_window() -> None:
    lens = read_prescription(DUET)
    kept = [
        float(trace_psf(lens, _f64(21.0), _f64(0.54), side, PITCH_UM, rays=500).energy_kept)
        for side in (21, 61, 129)
    ]
    assert kept == sorted(kept)
    assert kept[-1] == pytest.approx(1)
