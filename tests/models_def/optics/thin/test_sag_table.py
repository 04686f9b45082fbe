"""Tables for the workshop."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import Surface
from camkit.models_def.optics.thin.sag_table import sag_table, write_sag_table


def test_a_sphere_has_its_sag_and_slope() -> None:
    table = sag_table(
        Surface(curvature_per_mm=1 / 20, thickness_mm=1.0, semi_diameter_mm=8.003), 50.0
    )
    exact = 20 - np.sqrt(400 - table.radius_mm**2)
    assert np.allclose(table.height_um, 1000 * exact, atol=1e-9)
    assert np.allclose(table.slope, table.radius_mm / np.sqrt(400 - table.radius_mm**2))
    assert table.radius_mm[-1] == 8.003
    assert table.walls == 0


def test_a_wall_has_two_rows_a_groove_apart() -> None:
    surface = find_lens("thin-plate").surfaces[2]
    table = sag_table(surface, 10.0)
    assert surface.grooves is not None
    jumps = np.flatnonzero(np.diff(table.radius_mm) < 1e-7)
    assert len(jumps) == table.walls == 40
    steps = np.abs(table.height_um[jumps + 1] - table.height_um[jumps])
    assert np.allclose(steps, surface.grooves.depth_um, atol=1e-4)
    assert np.abs(table.height_um).max() <= surface.grooves.depth_um
    smooth = np.diff(table.radius_mm) > 1e-6
    rise = np.diff(table.height_um)[smooth] / 1000 / np.diff(table.radius_mm)[smooth]
    middle = ((table.slope[1:] + table.slope[:-1]) / 2)[smooth]
    assert np.allclose(rise, middle, atol=2e-5)


def test_a_table_reads_back(tmp_path: Path) -> None:
    table = sag_table(find_lens("thin-plate").surfaces[1], 100.0)
    write_sag_table(table, tmp_path / "s.csv")
    text = (tmp_path / "s.csv").read_text()
    assert text.startswith("radius_mm,height_um,slope\n0.000000,0.00000,")
    read = np.loadtxt(tmp_path / "s.csv", delimiter=",", skiprows=1)
    assert np.allclose(read[:, 1], table.height_um, atol=1e-5)


def test_a_profile_without_an_end_is_refused() -> None:
    endless = Surface(curvature_per_mm=0.1, thickness_mm=1.0)
    with pytest.raises(ContractError, match="finite semi_diameter_mm"):
        sag_table(endless, 10.0)
    with pytest.raises(ContractError, match="ends before its rim"):
        sag_table(replace(endless, semi_diameter_mm=11.0), 10.0)
