"""Judges by PSNR: the truth is perfect, a known error has its closed form."""

import pytest
import torch

from camkit.models_def.kinds.hdr.thesis.coded_samples import PORTS
from camkit.models_def.kinds.hdr.thesis.validation import SAMPLES, CodedJudge
from camkit.models_def.training.kind import training_kind

KIND = training_kind("hdr")


@pytest.fixture
def judges(small_recipe, streaks):
    recipe = small_recipe()
    return {role: KIND.judge(recipe, role, streaks, None) for role in PORTS}


def test_every_role_has_fixed_samples_and_a_baseline_that_is_not_perfect(judges):
    for judge in judges.values():
        assert len(judge.samples) == SAMPLES
        (db,) = judge.baselines().values()
        assert 5 < db < 100
    assert [list(judge.baselines()) for judge in judges.values()] == [
        ["capture"],
        ["white"],
        ["pasted"],
        ["capture"],
    ]


def test_a_restoration_is_scored_against_its_own_truth(small_recipe, streaks):
    judge = KIND.judge(small_recipe(), "whole", streaks, None)
    truths = iter([truth for _, _, truth in judge.samples])
    score = judge.score(lambda _planes: next(truths))
    assert score.mean_db == 100
    assert set(score.parts["by_iso"]) == {"100", "800"}


@pytest.mark.parametrize(("role", "db"), [("split", 20.0), ("whole", 20 + 48.165)])
def test_an_error_of_a_tenth_is_20_db_below_the_peak(role, db):
    truth = torch.full((1, 3, 4, 4), 0.25**0.5)
    judge = CodedJudge(role=role, samples=((100.0, truth, truth),))
    score = judge.score(lambda planes: (planes.square() + 0.1).sqrt())
    assert score.mean_db == pytest.approx(db, abs=1e-3)
