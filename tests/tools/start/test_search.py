from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, read_prescription
from camkit.models_def.optics.psf import energy_diameter
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.search.problem import residuals
from camkit.models_def.optics.spot import rms_radius, slopes_for_heights, trace_spots
from tools.start.recipe import LensRecipe, read_recipe
from tools.start.search import design, problem_of

MODELS = Path(__file__).resolve().parents[3] / "models_def"
RECIPE = MODELS / "recipes" / "duet_lens.toml"
DUET = MODELS / "prescriptions" / "duet.toml"
PITCH_MM = 5.96e-3


@pytest.fixture(scope="module")
def recipe() -> LensRecipe:
    return read_recipe(RECIPE)


def test_more_steps_never_end_worse(recipe: LensRecipe) -> None:
    small = replace(recipe, starts=6, scout_steps=2, kept=2, fields=4, pupil_rays=8)
    short, long = (design(replace(small, steps=steps)) for steps in (1, 8))
    assert long.merit <= short.merit
    assert long.merits == tuple(sorted(long.merits))


def test_found_lens_has_the_wanted_focal_length_and_respects_its_ranges(
    recipe: LensRecipe,
) -> None:
    small = replace(recipe, starts=4, scout_steps=2, kept=2, steps=3, fields=4, pupil_rays=8)
    lens = design(small).lens
    # radii are rounded to 0.1 um as on a drawing
    assert paraxial_data(lens).efl_mm == pytest.approx(50.0, abs=2e-3)
    for surface, free in zip(lens.surfaces[1:-1], recipe.surfaces[1:-1], strict=True):
        low, high = free.thickness_range_mm
        assert low - 1e-9 <= surface.thickness_mm <= high + 1e-9
        low, high = free.curvature_range_per_mm
        assert low - 1e-6 <= surface.curvature_per_mm <= high + 1e-6


def test_aspheres_are_searched_within_their_ranges(recipe: LensRecipe) -> None:
    ranges = ((0.0, 0.0), (-2e-5, 2e-5))
    bent = replace(recipe.surfaces[2], even_asphere_ranges=ranges)
    surfaces = (*recipe.surfaces[:2], bent, *recipe.surfaces[3:])
    small = replace(
        recipe, surfaces=surfaces, starts=3, scout_steps=2, kept=1, steps=3, fields=3, pupil_rays=6
    )
    lens = design(small).lens
    flat, fourth = lens.surfaces[2].even_asphere
    assert flat == 0
    assert 0 < abs(fourth) <= 2e-5
    assert paraxial_data(lens).efl_mm == pytest.approx(50.0, abs=2e-3)


def test_a_search_may_care_for_the_axis_alone(recipe: LensRecipe) -> None:
    """The axis gets sharper at the cost of the corner, which keeps its rays."""
    few = replace(recipe, starts=12, scout_steps=3, kept=3, steps=12, fields=3, pupil_rays=8)
    near = replace(few, object_distance_mm=1000.0)
    found = [design(replace(near, merit_fields=count)).lens for count in (0, 1)]
    waves = torch.tensor(recipe.wavelengths_um, dtype=torch.float64)
    slopes = torch.tensor([0.0, 0.43], dtype=torch.float64)
    spots = [trace_spots(lens, slopes, waves, half_disc(200)) for lens in found]
    (axis, corner), (axis_alone, corner_alone) = (rms_radius(s).mean(1).tolist() for s in spots)
    assert axis_alone < 0.9 * axis
    assert corner_alone > corner
    assert all(lens.object_distance_mm == 1000.0 for lens in found)
    assert bool((spots[1].fate == 0).all())


def test_same_seed_finds_the_same_lens(recipe: LensRecipe) -> None:
    small = replace(recipe, starts=3, scout_steps=1, kept=1, steps=1, fields=3, pupil_rays=6)
    assert design(small) == design(small)
    assert design(replace(small, seed=12)).lens != design(small).lens


def test_duet_is_as_bad_as_it_was_meant_to_be() -> None:
    """95 % of the light in 30..80 px at the corner, at least 8 px everywhere, F/4, 50 mm."""
    lens = read_prescription(DUET)
    data = paraxial_data(lens)
    assert data.efl_mm == pytest.approx(50.0, abs=1e-3)
    assert data.f_number == pytest.approx(4.0, abs=1e-4)
    heights = torch.tensor([0.0, 5.0, 10.0, 15.0, 18.0, 21.489], dtype=torch.float64)
    waves = torch.tensor([0.46, 0.54, 0.60], dtype=torch.float64)
    spots = trace_spots(lens, slopes_for_heights(lens, heights), waves, half_disc(1000))
    diameters = energy_diameter(spots) / PITCH_MM
    assert 30 < float(diameters[-1]) < 80
    assert float(diameters.min()) > 8
    assert bool((spots.fate == 0).all())


@pytest.mark.slow
def test_duet_is_found_again_by_its_recipe(recipe: LensRecipe) -> None:
    """It lies in a flat valley: other places in it are as good to a thousandth."""
    found, kept = design(recipe), read_prescription(DUET)
    for one, other in zip(found.lens.surfaces, kept.surfaces, strict=True):
        assert one.curvature_per_mm == pytest.approx(other.curvature_per_mm, abs=1e-3)
        assert one.thickness_mm == pytest.approx(other.thickness_mm, abs=0.1)
        assert one.conic == pytest.approx(other.conic, abs=1e-2)
    assert found.merit == pytest.approx(_merit(recipe, kept), rel=2e-3)


def _merit(recipe: LensRecipe, lens: Lens) -> float:
    """Give the merit of a lens, at its best focus, as the search counts it."""
    problem = problem_of(recipe)
    numbers = {
        "curvature": lambda s: s.curvature_per_mm,
        "thickness": lambda s: s.thickness_mm,
        "conic": lambda s: s.conic,
        "defocus": lambda _: 0.0,
    }
    free = problem.free
    values = [numbers[v.kind](lens.surfaces[v.surface]) for v in free.variables]
    low, high = free.low, free.high
    scaled = (torch.tensor(values, dtype=torch.float64) - low) / (high - low).clamp_min(1e-12)
    focused = scaled.clamp(0, 1).repeat(401, 1)
    focused[:, [v.kind for v in free.variables].index("defocus")] = torch.linspace(0, 1, 401)
    return float((residuals(problem, focused) ** 2).sum(1).min())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("seed = 11", "sed = 11"), "unknown key"),
        (("seed = 11", 'seed = "x"'), "must be a whole number"),
        (("efl_mm = 50.0", "efl_mm = [50.0]"), "must be a number"),
        (("efl_mm = 50.0", "efl_mm = true"), "must be a number"),
        (("efl_mm = 50.0", "efl_mm = 50.0\nobject_distance_mm = -1.0"), "must be > 0"),
        (("kept = 16", "kept = 999"), "kept must be"),
        (("fields = 9", "fields = 9\nmerit_fields = 10"), "merit_fields must be"),
        (("[0.5, 20.0]", "[9.0, 2.0]"), "range is"),
        (("curvature_range_per_mm = [0.0, 0.0]", "curvature_range_per_mm = [0.0, 1.0]"), "stop"),
        (('"PC-Sultanova2009"', '"PC"'), "known name"),
        (("seed = 11", "seed ="), "not valid TOML"),
    ],
)
def test_wrong_recipe_is_refused(change: tuple[str, str], message: str, tmp_path: Path) -> None:
    path = tmp_path / "recipe.toml"
    path.write_text(RECIPE.read_text().replace(*change, 1))
    with pytest.raises(ContractError, match=message):
        read_recipe(path)
