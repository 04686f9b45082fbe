"""How the array samples: against sums written out, means, the light collected."""

import numpy as np
import pytest
import torch

from camkit.calibration.dots import ACTIVE_UM
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.sampling import (
    FINE_PITCH_UM,
    GAUSSIAN_SIGMA,
    MODES,
    PITCH_UM,
    Sampling,
    gaussian_psf,
    make_sampling,
    see_through,
)

RNG = np.random.default_rng(7)
POINT, BOX = (make_sampling(mode).kernel for mode in ("low_fill", "full_fill"))


def _kernel(seed: int) -> np.ndarray:
    kernel = np.random.default_rng(seed).random((11, 11)).astype(np.float32)
    return kernel / kernel.sum()


def _scattered(fine: np.ndarray, kernel: np.ndarray, phase: int) -> np.ndarray:
    """Every sub-pixel throws its light on its neighbours; one sub-pixel of each pixel counts."""
    wide = np.pad(fine, 10, mode="edge")
    light = np.zeros((wide.shape[0] + 10, wide.shape[1] + 10))
    for y in range(wide.shape[0]):
        for x in range(wide.shape[1]):
            light[y : y + 11, x : x + 11] += wide[y, x] * kernel
    # the middle of the kernel lies 5 beyond its corner
    inside = light[15 : 15 + fine.shape[0], 15 : 15 + fine.shape[1]]
    return inside[phase::4, phase::4]


@pytest.mark.parametrize("phase", [0, 2, 3])
def test_a_kernel_without_symmetry_is_scattered_and_the_border_goes_on(phase: int) -> None:
    fine, kernel = RNG.random((16, 24)).astype(np.float32), _kernel(phase)
    sampling = make_sampling("learned", kernel=kernel, phase=phase)
    found = sampling.see(torch.from_numpy(fine)[None, None])[0, 0].numpy()
    np.testing.assert_allclose(found, _scattered(fine, kernel, phase), rtol=1e-5)


@pytest.mark.parametrize("phase", range(4))
def test_low_fill_takes_one_sub_pixel_and_full_fill_the_mean(phase: int) -> None:
    fine = torch.rand(2, 1, 16, 12)
    low = make_sampling("low_fill", phase=phase).see(fine)
    assert torch.allclose(low, fine[..., phase::4, phase::4], atol=1e-6)
    full = make_sampling("full_fill", phase=phase).see(fine)
    assert torch.allclose(full, torch.nn.functional.avg_pool2d(fine, 4), atol=1e-6)


def test_a_pixel_that_sees_all_sub_pixels_collects_sixteen_times_the_light() -> None:
    factors = {
        mode: make_sampling(mode, kernel=_kernel(1) if mode == "learned" else None).light
        for mode in MODES
    }
    assert factors == {"low_fill": 1, "full_fill": 16, "gaussian": 1, "learned": 1}


def test_the_fine_grid_is_a_quarter_of_a_pixel_and_the_active_area_one_of_its_cells() -> None:
    assert PITCH_UM / FINE_PITCH_UM == 4
    assert ACTIVE_UM < FINE_PITCH_UM
    side_um = 11 * FINE_PITCH_UM
    assert side_um == 412.5  # thesis 4.3.1


def test_the_gaussian_has_the_width_of_the_thesis_and_unit_sum() -> None:
    sigma_px = GAUSSIAN_SIGMA / 4
    assert sigma_px == pytest.approx(0.459, abs=5e-4)
    kernel = gaussian_psf(1.3)
    assert kernel.sum() == pytest.approx(1, abs=1e-6)
    line = kernel[5]
    assert np.log(line[5] / line[8]) == pytest.approx(0.5 * (3 / 1.3) ** 2, rel=1e-4)
    np.testing.assert_array_equal(kernel, kernel.T)


def test_an_even_scene_is_seen_even_through_any_kernel() -> None:
    for kernel in (POINT, BOX, gaussian_psf(), _kernel(5)):
        seen = see_through(torch.full((1, 1, 8, 8), 0.7), torch.from_numpy(kernel))
        assert torch.allclose(seen, torch.full((1, 1, 2, 2), 0.7), atol=1e-6)


def test_gradients_reach_the_kernel() -> None:
    kernel = torch.from_numpy(gaussian_psf()).double().requires_grad_()
    fine = torch.rand(1, 1, 8, 8, dtype=torch.float64)
    assert torch.autograd.gradcheck(lambda k: see_through(fine, k), (kernel,))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"mode": "round"}, "must be one of low_fill"),
        ({"mode": "learned"}, "kernel belongs to the sampling learned"),
        ({"mode": "low_fill", "kernel": POINT}, "kernel belongs to the sampling learned"),
        ({"mode": "low_fill", "sigma": 1.0}, "sigma belongs to the sampling gaussian"),
        ({"mode": "gaussian", "sigma": -1.0}, "must be a number > 0"),
        ({"mode": "low_fill", "phase": 4}, "phase must be one of 0..3"),
        ({"mode": "learned", "kernel": np.ones((11, 11), np.float32)}, "of unit sum"),
        ({"mode": "learned", "kernel": -POINT}, ">= 0"),
        ({"mode": "learned", "kernel": np.ones((9, 9), np.float32) / 81}, r"\(11, 11\)"),
        ({"mode": "learned", "kernel": np.full((11, 11), np.nan, np.float32)}, "finite"),
    ],
)
def test_what_cannot_be_is_refused(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(ContractError, match=message):
        make_sampling(**arguments)  # type: ignore[arg-type]


def test_a_mode_that_nobody_made_is_refused_too() -> None:
    with pytest.raises(ContractError, match="must be one of low_fill"):
        Sampling(mode="round", kernel=POINT)  # type: ignore[arg-type]


def test_a_picture_of_broken_pixels_is_refused() -> None:
    with pytest.raises(ContractError, match="whole 4x4 pixels"):
        make_sampling("low_fill").see(torch.rand(1, 1, 10, 8))
