import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.design.assembly import parts_of, problem_of
from camkit.models_def.design.design_recipe import (
    read_design,
    recipe_digest,
    to_design,
    with_choices,
)
from camkit.models_def.design.loop import DesignLoop
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.paraxial import paraxial_data

RECIPES = Path(__file__).resolve().parents[3] / "models_def" / "recipes"


@pytest.mark.parametrize(
    "name",
    [
        *("duet_joint_lens", "duet_bank_lens", "duet_hybrid_lens", "trio_cubic_lens"),
        *("lfov", "lfov_joint", "edof", "edof_joint"),
    ],
)
def test_recipes_that_are_shipped_take_steps(name: str) -> None:
    recipe = read_design(RECIPES / f"{name}.toml")
    small = replace(
        recipe,
        optics=replace(recipe.optics, fields=3, pupil_rays=32),
        pixels=replace(recipe.pixels, kernel_px=65),
        schedule=replace(
            recipe.schedule, steps=2, batch=1, patch_px=24, valid_steps=2, valid_patches=1
        ),
        data=replace(recipe.data, procedural_scenes=1, scene_px=192),
        starts=Starts(),
        descent=recipe.descent and replace(recipe.descent, evaluations=4, copies=2),
    )
    parts = parts_of(small, folder=RECIPES)
    # a coarse start may bend the picture more than its limits allow
    assert float(parts.lens()[1].detach()) < 1
    loop = DesignLoop(parts, replace(small.schedule, hold_steps=0, freeze_share=0.0))
    (moment,) = loop.run()
    assert math.isfinite(moment.loss)
    assert bool(parts.lens.moves.detach().all())


@pytest.mark.parametrize(
    ("optics", "phase", "message"),
    [
        ({"azimuths_deg": [0.0], "psf_model": "waves"}, {}, "waves are summed along"),
        ({}, {}, r"need a round lens.*optics\.azimuths_deg"),
        ({"azimuths_deg": [0.0]}, {"surface": 9}, r"needs a surface 0\.\.4 without a phase"),
        ({"azimuths_deg": [0.0]}, {"free_rad": {"z3": 1.0}}, "named x3, y, x2y"),
        ({"azimuths_deg": [0.0]}, {"free_rad": {}}, "needs radial_rad or free_rad"),
    ],
)
def test_a_plate_that_a_design_cannot_take_is_refused(
    optics: dict[str, Any], phase: dict[str, Any], message: str, table: dict[str, Any]
) -> None:
    table["optics"] |= optics
    table["phase"] = [{"surface": 0, "radius_mm": 6.25, "free_rad": {"x3": 40.0}} | phase]
    with pytest.raises((ContractError, UnsupportedError), match=message):
        problem_of(to_design(table), find_lens("duet"))


def test_the_sensor_stands_where_the_chosen_depth_is_sharp(table: dict[str, Any]) -> None:
    table["optics"] |= {"object_distances_mm": [500.0, 1000.0], "focus_distance_mm": 1000.0}
    given = find_lens("duet")
    lens = problem_of(to_design(table), given).free.lens
    assert lens.object_distance_mm == 1000.0
    moved = lens.surfaces[-1].thickness_mm - given.surfaces[-1].thickness_mm
    # Newton's equation about the front focal point
    ffl_mm = paraxial_data(given).ffl_mm
    assert moved == pytest.approx(50.0**2 / (1000.0 + ffl_mm), rel=1e-4)


def test_a_window_fits_the_lens_or_says_that_none_does(table: dict[str, Any]) -> None:
    table["pixels"]["kernel_px"] = 0
    lens = parts_of(to_design(table)).lens
    held = lens()[0].sum((-2, -1)).detach()
    assert float(held.min()) > 0.99
    assert 33 <= lens.pixels.kernel_px < 129
    table["optics"]["object_distances_mm"] = [200.0, 4000.0]
    with pytest.raises(ContractError, match="385 px hold"):
        parts_of(to_design(table))


