from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from camkit.errors import ContractError
from camkit.models_def.optics.distortion import (
    fit_distortion,
    ideal_heights,
    trace_distortion,
)
from camkit.models_def.optics.prescription import read_prescription

DUET = Path(__file__).resolve().parents[3] / "models_def" / "prescriptions" / "duet.toml"
HALF_DIAGONAL_MM = 21.489


@given(st.tuples(*[st.floats(-0.1, 0.1)] * 3), st.floats(0.8, 1.2))
def test_fit_recovers_known_coefficients(k: tuple[float, float, float], xi: float) -> None:
    ideal = np.linspace(1 / 16, 1, 16)
    wanted = xi * np.array([1, *k])
    distorted = (ideal[:, None] ** np.array([1, 3, 5, 7])) @ wanted
    assert fit_distortion(ideal, distorted) == pytest.approx(wanted, abs=1e-10)


def test_too_few_points_are_refused() -> None:
    with pytest.raises(ContractError, match="at least 4"):
        fit_distortion(np.ones(3), np.ones(3))


def test_fitted_polynomial_follows_the_chief_rays_of_duet() -> None:
    """To 0.01 pixel between the 16 points it was fitted to."""
    lens = read_prescription(DUET)
    model = trace_distortion(lens, HALF_DIAGONAL_MM)
    heights = np.linspace(0.3, 21.4, 37)
    ideal = ideal_heights(lens, heights) / HALF_DIAGONAL_MM
    found = (ideal[:, None] ** np.array([1, 3, 5, 7])) @ model.coefficients[1]
    assert np.abs(found * HALF_DIAGONAL_MM - heights).max() < 0.01 * 5.96e-3
    assert np.array_equal(model.coefficients[0], model.coefficients[2])


def test_duet_s_distortion_stays_within_six_per_cent() -> None:
    heights = np.linspace(1, HALF_DIAGONAL_MM, 20)
    share = heights / ideal_heights(read_prescription(DUET), heights) - 1
    assert float(np.abs(share).max()) < 0.06
