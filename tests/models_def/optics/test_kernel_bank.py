from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import (
    USUAL_EFL_MM,
    ChannelResponse,
    colour_kernels,
    fabricated_copies,
    focused_copies,
    gaussian_response,
    usual_errors,
    wavelength_grid,
)
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import read_prescription
from camkit.models_def.optics.scaling import scale_to_efl
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors

DUET = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"


def test_gaussian_response_has_its_width_and_sums_to_one() -> None:
    waves = np.linspace(0.3, 0.9, 6001)
    response = gaussian_response(waves)
    assert response.response.sum(1) == pytest.approx(np.ones(3))
    for row, centre in zip(response.response, (0.600, 0.540, 0.460), strict=True):
        above = waves[row >= row.max() / 2]
        assert above.mean() == pytest.approx(centre, abs=2e-4)
        assert above[-1] - above[0] == pytest.approx(0.090, abs=4e-4)


def test_unnormalised_response_is_refused() -> None:
    with pytest.raises(ContractError, match="sum to 1"):
        ChannelResponse(wavelengths_um=np.ones(2), response=np.ones((3, 2)), source="x")
    with pytest.raises(ContractError, match="must be"):
        ChannelResponse(wavelengths_um=np.ones(2), response=np.ones((3, 3)) / 3, source="x")


def test_kernels_of_every_copy_differ_and_hold_its_light() -> None:
    response, heights_mm = gaussian_response(wavelength_grid(3)), np.array([0.0, 10.0])
    nominal, *copies = (
        colour_kernels(copy, response, heights_mm, size_px=65, pitch_um=5.96, rays=300)
        for copy in focused_copies(read_prescription(DUET), 3, 4)
    )
    for kernels, kept in (nominal, *copies):
        assert kernels.shape == (2, 3, 65, 65)
        assert kernels.dtype == np.float32
        assert kernels.sum((-2, -1)) == pytest.approx(np.ones((2, 3)), abs=1e-5)
        assert kept > 0.999
    for kernels, _ in copies:
        assert np.abs(kernels - nominal[0]).sum() > 0.1


def test_copies_do_not_depend_on_how_many_are_made() -> None:
    lens = read_prescription(DUET)
    assert fabricated_copies(lens, 3, 9)[2] == fabricated_copies(lens, 5, 9)[2]


def test_focused_copies_keep_the_designed_distance_from_their_focus() -> None:
    """All that remains of the focus is its own error of +-0.02 mm."""
    lens = read_prescription(DUET)

    def defocus_mm(copy_index: int, made: tuple) -> float:
        copy = made[copy_index]
        return copy.surfaces[-1].thickness_mm - paraxial_data(copy).bfl_mm

    raw, focused = fabricated_copies(lens, 6, 2), focused_copies(lens, 6, 2)
    moved = [abs(defocus_mm(i, focused) - defocus_mm(0, focused)) for i in range(1, 6)]
    drift = [abs(defocus_mm(i, raw) - defocus_mm(0, raw)) for i in range(1, 6)]
    assert max(moved) <= 0.02 + 1e-12
    assert max(drift) > 0.05


def test_a_small_lens_has_the_copies_of_its_enlargement_on_smaller_pixels() -> None:
    response, heights_mm = gaussian_response(wavelength_grid(3)), np.array([0.0, 8.0])
    large = scale_to_efl(read_prescription(DUET), USUAL_EFL_MM)
    small = scale_to_efl(large, USUAL_EFL_MM / 10)
    (_, copy), (_, tiny) = (focused_copies(lens, 2, 7) for lens in (large, small))
    (of_copy, _), (of_tiny, _) = (
        colour_kernels(a, response, heights_mm / s, size_px=65, pitch_um=6.0 / s, rays=300)
        for a, s in ((copy, 1), (tiny, 10))
    )
    assert of_tiny == pytest.approx(of_copy, abs=1e-5)


def test_errors_of_longer_lenses_are_those_of_the_usual_length() -> None:
    lens = read_prescription(DUET)
    assert usual_errors(scale_to_efl(lens, 200.0)) == FabricationErrors()
    assert usual_errors(scale_to_efl(lens, 20.0)).thickness_mm == pytest.approx(0.015)
    assert usual_errors(scale_to_efl(lens, 20.0)).index == FabricationErrors().index