def change(key: str, **entries: Any) -> Callable[[dict[str, Any]], None]:
    return lambda table: table.__setitem__(key, {**table[key], **entries})


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda t: t.pop("optics"), "lacks optics"),
        (lambda t: t.__setitem__("lens", {}), "unknown key 'lens'"),
        (lambda t: t.__setitem__("vary", {}), r"\[\[vary\]\]"),
        (lambda t: t["vary"][0].__setitem__("kind", "colour"), "one of"),
        (change("front", kind="magic"), "one of none, wiener"),
        (change("loss", kind="l7"), "one of"),
        (change("network", name="resnet"), "network must be one of"),
        (change("schedule", steps=0), r"schedule\.steps must be >= 1; got 0"),
        (change("schedule", hold_steps=-1), r"schedule\.hold_steps must be >= 0; got -1"),
        (change("optics", fields=1), r"optics\.fields must be >= 2; got 1"),
        (change("optics", half_field_deg=0.15), r"half_field_deg = 0\.15 degrees make an image"),
        (change("optics", efl_mm=0.05), r"efl_mm = 0\.05 make an image"),
        (lambda t: t["vary"][0].update(low=9.0), r"vary\[0\]\.low must be <= high.* low = 9"),
        (lambda t: t["vary"][0].update(surface=5), r"has 5 surfaces, 0\.\.4"),
        (
            lambda t: t["vary"].append(
                {"kind": "curvature", "surface": 0, "low": 14.0, "high": 50.0}
            ),
            "cannot reach its rim.*1 / radius",
        ),
        (lambda t: t["vary"][0].update(colour=1), "known are configuration, high, kind, low"),
        (change("schedule", lens_rate="fast"), "must be a number"),
        (change("pixels", kernel_px=32), "odd"),
        (change("pixels", wavelengths_um=[0.5]), "three rows"),
        (change("pixels", cfa="RGBW"), "cfa must be one of RGGB"),
        (change("optics", half_field_deg=95.0), "half_field_deg"),
        (change("optics", focus_distance_mm=700.0), "one of object_distances_mm"),
        (change("optics", units="own"), "whitened moves have no units"),
        (change("optics", units="inch"), "one of range, own"),
        (change("optics", solved_surface=9, efl_mm=50.0), r"solved_surface must be 0\.\.4"),
        (lambda t: t.__setitem__("prescription", "nowhere"), "no lens 'nowhere'"),
        (change("front", kind="wiener"), "takes 3 planes"),
        (change("schedule", patch_px=26), "multiple of 4 for trimmed_unet; got 26"),
    ],
)
def test_wrong_recipes_are_refused_with_a_reason(
    spoil: Callable[[dict[str, Any]], object], message: str, table: dict[str, Any]
) -> None:
    spoil(table)
    with pytest.raises(ContractError, match=message):
        parts_of(to_design(table))


def test_choices_of_a_caller_win_and_change_the_digest(table: dict[str, Any]) -> None:
    recipe = to_design(table)
    changed = with_choices(recipe, steps=9, lens_rate=0.0, seed=4, prescription="cooke-triplet")
    assert (changed.schedule.steps, changed.schedule.lens_rate) == (9, 0.0)
    assert (changed.schedule.seed, changed.prescription) == (4, "cooke-triplet")
    assert recipe_digest(changed) != recipe_digest(recipe)
    assert recipe_digest(with_choices(recipe)) == recipe_digest(recipe)


def test_fields_at_equal_areas_stand_for_equal_parts_of_the_image_circle(
    table: dict[str, Any],
) -> None:
    table["optics"] |= {"fields": 5, "spacing": "area"}
    slopes = problem_of(to_design(table), find_lens("duet")).slopes
    areas = (slopes / slopes[-1]) ** 2
    torch.testing.assert_close(areas.diff(), torch.full((4,), 0.25, dtype=torch.float64))
    table["optics"]["spacing"] = "angle"
    with pytest.raises(ContractError, match="height, area"):
        to_design(table)
