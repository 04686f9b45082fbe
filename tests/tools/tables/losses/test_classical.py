"""Classical rows see what the bank sees: same captures, same kernels, another filter."""

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.training import BayerMaker
from camkit.models_def.training.recipe import Recipe
from tests.bayer_recipe import bank, recipe, recipe_path  # noqa: F401
from tests.together_factory import TOGETHER
from tools.tables.losses.classical import (
    METHODS,
    ClassicalMaker,
    by_block,
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


def test_alone_is_the_bank_without_its_model_of_colours(maker, recipe):  # noqa: F811
    developed = maker.developed(0)
    coupled = recipe.with_together(TOGETHER)
    plain = maker.make(0).inputs["wiener"]
    alone = ClassicalMaker(maker=maker, recipe=coupled, method=wiener_alone).make(0)
    assert torch.equal(alone.inputs["wiener"], plain)
    assert torch.equal(developed.planes, maker.developed(0).planes)


def test_cameras_without_a_bank_have_no_classical_rows(maker, recipe):  # noqa: F811
    other = Recipe(**{name: getattr(recipe, name) for name in Recipe.__dataclass_fields__})
    with pytest.raises(ContractError, match="rl is for cameras behind a mosaic; tiny is none"):
        with_method("rl", maker, other)
