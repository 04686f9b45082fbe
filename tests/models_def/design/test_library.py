"""Starts from the lenses that camkit ships, scaled to what a recipe asks."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design import starts as starts_module
from camkit.models_def.design.assembly import parts_of, problem_of
from camkit.models_def.design.design_recipe import recipe_digest, to_design, with_choices
from camkit.models_def.design.library import library_of, library_start
from camkit.models_def.design.run import DesignOptions, DesignRun
from camkit.models_def.design.starts import Starts, library_starts
from camkit.models_def.optics.lens_file.lens_file import built_in_lenses, find_lens, read_lens
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.search.improvement import refracting_surfaces
from camkit.models_def.optics.search.limits import Limits
from camkit.models_def.optics.search.problem import Problem, residuals
from camkit.models_def.optics.search.variables import FreeLens, Variable

EFL_MM, F_NUMBER, HALF_FIELD_DEG = 40.0, 5.0, 18.0


def bent_plates() -> Lens:
    """Three elements of a poor lens: a strong one behind two plates."""
    surfaces = [
        Surface(curvature_per_mm=1e-4, thickness_mm=3.0, glass="N-BK7-Schott"),
        Surface(curvature_per_mm=0.0, thickness_mm=4.0),
        Surface(curvature_per_mm=0.0, thickness_mm=2.0, glass="F2-Schott"),
        Surface(curvature_per_mm=0.0, thickness_mm=4.0),
        Surface(curvature_per_mm=0.03, thickness_mm=3.0, glass="N-BK7-Schott"),
        Surface(curvature_per_mm=-0.01, thickness_mm=35.0),
    ]
    return Lens(
        name="plates",
        surfaces=tuple(surfaces),
        stop=3,
        aperture_kind="f_number",
        aperture_value=F_NUMBER,
    )


def asked(*, aspheric: int = 0, min_bfl_mm: float = 20.0, object_mm: float = math.inf) -> Problem:
    """Ask for a lens of 40 mm from plates; so many of their surfaces may be aspheric."""
    lens = replace(bent_plates(), object_distance_mm=object_mm)
    free = [Variable(kind="curvature", surface=i, low=-0.1, high=0.1) for i in range(5)]
    for i, surface in enumerate(lens.surfaces[:-1]):
        low, high = (0.1, 12.0) if surface.glass == "air" else (1.0, 8.0)
        free.append(Variable(kind="thickness", surface=i, low=low, high=high))
    free += [Variable(kind="conic", surface=i, low=-3.0, high=3.0) for i in range(aspheric)]
    free.append(Variable(kind="defocus", low=-0.5, high=0.5))
    return Problem(
        free=FreeLens(lens=lens, variables=tuple(free), solved=5, efl_mm=EFL_MM),
        slopes=math.tan(math.radians(HALF_FIELD_DEG)) * torch.linspace(0, 1, 3).double(),
        wavelengths_um=torch.tensor([0.48, 0.55, 0.65], dtype=torch.float64),
        limits=Limits(min_edge_mm=0.5, min_bfl_mm=min_bfl_mm),
    )


@pytest.mark.parametrize("object_mm", [math.inf, 1500.0])
def test_lenses_have_the_wanted_focal_length_f_number_and_focus(object_mm: float) -> None:
    problem = asked(aspheric=6, object_mm=object_mm)
    given, *others = library_of(problem).starts
    assert given.name == ""
    assert len(others) >= 5
    for start in others:
        lens = start.problem.free.lens
        data = paraxial_data(lens)
        assert data.efl_mm == pytest.approx(EFL_MM, rel=1e-9)
        assert abs(data.f_number) == pytest.approx(F_NUMBER, rel=1e-9)
        assert lens.object_distance_mm == object_mm
        assert lens.surfaces[-1].thickness_mm == pytest.approx(paraxial_image(lens).distance_mm)
        assert lens.name == start.name
        own = find_lens(start.name)
        assert [s.glass for s in lens.surfaces] == [s.glass for s in own.surfaces]
        shrink = paraxial_data(own, 0.55).efl_mm / EFL_MM
        for ours, theirs in zip(lens.surfaces, own.surfaces, strict=True):
            assert ours.curvature_per_mm == pytest.approx(theirs.curvature_per_mm * shrink)


def test_every_lens_is_a_start_or_is_left_out_with_its_reason() -> None:
    library = library_of(asked(), elements=3)
    names = {start.name for start in library.starts} - {""}
    assert names | set(library.left_out) == set(built_in_lenses())
    assert names == {"cooke-triplet"}
    assert library.left_out["cooke-triplet-f5"] == "is cooke-triplet once more"
    assert library.left_out["thin-plate"] == "has grooves"
    assert library.left_out["double-gauss"] == "has 6 elements"
    assert "no conic" in library.left_out["trio-edof"]
    wide = replace(asked(), slopes=torch.tensor([0.0, 0.6], dtype=torch.float64))
    assert "14 degrees" in library_of(wide).left_out["double-gauss"]
    reflex = library_of(asked(min_bfl_mm=60.0))
    assert [start.name for start in reflex.starts] == ["", "retrofocus"]
    assert "sensor" in reflex.left_out["cooke-triplet"]
    assert "tessar" not in library_of(asked(), omit=["tessar"]).left_out


def test_a_lens_of_another_form_is_free_as_the_recipe_is() -> None:
    start = library_start(asked(aspheric=2), "double-gauss")
    free = start.problem.free
    lens = free.lens
    places = {
        kind: [v for v in free.variables if v.kind == kind] for kind in ("curvature", "conic")
    }
    bent = {v.surface for v in places["curvature"]}
    assert bent | {free.solved} == set(refracting_surfaces(lens))
    assert lens.stop not in bent
    # the cemented surfaces stay spheres; of the others those far from the stop come first
    assert {v.surface for v in places["conic"]} == {0, 10}
    for v in free.variables:
        if v.kind == "thickness":
            is_glass = lens.surfaces[v.surface].glass != "air"
            assert (v.low, v.high) == ((1.0, 8.0) if is_glass else (0.1, 12.0))
    shaped = library_start(asked(aspheric=1), "trio-edof").problem.free
    own = find_lens("trio-edof").surfaces
    aspheric = {i for i, s in enumerate(own) if s.conic or any(s.even_asphere)}
    assert {v.surface for v in shaped.variables if v.kind == "conic"} == aspheric


def test_the_surface_that_is_solved_moves_the_focal_length_most() -> None:
    free = library_start(asked(), "triplet-flattener").problem.free
    lens = free.lens

    def moved_mm(i: int) -> float:
        surface = lens.surfaces[i]
        bent = replace(surface, curvature_per_mm=surface.curvature_per_mm + 1e-6)
        surfaces = (*lens.surfaces[:i], bent, *lens.surfaces[i + 1 :])
        return abs(paraxial_data(replace(lens, surfaces=surfaces)).efl_mm - EFL_MM)

    assert free.solved == max(range(len(lens.surfaces)), key=moved_mm)
    # the last one, beside the sensor, could not hold the focal length
    assert moved_mm(len(lens.surfaces) - 1) < 0.1 * moved_mm(free.solved)


def test_a_lens_of_the_same_layout_keeps_the_variables_of_the_recipe(
    table: dict[str, Any],
) -> None:
    problem = problem_of(to_design(table), find_lens("duet"))
    free = library_start(problem, "duet-joint").problem.free
    assert free.variables == problem.free.variables
    assert "duet" in library_of(problem).left_out


def test_the_library_ends_far_below_a_search_near_a_poor_lens() -> None:
    problem = asked()
    plan = Starts(count=8, merit="rms", scout_steps=4, dls_steps=10, elements=3, library=True)
    (best,) = library_starts(problem, plan)
    assert best.name == "cooke-triplet"
    near = starts_module.best_starts(problem, replace(plan, library=False))[0]

    def merit(problem: Problem, scaled: torch.Tensor) -> float:
        with torch.no_grad():
            return float(residuals(replace(problem, merit="rms"), scaled[None]).square().sum())

    assert merit(best.problem, best.scaled) < 0.1 * merit(problem, near)
    lens = best.problem.free.lens_at(best.scaled)
    assert paraxial_data(lens).efl_mm == pytest.approx(EFL_MM, rel=1e-9)
    assert paraxial_data(lens).f_number == pytest.approx(F_NUMBER, rel=1e-9)


def test_judged_starts_are_the_best_ends_and_the_given_lens() -> None:
    plan = Starts(count=4, scout_steps=1, dls_steps=1, library=True, library_lenses=2, judged=3)
    found = library_starts(asked(), plan)
    assert len(found) == 4
    merits = [start.merit for start in found[:-1]]
    assert merits == sorted(merits)
    assert found[-1].name == ""
    assert torch.equal(found[-1].scaled, asked().free.scaled())


def test_without_a_lens_that_serves_the_reasons_are_told() -> None:
    with pytest.raises(ContractError, match="tessar has 4 elements"):
        library_starts(asked(), Starts(library=True, elements=11))


def test_a_design_begins_at_a_library_lens_and_goes_on_without_a_second_search(
    table: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    table["vary"] += [
        {"kind": "curvature", "surface": i, "low": -0.1, "high": 0.1} for i in (1, 2, 3)
    ]
    table["optics"] |= {"efl_mm": 50.0, "solved_surface": 4, "psf_model": "rays"}
    # two steps make this crude lens no match for a triplet
    table["starts"] = {"library": True, "elements": 3, "scout_steps": 1, "dls_steps": 1}
    recipe = to_design(table)
    options = DesignOptions(out_dir=tmp_path / "a")
    whole = DesignRun(recipe, options)
    list(whole.go())
    report = whole.finish()
    assert report["start"] in {"cooke-triplet", "trio-edof", "edof-start"}
    lens = read_lens(Path(report["lens"]))
    assert lens.note.endswith(f"from {report['start']}")
    assert paraxial_data(lens).efl_mm == pytest.approx(50.0, rel=1e-6)
    stopped = replace(options, out_dir=tmp_path / "b")
    list(DesignRun(recipe, stopped).go(3))
    monkeypatch.setattr(starts_module, "improve", pytest.fail)
    resumed = DesignRun(recipe, replace(stopped, resume=True))
    assert resumed.searched_s == 0
    list(resumed.go())
    assert resumed.finish()["start"] == report["start"]
    ends = (run.loop.parts.lens.scaled() for run in (whole, resumed))
    assert torch.equal(*ends)


def test_the_library_is_a_choice_of_recipe_and_caller(table: dict[str, Any]) -> None:
    recipe = to_design(table)
    assert with_choices(recipe, library=True).starts.library
    assert not with_choices(recipe).starts.library
    # what came before the library goes on
    assert recipe_digest(recipe) == recipe_digest(with_choices(recipe, library=False))
    assert recipe_digest(recipe) != recipe_digest(with_choices(recipe, library=True))
    assert not with_choices(with_choices(recipe, library=True), library=False).starts.library
    with pytest.raises(ContractError, match="is a search"):
        with_choices(recipe, library=True, search=False)
    kept = to_design({**table, "starts": {"library": True}, "schedule": {"lens_rate": 0.0}})
    assert parts_of(kept).start == ""


@pytest.mark.parametrize(
    ("entry", "word"),
    [
        ({"library_lenses": 0}, r"starts\.library_lenses must be >= 1; got 0"),
        ({"elements": -1}, r"starts\.elements must be >= 0; got -1"),
    ],
)
def test_wrong_keys_of_the_library_are_refused(
    table: dict[str, Any], entry: dict[str, Any], word: str
) -> None:
    table["starts"] = entry
    with pytest.raises(ContractError, match=word):
        to_design(table)
