"""Copies of a PSF scatter as its uncertainty says, and the estimate finds what scatters."""

import numpy as np
import pytest

from camkit.calibration.psf_import.kernel_uncertainty import drawn_psf, estimate_uncertainty
from camkit.errors import ContractError
from camkit.models_def.optics.measured import measured_psf
from camkit.psf import PsfUncertainty

SIDE = 25
X_MM, Y_MM = np.linspace(-4, 4, 6), np.linspace(-3, 3, 5)


def field(width_error=0.0, shift_error=0.0, noise=0.0, seed=1):
    """Gaussians that widen smoothly over the field, with lateral colour, and errors on them."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:SIDE, :SIDE] - SIDE // 2
    kernels = np.empty((Y_MM.size, X_MM.size, 3, SIDE, SIDE))
    for row, column, colour in np.ndindex(kernels.shape[:3]):
        place = np.array([X_MM[column], Y_MM[row]])
        width = (1.8 + 0.02 * place @ place) * np.exp(rng.normal() * width_error)
        dx, dy = 0.1 * (colour - 1) * place + rng.normal(size=2) * shift_error
        kernel = np.exp(-((x - dx) ** 2 + (y - dy) ** 2) / (2 * width**2))
        kernels[row, column, colour] = np.clip(kernel + noise * rng.normal(size=kernel.shape), 0, 9)
    return measured_psf(
        kernels, pixel_pitch_um=4.0, wavelengths_um=(0.46, 0.54, 0.6), grid_mm=(X_MM, Y_MM)
    )


def centres(psf):
    offsets = np.arange(SIDE) - SIDE // 2
    kernels = psf.kernels[:, 0].astype(float)
    return np.stack([kernels.sum(-2) @ offsets, kernels.sum(-1) @ offsets], axis=-1)


def widths(psf):
    """Root of the second moment across columns."""
    offsets = np.arange(SIDE) - SIDE // 2
    return np.sqrt(psf.kernels[:, 0].sum(-2) @ offsets**2 - centres(psf)[..., 0] ** 2)


def copies(uncertainty, count=24):
    psf, rng = field(), np.random.default_rng(5)
    return psf, [drawn_psf(psf, uncertainty, rng) for _ in range(count)]


def test_colours_are_shifted_against_each_other_and_the_picture_stays():
    psf, drawn = copies(PsfUncertainty(noise=0, shift_px=0.1, width=0))
    shifts = np.stack([centres(copy) - centres(psf) for copy in drawn])
    assert np.abs(shifts.mean(axis=2)).max() < 2e-3
    # a third of the variance is that of the mean, which is taken off
    assert shifts.std() == pytest.approx(0.1 * np.sqrt(2 / 3), rel=0.05)


def test_all_kernels_of_a_copy_are_wider_or_narrower_by_one_factor():
    psf, drawn = copies(PsfUncertainty(noise=0, shift_px=0, width=0.05), 40)
    factors = np.stack([widths(copy) / widths(psf) for copy in drawn])
    assert np.ptp(np.log(factors), axis=(1, 2)).max() < 0.03  # large ones leave the window
    assert np.log(factors[:, 0, 0]).std() == pytest.approx(0.05, rel=0.3)


def test_noise_is_relative_at_the_peak_and_falls_with_the_root_of_the_light():
    psf, drawn = copies(PsfUncertainty(noise=0.05, shift_px=0, width=0))
    kernels = np.stack([copy.kernels for copy in drawn])[:, :, 0]
    gaps, nominal = kernels - psf.kernels[:, 0], psf.kernels[:, 0]
    peaks = nominal.max(axis=(-2, -1), keepdims=True)
    for low, high in ((0.5, 1.0), (0.1, 0.2)):
        inside = (nominal >= low * peaks) & (nominal <= high * peaks)
        expected = 0.05 * np.sqrt(nominal * peaks)
        assert (gaps / expected)[:, inside].std() == pytest.approx(1, rel=0.1)


def test_copies_are_kernels_and_the_same_seed_draws_the_same():
    _, drawn = copies(PsfUncertainty(noise=0.1, shift_px=0.3, width=0.1), 3)
    again = copies(PsfUncertainty(noise=0.1, shift_px=0.3, width=0.1), 3)[1]
    assert all(np.array_equal(a.kernels, b.kernels) for a, b in zip(drawn, again, strict=True))
    assert not np.array_equal(drawn[0].kernels, drawn[1].kernels)


def test_no_uncertainty_leaves_the_kernels():
    psf, drawn = copies(PsfUncertainty(noise=0, shift_px=0, width=0), 1)
    np.testing.assert_allclose(drawn[0].kernels, psf.kernels, atol=1e-7)


def test_a_smooth_field_has_the_least_uncertainty():
    assert estimate_uncertainty(field(), 0.0) == PsfUncertainty()


def test_what_is_not_smooth_over_the_field_is_found():
    assert estimate_uncertainty(field(width_error=0.06), 0.0).width == pytest.approx(0.06, rel=0.35)
    shifted = estimate_uncertainty(field(shift_error=0.2), 0.0)
    assert shifted.shift_px == pytest.approx(0.2 * np.sqrt(2 / 3), rel=0.35)
    assert estimate_uncertainty(field(), 0.03).noise == 0.03


@pytest.mark.parametrize("numbers", [(-0.1, 0, 0), (0, 1.0, 0), (0, 0, float("nan"))])
def test_numbers_out_of_range_are_refused(numbers):
    noise, shift_px, width = numbers
    with pytest.raises(ContractError, match="NOISE,SHIFT_PX,WIDTH"):
        PsfUncertainty(noise=noise, shift_px=shift_px, width=width)
