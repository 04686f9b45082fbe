"""The coarse starts of the thesis's two designs: first order, focus on the axis, shape."""

from pathlib import Path

import pytest
import torch

from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, with_focus_shift
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.spot import Spots, trace_spots
from camkit.models_def.optics.tracing.sag import sag
from tools.start.recipe import read_recipe
from tools.start.search import design

RECIPES = Path(__file__).resolve().parents[3] / "models_def" / "recipes"
STARTS = pytest.mark.parametrize("name", ["lfov", "edof"])


def spots(lens: Lens, field_angle_rad: float) -> Spots:
    slopes = torch.tan(torch.tensor([field_angle_rad], dtype=torch.float64))
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    return trace_spots(lens, slopes, waves, half_disc(200))


def mean_radius_mm(lens: Lens) -> float:
    """Give the mean distance of rays from the axis, for the object point on it."""
    found = spots(lens, 0.0)
    return float(torch.hypot(found.x_mm, found.y_mm).mean())


@STARTS
def test_start_is_a_50_mm_f4_in_focus_on_the_axis_at_1_m(name: str) -> None:
    lens = find_lens(f"{name}-start")
    data = paraxial_data(lens)
    assert data.efl_mm == pytest.approx(50, abs=2e-3)
    assert data.f_number == pytest.approx(4, abs=2e-4)
    assert lens.object_distance_mm == 1000
    here = mean_radius_mm(lens)
    assert here < 0.06
    for shift_mm in (-0.4, 0.4):
        assert mean_radius_mm(with_focus_shift(lens, shift_mm)) > 1.05 * here


@STARTS
def test_start_passes_its_whole_field_and_has_edges(name: str) -> None:
    lens = find_lens(f"{name}-start")
    assert not spots(lens, lens.field_angles_rad[-1]).fate.any()
    for one, other in zip(lens.surfaces[1:-1], lens.surfaces[2:], strict=True):
        rim = torch.tensor(max(one.semi_diameter_mm, other.semi_diameter_mm) ** 2).double()
        front, back = (
            sag(
                torch.tensor(s.curvature_per_mm).double(),
                torch.tensor(s.conic).double(),
                torch.tensor(s.even_asphere).double(),
                rim,
            )
            for s in (one, other)
        )
        assert one.thickness_mm + float(back - front) > (1.0 if one.glass != "air" else 0.0)


def test_starts_have_the_glasses_and_shapes_of_the_thesis() -> None:
    doublet, triplet = find_lens("lfov-start"), find_lens("edof-start")
    assert [s.glass[:4] for s in doublet.surfaces] == ["air", "PMMA", "air", "PC-S", "air"]
    glasses = ["air", "PMMA", "air", "PC-S", "air", "PC-S", "air"]
    assert [s.glass[:4] for s in triplet.surfaces] == glasses
    assert not any(s.conic or s.even_asphere for s in doublet.surfaces)
    assert [bool(s.even_asphere) for s in triplet.surfaces[1:]] == [False, True] + [False] * 3 + [
        True
    ]
    assert not any(s.conic for s in triplet.surfaces)


@STARTS
def test_start_is_found_again_by_its_recipe(name: str) -> None:
    """Another machine may end elsewhere in a flat valley, but not at a better or worse focus."""
    found, kept = (
        design(read_recipe(RECIPES / f"{name}_start.toml")).lens,
        find_lens(f"{name}-start"),
    )
    assert mean_radius_mm(found) == pytest.approx(mean_radius_mm(kept), rel=0.05)
