from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.models_def.kinds.bayer import validation
from camkit.models_def.kinds.bayer.samples import corner_height_mm
from camkit.models_def.kinds.bayer.validation import (
    FIELD_SHARES,
    ISOS,
    BayerJudge,
    make_validation_captures,
    to_srgb,
)


@pytest.fixture(scope="module")
def captures(recipe, bank):
    return make_validation_captures(recipe, bank, None)


@pytest.fixture(scope="module")
def judge(recipe, captures):
    return BayerJudge(captures=captures, recipe=recipe)


def test_each_scene_is_taken_at_each_field_and_iso_by_the_unseen_copy(captures):
    places = {(c.field_share, c.iso) for c in captures}
    assert places == {(f, i) for f in FIELD_SHARES for i in ISOS}


def test_the_target_is_the_sharp_picture_where_it_is_not_the_banks(captures, recipe):
    known = 0
    for capture in captures:
        sample = capture.shot.sample
        asked = (sample.target != sample.inputs["wiener"]).all(0).numpy()
        gap = np.abs(to_srgb(sample.target, capture, recipe) - capture.sharp)
        assert gap[:, asked].max() < 2e-3
        known += asked.mean()
    assert known > 0.9 * len(captures)


def test_wiener_scores_above_the_capture(judge):
    baselines = judge.baselines()
    assert list(baselines) == ["capture", "wiener"]
    assert baselines["wiener"] > baselines["capture"]


def test_score_means_agree_and_low_iso_is_easier(judge):
    result = judge.score(lambda planes: planes[:, 3:])
    assert result.mean_db == judge.baselines()["wiener"]
    for part in ("by_iso", "by_field"):
        assert np.mean(list(result.parts[part].values())) == pytest.approx(result.mean_db)
    assert result.parts["by_iso"]["100"] > result.parts["by_iso"]["1600"]


def test_black_scores_far_below(judge):
    black = judge.score(lambda planes: torch.zeros_like(planes[:, :3]))
    assert black.mean_db < judge.baselines()["capture"] - 3


def test_validation_goes_through_all_depths_of_the_unseen_copy_at_every_field(
    recipe, bank, monkeypatch
):
    taken = []

    def note(crop, exposure, *_):
        taken.append(exposure)

    monkeypatch.setattr(validation, "PROCEDURAL_PICTURES", 8)
    monkeypatch.setattr(validation, "make_shot", note)
    for depths in (1, 2, 5):
        taken.clear()
        deep = replace(bank, copies=np.repeat(bank.copies, depths, axis=0), depths=depths)
        make_validation_captures(recipe, deep, None)
        unseen = set(range(deep.training_copies, len(deep.copies)))
        for iso in ISOS:
            for share in FIELD_SHARES:
                height = share * corner_height_mm(recipe)
                here = [e for e in taken if np.isclose(np.hypot(e.x_mm, e.y_mm), height)]
                assert {e.copy for e in here if e.iso == iso} == unseen


def test_several_unseen_copies_take_turns_at_every_field(recipe, bank, monkeypatch):
    taken = []
    monkeypatch.setattr(validation, "PROCEDURAL_PICTURES", 8)
    monkeypatch.setattr(validation, "make_shot", lambda _crop, exposure, *_: taken.append(exposure))
    for depths in (1, 2):
        taken.clear()
        many = np.repeat(bank.copies[:1], 5 * depths, axis=0)
        several = replace(bank, copies=many, depths=depths, validation_copies=4)
        make_validation_captures(recipe, several, None)
        unseen = set(range(depths, 5 * depths))
        assert {exposure.copy for exposure in taken} == unseen
        for share in FIELD_SHARES:
            there = {
                e.copy
                for e in taken
                if np.hypot(e.x_mm, e.y_mm) == pytest.approx(share * corner_height_mm(recipe))
            }
            assert there == unseen


def test_scores_are_told_by_copy_where_there_are_several(recipe, bank):
    several = replace(bank, copies=np.repeat(bank.copies, 2, axis=0), validation_copies=3)
    found = BayerJudge(captures=make_validation_captures(recipe, several, None), recipe=recipe)
    by_copy = found.score(lambda planes: planes[:, 3:]).parts["by_copy"]
    assert set(by_copy) == {"0", "1", "2"}


def test_planes_are_judged_as_a_mosaic_is(planes_recipe, bank):
    captures = make_validation_captures(planes_recipe, bank, None)
    baselines = BayerJudge(captures=captures, recipe=planes_recipe).baselines()
    assert baselines["wiener"] > baselines["capture"]
    for capture in captures[:2]:
        sample = capture.shot.sample
        asked = (sample.target != sample.inputs["wiener"]).all(0).numpy()
        gap = np.abs(to_srgb(sample.target, capture, planes_recipe) - capture.sharp)
        assert gap[:, asked].max() < 2e-3
