from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.models_def.training import validation
from camkit.models_def.training.samples import corner_height_mm
from camkit.models_def.training.validation import (
    FIELD_SHARES,
    ISOS,
    make_cases,
    score,
    score_capture,
    score_wiener,
    to_srgb,
)


@pytest.fixture(scope="module")
def cases(recipe, bank):
    return make_cases(recipe, bank, None)


def test_each_scene_is_taken_at_each_field_and_iso_by_the_unseen_copy(cases):
    places = {(c.field_share, c.iso) for c in cases}
    assert places == {(f, i) for f in FIELD_SHARES for i in ISOS}


def test_the_target_itself_scores_far_above_everything(cases, recipe):
    whole = [c for c in cases if bool((c.sample.target >= 0).all())]
    targets = {id(c.sample.planes): c.sample.target for c in whole}
    case = whole[0]
    values = to_srgb(targets[id(case.sample.planes)], case, recipe)
    assert np.abs(values - case.sharp).max() < 2e-3


def test_wiener_scores_above_the_capture(cases, recipe):
    assert score_wiener(cases, recipe).mean_db > score_capture(cases, recipe).mean_db


def test_score_means_agree_and_low_iso_is_easier(cases, recipe):
    result = score_wiener(cases, recipe)
    assert np.mean(list(result.by_iso.values())) == pytest.approx(result.mean_db)
    assert np.mean(list(result.by_field.values())) == pytest.approx(result.mean_db)
    assert result.by_iso[100.0] > result.by_iso[1600.0]


def test_black_scores_far_below(cases, recipe):
    black = score(cases, recipe, lambda planes: torch.zeros_like(planes[:, :3]))
    assert black.mean_db < score_capture(cases, recipe).mean_db - 3


def test_validation_goes_through_all_depths_of_the_unseen_copy_at_every_field(
    recipe, bank, monkeypatch
):
    taken = []

    def note(crop, exposure, *_):
        taken.append(exposure)

    monkeypatch.setattr(validation, "PROCEDURAL_PICTURES", 8)
    monkeypatch.setattr(validation, "make_sample", note)
    for depths in (1, 2, 5):
        taken.clear()
        deep = replace(bank, copies=np.repeat(bank.copies, depths, axis=0), depths=depths)
        make_cases(recipe, deep, None)
        unseen = set(range(deep.training_copies, len(deep.copies)))
        for iso in ISOS:
            for share in FIELD_SHARES:
                height = share * corner_height_mm(recipe)
                here = [e for e in taken if np.isclose(np.hypot(e.x_mm, e.y_mm), height)]
                assert {e.copy for e in here if e.iso == iso} == unseen
