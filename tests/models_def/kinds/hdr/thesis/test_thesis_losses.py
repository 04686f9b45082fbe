"""The losses by their closed forms."""

import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.thesis_losses import (
    exclusion_loss,
    fused_loss,
    perceptual_loss,
    saturated_loss,
    total_loss,
    unsaturated_loss,
)


def test_perceptual_loss_is_the_weighted_mean_of_differences():
    wanted = [torch.rand(2, 4, 8, 8), torch.rand(2, 6, 4, 4), torch.rand(2, 8, 2, 2)]
    found = [x + gap for x, gap in zip(wanted, (1.0, -2.0, 4.0), strict=True)]
    assert float(perceptual_loss(found, wanted)) == pytest.approx(1 / 4.8 + 2 / 3.7 + 4 / 5.6)
    assert float(perceptual_loss(found[:1], wanted[:1], (3.0,))) == pytest.approx(3.0)
    assert float(perceptual_loss(wanted, wanted)) == 0


def test_perceptual_loss_refuses_other_layers():
    one = [torch.zeros(1, 1, 2, 2)]
    with pytest.raises(ContractError, match="features of 3 layers are compared; got 1, 1"):
        perceptual_loss(one, one)


def ramp(step, *, down=False):
    line = step * torch.arange(6.0)
    return (line[:, None] if down else line[None]).expand(1, 3, 6, 6)


def test_edges_in_the_same_place_are_punished_as_eq_5_8_says():
    a, b = 0.3, 0.7
    one, other = ramp(a), ramp(b)
    eta = math.sqrt(float(other.norm() / one.norm()))
    wanted = math.tanh(eta * a) * math.tanh(b / eta)
    # every difference along x is that, every one along y is nothing: the root mean square of both
    assert float(exclusion_loss(one, other)) == pytest.approx(wanted / math.sqrt(2), rel=1e-4)


def test_edges_across_each_other_are_free():
    assert float(exclusion_loss(ramp(0.3), ramp(0.7, down=True))) == pytest.approx(0, abs=2e-6)


def test_exclusion_does_not_depend_on_the_scale_of_both_or_on_their_order():
    torch.manual_seed(0)
    one, other = torch.rand(2, 3, 8, 8), torch.rand(2, 3, 8, 8)
    assert torch.allclose(exclusion_loss(one, other), exclusion_loss(other, one))
    # sqrt(|r| / |U|) |grad U| stays what it is when one is doubled and the other halved
    assert torch.allclose(exclusion_loss(one, other), exclusion_loss(2 * one, other / 2), rtol=1e-4)


def test_no_streaks_at_all_have_a_finite_gradient():
    streaks = torch.zeros(1, 3, 8, 8, requires_grad=True)
    clean = torch.rand(1, 3, 8, 8, requires_grad=True)
    loss = exclusion_loss(clean, streaks)
    loss.backward()
    assert float(loss.detach()) == pytest.approx(0, abs=2e-6)
    assert torch.isfinite(streaks.grad).all()
    assert torch.isfinite(clean.grad).all()


def test_losses_of_both_layers_and_their_sum():
    three, five = torch.tensor(3.0), torch.tensor(5.0)
    unsaturated = unsaturated_loss(three, five, perceptual_weight=2.0, exclusion_weight=0.5)
    assert float(unsaturated) == 2 * 3 + 0.5 * 5
    assert float(saturated_loss(three, weight=0.25)) == 0.75
    assert float(total_loss(three, five, unsaturated)) == 3 + 5 + 8.5


@pytest.mark.parametrize(
    ("fused", "truth", "wanted"),
    [
        (0.25, 0.09, 0.5 * (0.5 - 0.3) ** 2),  # a small gap of roots: half its square
        (100.0, 4.0, 10 - 2 - 0.5),  # a large one: its size less a half
    ],
)
def test_fused_loss_is_the_huber_loss_of_roots(fused, truth, wanted):
    fused, truth = (torch.full((1, 3, 2, 2), x - 1e-3) for x in (fused, truth))
    assert float(fused_loss(fused, truth)) == pytest.approx(wanted, rel=1e-4)


def test_fused_loss_has_a_finite_gradient_at_black():
    fused = torch.zeros(1, 3, 2, 2, requires_grad=True)
    fused_loss(fused, torch.ones(1, 3, 2, 2)).backward()
    assert torch.isfinite(fused.grad).all()
    assert (fused.grad < 0).all()
