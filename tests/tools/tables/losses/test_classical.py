"""Classical rows see what the bank sees: same captures, same kernels, another filter."""

import numpy as np
import pytest
import torch

from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.training.recipe import Recipe
from camkit.runtime.bank.baselines import method_numbers
from tests.bayer_recipe import bank, recipe, recipe_path  # noqa: F401
from tests.together_factory import TOGETHER
from tools.tables.losses.classical import (
    METHODS,
    TUNABLE,
    ClassicalMaker,
    by_block,
    tuned,
    wiener_alone,
    with_method,
)


@pytest.fixture
def maker(recipe, bank):  # noqa: F811
    return BayerMaker(recipe, bank, None, 5)


def test_the_bank_by_one_block_of_the_runtime_is_the_bank_of_training(maker, recipe):  # noqa: F811
    twin = ClassicalMaker(maker=maker, recipe=recipe, method=by_block("wiener"))
    for index in range(3):
        ours, theirs = maker.make(index), twin.make(index)
        assert torch.equal(ours.target, theirs.target)
        assert torch.equal(ours.inputs["capture"], theirs.inputs["capture"])
        gap = (ours.inputs["wiener"] - theirs.inputs["wiener"]).abs()
        assert float(gap.max()) < 1e-3 * float(ours.inputs["wiener"].abs().max())


@pytest.mark.parametrize("name", METHODS)
def test_every_method_comes_closer_to_the_truth_than_the_capture(maker, recipe, name):  # noqa: F811
    errors = []
    for index in range(4):
        sample = with_method(name, maker, recipe).make(index)
        judged = sample.target >= 0
        errors.append(
            [
                float((sample.inputs[part] - sample.target)[judged].square().mean())
                for part in ("capture", "wiener")
            ]
        )
    capture, restored = np.array(errors).T
    assert (restored < capture).sum() >= 3
    assert restored.sum() < capture.sum()


def test_tuning_climbs_to_where_no_step_helps():
    asked = []

    def score(numbers):
        asked.append(tuple(numbers.values()))
        a, b = (np.log2(value) for value in numbers.values())
        return -float((a - 5) ** 2 + (b + 3) ** 2 + (a - 5) * (b + 3) / 2)

    (best, best_score), *others = tuned({"a": 1.0, "b": 1.0}, score)
    assert best == {"a": 32.0, "b": 0.125}
    assert best_score == 0
    assert all(found < best_score for _, found in others)
    assert len(set(asked)) == len(asked) == 1 + len(others)
    # nothing gains: the start is the best, and both sides of every number were tried
    flat = tuned({"a": 4.0, "b": 1.0}, lambda _: 0.0)
    assert flat[0][0] == {"a": 4.0, "b": 1.0}
    assert len(flat) == 5
    # what never ends ends
    endless = tuned({"a": 1.0}, lambda numbers: -1 / numbers["a"])
    assert len(endless) < 80
    assert endless[0][0]["a"] == pytest.approx(2.0**64, rel=0.01)


@pytest.mark.parametrize("name", TUNABLE)
def test_numbers_of_the_runtime_do_what_the_runtime_does(maker, recipe, name):  # noqa: F811
    known = method_numbers(name)
    numbers = {key: known[key] for key in TUNABLE[name].start}
    plain = with_method(name, maker, recipe).make(1).inputs["wiener"]
    assert torch.equal(with_method(name, maker, recipe, numbers).make(1).inputs["wiener"], plain)
    other = {key: 4 * value for key, value in numbers.items()}
    assert not torch.equal(with_method(name, maker, recipe, other).make(1).inputs["wiener"], plain)


def test_alone_is_the_bank_without_its_model_of_colours(maker, recipe):  # noqa: F811
    developed = maker.developed(0)
    coupled = recipe.with_together(TOGETHER)
    plain = maker.make(0).inputs["wiener"]
    alone = ClassicalMaker(maker=maker, recipe=coupled, method=wiener_alone).make(0)
    assert torch.equal(alone.inputs["wiener"], plain)
    assert torch.equal(developed.planes, maker.developed(0).planes)


def test_cameras_without_a_bank_have_no_classical_rows(maker, recipe):  # noqa: F811
    other = Recipe(**{name: getattr(recipe, name) for name in Recipe.__dataclass_fields__})
    with pytest.raises(SystemExit, match="rl is for cameras behind a mosaic; tiny is none"):
        with_method("rl", maker, other)
