"""RaGAN-LS is what its source says, and pushes scores the right way."""

import pytest
import torch

from camkit.models_def.training.adversarial.relativistic import discriminator_loss, generator_loss


def slow_loss(high, low):
    """1/2 E[(h - E l - 1)^2] + 1/2 E[(l - E h + 1)^2], number by number."""
    mean_high, mean_low = sum(high) / len(high), sum(low) / len(low)
    above = sum((h - mean_low - 1) ** 2 for h in high) / len(high)
    below = sum((v - mean_high + 1) ** 2 for v in low) / len(low)
    return (above + below) / 2


@pytest.fixture
def scores():
    draw = torch.Generator().manual_seed(3)
    shapes = ((2, 1, 3, 4), (2, 1, 3, 4))
    return tuple(torch.randn(*s, generator=draw, dtype=torch.float64) for s in shapes)


def test_both_losses_equal_a_slow_obvious_sum(scores):
    real, fake = (s.flatten().tolist() for s in scores)
    assert discriminator_loss(*scores).item() == pytest.approx(slow_loss(real, fake), rel=1e-12)
    assert generator_loss(*scores).item() == pytest.approx(slow_loss(fake, real), rel=1e-12)


def test_discriminator_is_content_when_real_scores_one_more_and_generator_when_one_less():
    real, fake = torch.full((4,), 5.0), torch.full((4,), 4.0)
    assert discriminator_loss(real, fake).item() == 0
    assert generator_loss(fake, real).item() == 0
    assert generator_loss(real, fake).item() == 4


@pytest.mark.parametrize(("loss", "sign"), [(discriminator_loss, 1), (generator_loss, -1)])
def test_descent_parts_the_scores_for_the_discriminator_and_swaps_them_for_the_generator(
    loss, sign
):
    real, fake = (torch.zeros(6, requires_grad=True) for _ in range(2))
    loss(real, fake).backward()
    assert (sign * real.grad < 0).all()
    assert (sign * fake.grad > 0).all()


def test_a_shift_of_all_scores_changes_nothing(scores):
    real, fake = scores
    assert discriminator_loss(real + 7, fake + 7).item() == pytest.approx(
        discriminator_loss(real, fake).item(), rel=1e-12
    )
