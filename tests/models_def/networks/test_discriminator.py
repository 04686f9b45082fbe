"""The discriminators see what they are said to see."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig


@pytest.mark.parametrize(("layers", "side"), [(3, 70), (5, 286)])
def test_a_score_sees_a_square_of_the_stated_side(layers: int, side: int) -> None:
    judge = Discriminator(DiscriminatorConfig(layers=layers, width=2)).double()
    for module in judge.modules():
        if isinstance(module, nn.InstanceNorm2d):
            module.forward = lambda x: x  # type: ignore[method-assign]  # it sees everything
    picture = torch.rand(1, 3, 2 * side, 2 * side, dtype=torch.float64, requires_grad=True)
    scores = judge(picture)
    scores[0, 0, scores.shape[2] // 2, scores.shape[3] // 2].backward()
    assert picture.grad is not None
    rows = picture.grad.abs().sum((0, 1, 3)).nonzero()[:, 0]
    assert int(rows.max() - rows.min()) + 1 == side


def test_strides_widths_and_norms_are_those_of_the_source() -> None:
    judge = Discriminator(DiscriminatorConfig(layers=5))
    convs = [m for m in judge.modules() if isinstance(m, nn.Conv2d)]
    assert [c.stride[0] for c in convs] == [2, 2, 2, 2, 2, 1, 1]
    assert [c.out_channels for c in convs] == [64, 128, 256, 512, 512, 512, 1]
    assert sum(isinstance(m, nn.InstanceNorm2d) for m in judge.modules()) == len(convs) - 2


@pytest.mark.parametrize("layers", [3, 5])
def test_small_patches_have_scores_too(layers: int) -> None:
    scores = Discriminator(DiscriminatorConfig(layers=layers, width=2))(torch.rand(1, 3, 32, 32))
    assert min(scores.shape[-2:]) > 1
    assert torch.isfinite(scores).all()


def test_impossible_shapes_are_refused() -> None:
    with pytest.raises(ContractError, match="layers and width >= 1"):
        DiscriminatorConfig(layers=0)
