"""Dots drawn where a lattice has them, and the PSF that an array sees of them."""

import numpy as np
import pytest

from camkit.bundle.psf_file import psf_to_bytes
from camkit.calibration.dots import dots_psf, see_dots
from camkit.calibration.measured import MeasuredPsf, RedSamples
from camkit.errors import ContractError, DecodeError
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion

PITCH_UM, SPACING_UM = 3.45, 37.5
RNG = np.random.default_rng(0)
KERNEL = np.exp(-0.5 * ((np.indices((11, 11)) - 5) ** 2).sum(0) / 1.84**2) * RNG.uniform(
    0.5, 1, (11, 11)
)
KERNEL /= KERNEL.sum()


def _photograph(
    *,
    kernel: np.ndarray = KERNEL,
    at_um: tuple[float, float] = (0.0, 0.0),
    spacing_um: float = SPACING_UM,
    turn_rad: float = 0.0,
    side: tuple[int, int] = (181, 193),
    width_um: float = 2.5,
) -> np.ndarray:
    """Draw dots of a kernel as Gaussians, its middle at a place from that of the picture."""
    steps = (np.arange(11) - 5) * spacing_um
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    light = np.zeros(side)
    y, x = ((np.arange(n) - (n - 1) / 2) * PITCH_UM for n in side)
    for i, down in enumerate(steps):
        for j, right in enumerate(steps):
            dy = y - at_um[0] - (cos * down + sin * right)
            dx = x - at_um[1] - (cos * right - sin * down)
            drawn = np.exp(-0.5 * (dy[:, None] ** 2 + dx[None, :] ** 2) / width_um**2)
            light += kernel[i, j] * drawn / (2 * np.pi * width_um**2) * PITCH_UM**2
    return light


@pytest.mark.parametrize("at_um", [(0.0, 0.0), (11.3, -7.9), (-18.7, 18.7), (60.0, -45.0)])
def test_dots_anywhere_give_their_kernel(at_um: tuple[float, float]) -> None:
    seen = see_dots(_photograph(at_um=at_um), PITCH_UM, KERNEL)
    np.testing.assert_allclose(seen.kernel, KERNEL, atol=2e-4 * KERNEL.max())
    assert seen.place_um == pytest.approx(at_um, abs=0.01)
    assert seen.share == pytest.approx(1, abs=1e-3)
    assert seen.likeness == pytest.approx(1, abs=1e-6)
    # a Gaussian of 2.5 um keeps exp(-2 pi^2 (2.5 / 37.5)^2) of its period
    assert seen.modulation == pytest.approx(np.exp(-2 * (np.pi * 2.5 / 37.5) ** 2), abs=5e-3)


def test_few_dots_find_their_place_in_a_wide_psf() -> None:
    lone = np.zeros((11, 11))
    lone[2:4, 7:9] = [[0.3, 0.2], [0.1, 0.4]]
    photograph = _photograph(kernel=lone)
    rows, columns = (np.flatnonzero(photograph.sum(1 - n) > 1e-9) for n in (0, 1))
    crop = photograph[rows[0] - 3 : rows[-1] + 4, columns[0] - 3 : columns[-1] + 4]
    seen = see_dots(crop, PITCH_UM, lone)
    np.testing.assert_allclose(seen.kernel, lone, atol=1e-3)


def test_the_design_tells_which_dot_is_the_middle() -> None:
    wrong = np.roll(KERNEL, (1, 0), (0, 1))
    wrong[0] = 0
    seen = see_dots(_photograph(), PITCH_UM, wrong)
    assert seen.place_um == pytest.approx((-SPACING_UM, 0), abs=0.01)


def test_a_plate_turned_by_two_degrees_is_still_seen() -> None:
    seen = see_dots(_photograph(turn_rad=np.deg2rad(2)), PITCH_UM, KERNEL)
    np.testing.assert_allclose(seen.kernel, KERNEL, atol=0.01 * KERNEL.max())
    turned = see_dots(_photograph(turn_rad=np.deg2rad(6)), PITCH_UM, KERNEL)
    assert turned.share < 0.99 * seen.share


def test_dots_farther_apart_than_the_array_are_lost_to_it() -> None:
    seen = see_dots(_photograph(spacing_um=39.1), PITCH_UM, KERNEL)
    assert seen.share == pytest.approx(1, abs=0.01)
    assert see_dots(_photograph(spacing_um=41.5), PITCH_UM, KERNEL).share < 0.97


@pytest.mark.parametrize(
    ("light", "pitch_um", "told"),
    [
        (np.full((9, 9), np.nan), PITCH_UM, "must be finite"),
        (np.ones((3, 9, 9)), PITCH_UM, "must be finite"),
        (_photograph(), 12.0, "too coarse for active areas of 30 um"),
    ],
)
def test_what_is_no_fine_photograph_is_refused(
    light: np.ndarray, pitch_um: float, told: str
) -> None:
    with pytest.raises(ContractError, match=told):
        see_dots(light, pitch_um, KERNEL)


def test_light_that_is_no_dots_is_refused() -> None:
    with pytest.raises(DecodeError, match="needs light"):
        see_dots(np.zeros((60, 60)), PITCH_UM, KERNEL)
    with pytest.raises(DecodeError, match=r"no dots every 37.5 um"):
        see_dots(_photograph(width_um=20.0), PITCH_UM, KERNEL)


def _psf(kernels: np.ndarray, pitch_um: float) -> FrozenPsf:
    return FrozenPsf(
        kernels=np.ascontiguousarray(
            (kernels / kernels.sum((-2, -1), keepdims=True))[None, None], np.float32
        ),
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([1350.0]),
        wavelengths_um=np.array([0.46, 0.54, 0.60][-len(kernels) :]),
        pixel_pitch_um=pitch_um,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )


def test_a_point_on_fine_pixels_becomes_the_psf_of_the_array_by_its_red() -> None:
    red = _photograph(side=(181, 181)) - 1e-9
    measured = MeasuredPsf(
        psf=_psf(np.ones((3, 5, 5)), PITCH_UM),
        red=RedSamples(light=red, pitch_um=PITCH_UM),
        centre_px=(90.0, 90.0),
        colours=(),
        fields=(),
        notes=(),
    )
    made, seen = dots_psf(measured, _psf(KERNEL[None], SPACING_UM))
    assert psf_to_bytes(made)
    assert made.kernels.shape == (1, 1, 1, 11, 11)
    assert (made.pixel_pitch_um, made.depths_mm.tolist()) == (SPACING_UM, [1350.0])
    np.testing.assert_allclose(made.kernels[0, 0, 0], KERNEL, atol=3e-4 * KERNEL.max())
    assert seen.to_json()["likeness"] == pytest.approx(1, abs=1e-6)
    with pytest.raises(ContractError, match="must be one square kernel"):
        dots_psf(measured, _psf(np.stack([KERNEL] * 3), SPACING_UM))
