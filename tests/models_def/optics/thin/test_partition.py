"""The partitioned profile of eq. (3.4)."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.thin.ideal import ideal_phase
from camkit.models_def.optics.thin.partition import VirtualApertures, partitioned_phase


def test_one_direction_gets_its_ideal_phase() -> None:
    axis = VirtualApertures(field_angles_rad=(0.0,), centres_mm=(0.0,), radius_mm=5.0)
    terms = partitioned_phase(axis, 43.0, 0.55, 5)
    radius = np.linspace(-5, 5, 51)
    found = sum(a * radius ** (2 * j) for j, a in enumerate(terms, start=1))
    assert np.abs(found - ideal_phase(radius, 0.0, 0.0, 43.0, 0.55)).max() < 0.01


def test_no_other_profile_has_less_phase_error_in_the_virtual_apertures() -> None:
    """A slow merit, with the best constant of each direction, grows on all sides."""
    angles, centres = (0.0, 0.2, 0.4), (0.0, 3.0, 6.0)
    apertures = VirtualApertures(field_angles_rad=angles, centres_mm=centres, radius_mm=3.0)
    terms = partitioned_phase(apertures, 43.0, 0.55, 3)

    def merit(trial: np.ndarray) -> float:
        total = 0.0
        for angle, centre in zip(angles, centres, strict=True):
            across = np.linspace(-3.0, 3.0, 41)
            radius = centre + across
            weight = np.sqrt(np.clip(9.0 - across**2, 0, None))
            wanted = ideal_phase(radius, angle, 43.0 * np.tan(angle), 43.0, 0.55)
            error = sum(a * radius ** (2 * j) for j, a in enumerate(trial, start=1)) - wanted
            error = error - np.average(error, weights=weight)
            total += float((weight * error**2).sum())
        return total

    least = merit(terms)
    for number in range(3):
        for sign in (1, -1):
            moved = terms.copy()
            moved[number] += sign * 1e-3 / 9.0 ** (2 * number + 2) * 100
            assert merit(moved) > least


def test_directions_without_a_disc_are_refused() -> None:
    with pytest.raises(ContractError, match="centre for every direction"):
        VirtualApertures(field_angles_rad=(0.0, 0.1), centres_mm=(0.0,), radius_mm=3.0)
    with pytest.raises(ContractError, match="radius > 0"):
        VirtualApertures(field_angles_rad=(0.0,), centres_mm=(0.0,), radius_mm=0.0)
