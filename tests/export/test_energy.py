"""Figures of a PSF agree with closed forms."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.export.energy import energy_diameter_px, modulation


def _gaussian(sigma: float, side: int = 81, shift: int = 0) -> np.ndarray:
    at = np.arange(side) - side // 2 - shift
    kernel = np.exp(-np.add.outer(at**2, at**2) / (2 * sigma**2))
    return (kernel / kernel.sum()).astype(np.float32)


@pytest.mark.parametrize("share", [0.5, 0.8, 0.95])
def test_the_energy_circle_of_a_gaussian_is_its_closed_form(share: float) -> None:
    expected = 2 * 6.0 * np.sqrt(-2 * np.log(1 - share))
    assert energy_diameter_px(_gaussian(6.0), share) == pytest.approx(expected, abs=1.0)


def test_the_circle_is_drawn_about_the_centroid() -> None:
    centred, moved = (energy_diameter_px(_gaussian(3.0, shift=s), 0.9) for s in (0, 12))
    assert moved == pytest.approx(centred, abs=0.01)


def test_the_modulation_of_a_gaussian_is_a_gaussian() -> None:
    expected = np.exp(-2 * (np.pi * 2.0 * 0.1) ** 2)
    assert modulation(_gaussian(2.0), 0.1) == pytest.approx(expected, abs=1e-3)


def test_a_delta_passes_every_frequency() -> None:
    delta = np.zeros((9, 9), dtype=np.float32)
    delta[4, 4] = 1
    assert modulation(delta, 0.37) == pytest.approx(1.0)


def test_a_share_outside_0_to_1_is_refused() -> None:
    with pytest.raises(ContractError, match="share"):
        energy_diameter_px(_gaussian(2.0), 1.0)
