"""Two zoom states of two thin groups: the gaps are those of the closed form."""

from dataclasses import replace

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.configuration.configuration import Configuration
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.improvement import improve
from camkit.models_def.optics.search.joint_states import JointProblem, joint_problem
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens

FRONT_MM, BACK_MM = -60.0, 40.0
EFL_MM = {"wide": 50.0, "long": 90.0}
THIN_MM = 1e-6


def _gaps_mm(efl_mm: float) -> tuple[float, float]:
    """Return the distance of two thin groups, and that of the sensor from the second.

    1 / f = 1 / f1 + 1 / f2 - d / (f1 f2), and the back focus is f (1 - d / f1).
    """
    gap_mm = FRONT_MM + BACK_MM - FRONT_MM * BACK_MM / efl_mm
    return gap_mm, efl_mm * (1 - gap_mm / FRONT_MM)


def _zoom(shift_mm: float = 0.0, pupil_mm: float = 0.05) -> Lens:
    """Return two plano lenses; their gaps are off by the shift, to both sides."""
    index = _index()
    front, back = (1 / (focal_mm * (index - 1)) for focal_mm in (FRONT_MM, BACK_MM))
    rows = [(front, THIN_MM, "N-BK7"), (0.0, 30.0, "air"), (back, THIN_MM, "N-BK7")]
    rows.append((0.0, 60.0, "air"))
    states = []
    for name, efl_mm in EFL_MM.items():
        gap_mm, back_mm = _gaps_mm(efl_mm)
        gaps = ((1, gap_mm + shift_mm), (3, back_mm - 2 * shift_mm))
        states.append(Configuration(name=name, thickness_mm=gaps))
    return Lens(
        name="zoom",
        surfaces=tuple(Surface(curvature_per_mm=c, thickness_mm=t, glass=g) for c, t, g in rows),
        stop=2,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=pupil_mm,
        field_angles_rad=(0.0,),
        configurations=tuple(states),
    )


def _index() -> float:
    """Return the index of N-BK7 at the reference wavelength, by a thin lens of it."""
    surfaces = (
        Surface(curvature_per_mm=0.01, thickness_mm=THIN_MM, glass="N-BK7"),
        Surface(curvature_per_mm=0.0, thickness_mm=10.0, glass="air"),
    )
    lens = Lens(
        name="thin",
        surfaces=surfaces,
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=1.0,
    )
    return 1 + 100 / paraxial_data(lens).efl_mm


def _problem(free: FreeLens) -> Problem:
    return Problem(
        free=free,
        slopes=torch.zeros(1, dtype=torch.float64),
        wavelengths_um=torch.tensor([0.55], dtype=torch.float64),
        samples=half_disc(12),
        merit="rms",
        limits=Limits(max_curvature_per_mm=1.0),
    )


def _joint(
    lens: Lens, *, free_front: bool = False, weights: tuple[float, ...] = ()
) -> JointProblem:
    vary = [("curvature",), (), (), ()] if free_front else [()] * 4
    joint = joint_problem(lens, list(EFL_MM), vary, _problem, moves=True, weights=weights)
    terms = tuple(replace(term, efl_mm=EFL_MM[term.name]) for term in joint.terms)
    return replace(joint, terms=terms).in_own_frame()


def test_gaps_of_both_states_are_those_of_thin_groups() -> None:
    joint = _joint(_zoom(shift_mm=1.5))
    begin = joint.scaled()
    found = improve(joint.residuals, begin, starts=1, scout_steps=1, steps=8)
    lens = joint.lens_at(found.scaled)
    for name, efl_mm in EFL_MM.items():
        gaps = {1: _gaps_mm(efl_mm)[0], 3: _gaps_mm(efl_mm)[1]}
        state = next(state for state in lens.configurations if state.name == name)
        assert dict(state.thickness_mm) == pytest.approx(gaps, abs=5e-4)
        assert paraxial_data(plain_lens(lens, name)).efl_mm == pytest.approx(efl_mm, rel=1e-5)
    assert [s.thickness_mm for s in lens.surfaces] == [THIN_MM, 30.0, THIN_MM, 60.0]


def test_gradients_are_those_of_differences() -> None:
    joint = _joint(_zoom(shift_mm=1.0, pupil_mm=1.0), free_front=True)
    scaled = joint.scaled()[None].requires_grad_()

    def merit(values: torch.Tensor) -> torch.Tensor:
        return (joint.residuals(values) ** 2).sum()

    (slope,) = torch.autograd.grad(merit(scaled), scaled)
    for i in range(len(joint.variables)):
        step = torch.zeros_like(scaled)
        step[0, i] = 1e-6
        with torch.no_grad():
            difference = (merit(scaled + step) - merit(scaled - step)) / 2e-6
        assert float(slope[0, i]) == pytest.approx(float(difference), rel=1e-5)


def test_the_merit_is_the_weighted_mean_of_the_states() -> None:
    joint = _joint(_zoom(shift_mm=1.0), weights=(3.0, 1.0))
    scaled = joint.scaled()[None]
    merits = []
    for term in joint.terms:
        own = scaled[:, term.places]
        efl_mm = paraxial_data(term.problem.free.lens_at(own[0])).efl_mm
        spots = float((residuals(term.problem, own) ** 2).sum())
        merits.append(spots + (30 * (efl_mm / term.efl_mm - 1)) ** 2)
    expected = 0.75 * merits[0] + 0.25 * merits[1]
    assert float((joint.residuals(scaled) ** 2).sum()) == pytest.approx(expected, rel=1e-9)
    with pytest.raises(ContractError, match="one for each of wide, long; got"):
        _joint(_zoom(), weights=(1.0,))


def test_surfaces_are_shared_and_states_that_do_not_count_keep_their_gaps() -> None:
    lens = _zoom()
    joint = joint_problem(lens, ["long"], [("curvature",), (), (), ()], _problem)
    kinds = [(v.variable.kind, v.variable.surface, v.state) for v in joint.variables]
    assert kinds == [("curvature", 0, ""), ("thickness", 3, "long")]
    moved = joint.lens_at(joint.scaled() * 0.9)
    assert moved.surfaces[0].curvature_per_mm != lens.surfaces[0].curvature_per_mm
    assert moved.configurations[0] == lens.configurations[0]
    assert moved.configurations[1] != lens.configurations[1]
    with pytest.raises(ContractError, match="nothing of the lens is free"):
        joint_problem(lens, ["long"], [()] * 4, _problem)
