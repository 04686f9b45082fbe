from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import both_halves, half_disc
from camkit.models_def.optics.tolerance.air_gap import (
    air_gaps,
    with_adjusted_gap,
    with_chosen_gap,
)
from camkit.models_def.optics.tolerance.deviation import (
    Deviations,
    draw_deviations,
    no_deviations,
)
from camkit.models_def.optics.tolerance.errors import ErrorWidth, Tolerances
from camkit.models_def.optics.tolerance.fabricated import View, land
from camkit.models_def.optics.tolerance.refit import (
    about_centroid,
    beam_of,
    displacement,
    product,
    shares,
)

PRESCRIPTIONS = Path(__file__).resolve().parents[4] / "models_def" / "prescriptions"
DUET = read_lens(PRESCRIPTIONS / "duet.toml")
GAUSS = read_lens(PRESCRIPTIONS / "double-gauss.toml")
GAP = Tolerances(compensator="gap")


def view_of(lens: Lens) -> View:
    return View(
        slopes=torch.tensor([0.0, 0.15], dtype=torch.float64),
        azimuths_rad=torch.deg2rad(torch.tensor([0.0, 90.0], dtype=torch.float64)),
        wavelengths_um=torch.tensor(lens.wavelengths_um, dtype=torch.float64),
        samples=both_halves(half_disc(32)),
    )


def with_thickness(lens: Lens, number: int, error_mm: float) -> Deviations:
    none = no_deviations(lens)
    thickness = none.thickness_mm.copy()
    thickness[0, number] = error_mm
    return replace(none, thickness_mm=thickness)


def distance(lens: Lens, deviations: Deviations, compensator: str) -> float:
    """Return the mean square distance of rays to those of the design, about the centroids."""
    view = view_of(lens)
    nominal = beam_of(*_landing(lens, no_deviations(lens), view, "none"))
    beam = beam_of(*_landing(lens, deviations, view, compensator))
    share = shares(beam.weight)
    left = about_centroid(displacement(beam, nominal), share)
    return float(product(left, left, share))


def _landing(lens: Lens, deviations: Deviations, view: View, compensator):
    landing = land(lens, deviations, view, compensator)
    return landing.rays, landing.weight


def test_gaps_lie_between_pieces_of_glass() -> None:
    assert air_gaps(DUET) == (2,)
    # the stop divides the middle gap, and both its parts count
    assert [GAUSS.surfaces[i].glass for i in air_gaps(GAUSS)] == ["air"] * 4
    assert GAUSS.stop in air_gaps(GAUSS)
    assert len(GAUSS.surfaces) - 1 not in air_gaps(GAUSS)


def test_a_lens_without_errors_keeps_its_gap() -> None:
    found, travel = with_adjusted_gap(GAUSS, no_deviations(GAUSS), view_of(GAUSS), 3)
    assert float(travel) == 0
    assert not found.thickness_mm.any()


@pytest.mark.parametrize("error_mm", [0.03, -0.03])
def test_the_error_of_the_gap_itself_is_taken_back(error_mm: float) -> None:
    number = air_gaps(DUET)[0]
    drawn = with_thickness(DUET, number, error_mm)
    found, travel = with_adjusted_gap(DUET, drawn, view_of(DUET), number)
    assert float(travel) == pytest.approx(-error_mm, rel=0.02)
    # least squares of a change that is not quite linear: what is left is of second order
    assert abs(float(found.thickness_mm[0, number])) < 0.02 * abs(error_mm)


def test_the_gap_brings_rays_nearer_to_the_design_than_the_sensor_alone() -> None:
    # which the least spot does not, nor the paraxial image
    chosen = with_chosen_gap(GAUSS, GAP, view_of(GAUSS))
    errors = Tolerances().only("radius")
    for number in range(2):
        drawn = draw_deviations(GAUSS, errors, range(number, number + 1), 1)
        adjusted, travel = with_adjusted_gap(GAUSS, drawn, view_of(GAUSS), chosen.compensator_gap)
        assert abs(float(travel)) > 1e-4
        best = distance(GAUSS, adjusted, "gap")
        assert best < distance(GAUSS, drawn, "gap")
        assert distance(GAUSS, drawn, "gap") <= distance(GAUSS, drawn, "paraxial")
        # a little more or less of the gap is worse
        for step in (-0.02, 0.02):
            thickness = adjusted.thickness_mm.copy()
            thickness[0, chosen.compensator_gap] += step
            assert distance(GAUSS, replace(adjusted, thickness_mm=thickness), "gap") > best


def test_the_focus_error_comes_after_the_gap() -> None:
    drawn = with_thickness(DUET, 3, 0.02)
    later = replace(drawn, focus_mm=np.array([0.1]))
    moves = [float(with_adjusted_gap(DUET, one, view_of(DUET), 2)[1]) for one in (drawn, later)]
    assert moves[0] == moves[1] != 0
    shifts = [float(land(DUET, one, view_of(DUET), "gap").refocus_mm) for one in (drawn, later)]
    assert shifts[1] == pytest.approx(shifts[0], abs=1e-5)


def test_a_gap_moves_no_further_than_half_its_length() -> None:
    wild = with_thickness(DUET, 2, 0.29)
    assert float(with_adjusted_gap(DUET, wild, view_of(DUET), 2)[1]) == pytest.approx(-0.15)


def test_copies_with_grooves_of_different_depths_are_adjusted_one_by_one() -> None:
    surfaces = list(DUET.surfaces)
    surfaces[4] = replace(surfaces[4], grooves=Grooves(depth_um=100.0, walls=False))
    lens = replace(DUET, surfaces=tuple(surfaces))
    wide = replace(Tolerances().only("radius"), groove_depth=ErrorWidth(half_width=0.001))
    drawn = draw_deviations(lens, wide, range(2), 1)
    _, both = with_adjusted_gap(lens, drawn, view_of(lens), 2)
    alone = [with_adjusted_gap(lens, drawn.of_copy(i), view_of(lens), 2)[1] for i in range(2)]
    torch.testing.assert_close(both, torch.cat(alone))


def test_the_gap_is_named_and_one_that_is_none_is_refused() -> None:
    chosen = with_chosen_gap(GAUSS, GAP, view_of(GAUSS))
    assert chosen.compensator_gap in air_gaps(GAUSS)
    named = replace(GAP, compensator_gap=1)
    assert with_chosen_gap(GAUSS, named, view_of(GAUSS)) is named
    assert with_chosen_gap(GAUSS, Tolerances(), view_of(GAUSS)).compensator_gap is None
    with pytest.raises(ContractError, match="follow surfaces 2; got compensator_gap 3"):
        with_chosen_gap(DUET, replace(GAP, compensator_gap=3), view_of(DUET))
    single = read_lens(PRESCRIPTIONS / "al2550-a.toml")
    with pytest.raises(ContractError, match="there are none"):
        with_chosen_gap(single, GAP, view_of(single))
    with pytest.raises(ContractError, match="needs the compensator gap"):
        Tolerances(compensator_gap=2)
