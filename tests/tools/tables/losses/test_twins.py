"""A recipe before a display and outside."""

import math
from dataclasses import replace

import pytest

from camkit.errors import ContractError
from camkit.models_def.training.kind import read_recipe
from tests.bayer_recipe import RECIPE
from tests.hazy_recipe import RECIPE as HAZY
from tools.tables.losses.twins import (
    JUDGED_TILES,
    PICTURES_ALONE,
    Counts,
    judged_by,
    with_losses,
    write_twins,
)


def test_twins_are_the_camera_in_two_circumstances(tmp_path):
    recipe = tmp_path / "tiny.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    shown, wild = (read_recipe(path) for path in write_twins(recipe, tmp_path, (500.0, math.inf)))
    assert (shown.data.display.bits, shown.data.display.calibrated) == (8, False)
    assert shown.data.exposure_min_ev == shown.data.exposure_max_ev == 0
    assert shown.lens.depths_mm == ()
    assert (wild.data.wild.range_least, wild.data.wild.range_most) == (4, 64)
    assert wild.data.display is None
    assert wild.lens.depths_mm == (500, math.inf)
    assert wild.lens.bank_in_focus
    assert shown.networks == wild.networks
    assert (shown.name, shown.sensor, shown.wiener) == (wild.name, wild.sensor, wild.wiener)


def test_a_missing_recipe_is_one_line(tmp_path):
    with pytest.raises(ContractError, match="cannot read recipe"):
        write_twins(tmp_path / "none.toml", tmp_path)


def test_another_camera_takes_sizes_and_losses(tmp_path):
    losses, camera = tmp_path / "losses.toml", tmp_path / "plate.toml"
    losses.write_text(RECIPE.replace("[schedule]", "# how\n[schedule]"), encoding="utf-8")
    other = HAZY.replace('name = "tiny"', 'name = "plate"').replace("steps = ", "steps = 1")
    camera.write_text(other, encoding="utf-8")
    shown, _ = write_twins(losses, tmp_path, camera=camera)
    assert shown.name == "plate_display.toml"
    text = shown.read_text(encoding="utf-8")
    assert text.count("[schedule]") == 1
    assert "# how\n[schedule]" in text
    made, wanted, before = (read_recipe(path) for path in (shown, losses, camera))
    assert made.networks == wanted.networks
    assert (made.name, made.haze, made.lens) == (before.name, before.haze, before.lens)
    with pytest.raises(ContractError, match=r"no table \[schedule\]"):
        with_losses("[data]\n", RECIPE)


def test_few_frames_are_judged_through_other_copies(tmp_path):
    recipe = tmp_path / "plate.toml"
    recipe.write_text(HAZY, encoding="utf-8")
    made = write_twins(recipe, tmp_path, counts=Counts(frames=6, judged=2))
    for path in made:
        trained, judged = read_recipe(path), read_recipe(judged_by(path))
        assert (trained.frames.count, judged.frames.count) == (6, 2)
        assert trained.lens.copies == judged.lens.copies == 1
        assert trained.lens.seed != judged.lens.seed
        assert judged.data == replace(trained.data, **PICTURES_ALONE)
        assert trained.networks == judged.networks
        assert judged.frames.tiles == JUDGED_TILES


def test_frames_outside_have_a_copy_for_every_distance(tmp_path):
    recipe = tmp_path / "plate.toml"
    recipe.write_text(HAZY, encoding="utf-8")
    counts = Counts(frames=6, judged=8)
    depths = (500.0, 2000.0, math.inf)
    shown, wild = map(read_recipe, write_twins(recipe, tmp_path, depths, counts=counts))
    assert (shown.lens.depths_mm, shown.lens.copies) == ((), 1)
    assert (wild.lens.depths_mm, wild.lens.copies) == (depths, 3)
    assert wild.lens.bank_in_focus
