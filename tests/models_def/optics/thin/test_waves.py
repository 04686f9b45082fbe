"""Waves against Airy's pattern, and grooves of whole and of half waves."""

import math
from dataclasses import replace

import pytest
from scipy.special import j0, j1

from camkit.errors import ContractError
from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.thin.waves import wave_shares
from tests.thin_factory import index_at, perfect_lens

WAVE_UM = 0.55


def test_a_perfect_lens_has_the_encircled_energy_of_airy() -> None:
    """1 - J0(v)^2 - J1(v)^2, v = 2 pi NA r / wavelength (Born and Wolf, 8.5.2)."""
    radii_mm = (0.02, 0.034, 0.06, 0.2)
    found = wave_shares(perfect_lens(500.0, 5.0), 0.0, WAVE_UM, 0.0, radii_mm)
    for share, radius_mm in zip(found, radii_mm, strict=True):
        v = 2 * math.pi * 0.01 * radius_mm / (WAVE_UM * 1e-3)
        assert share == pytest.approx(1 - j0(v) ** 2 - j1(v) ** 2, abs=1e-3)


def test_a_finer_lattice_says_the_same() -> None:
    lens = perfect_lens(50.0, 5.0, defocus_mm=0.3)
    coarse, fine = (
        wave_shares(lens, 0.0, WAVE_UM, 0.0, (0.03,), lattice_mm=step)[0] for step in (0.05, 0.025)
    )
    assert coarse == pytest.approx(fine, rel=2e-3)


def test_grooves_of_whole_waves_leave_the_peak_and_those_of_half_waves_break_it() -> None:
    """f 1 m, grooves of 10 waves at 0.55 um; where they are 10.5, rings cancel each other."""
    depth_um = 10 * WAVE_UM / (index_at(WAVE_UM) - 1)
    grooves = Grooves(depth_um=depth_um, walls=False)
    plain, cut = perfect_lens(1000.0, 5.0), perfect_lens(1000.0, 5.0, grooves=grooves)
    radius_mm = (0.067,)
    whole = wave_shares(plain, 0.0, WAVE_UM, 0.0, radius_mm)[0]
    assert whole == pytest.approx(0.838, abs=0.01)
    assert wave_shares(cut, 0.0, WAVE_UM, 0.0, radius_mm)[0] == pytest.approx(whole, abs=0.01)
    half_um = WAVE_UM
    for _ in range(20):
        half_um = depth_um * (index_at(half_um) - 1) / 10.5
    assert wave_shares(cut, 0.0, half_um, 0.0, radius_mm)[0] < 0.5 * whole
    assert wave_shares(plain, 0.0, half_um, 0.0, radius_mm)[0] > 0.8 * whole


def test_what_waves_cannot_be_summed_for_is_said() -> None:
    lens = perfect_lens(50.0, 5.0)
    near = replace(lens, object_distance_mm=500.0)
    with pytest.raises(ContractError, match="distant scene"):
        wave_shares(near, 0.0, WAVE_UM, 0.0, (0.01,))
    by_number = replace(lens, aperture_kind="f_number")
    with pytest.raises(ContractError, match="stop_semi_diameter_mm"):
        wave_shares(by_number, 0.0, WAVE_UM, 0.0, (0.01,))
    with pytest.raises(ContractError, match="too wide"):
        wave_shares(lens, 0.0, WAVE_UM, 0.0, (0.01,), lattice_mm=1e-3)
