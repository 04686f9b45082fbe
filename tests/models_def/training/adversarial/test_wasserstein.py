"""The critic's losses against closed forms, and a critic that tells two distributions apart."""

import math

import pytest
import torch
from torch import nn

from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig
from camkit.models_def.training.adversarial.wasserstein import (
    critic_loss,
    generator_loss,
    gradient_penalty,
)


def draw(seed=0):
    return torch.Generator().manual_seed(seed)


def pictures(count=3, seed=0):
    return torch.rand(count, 3, 8, 8, generator=draw(seed))


@pytest.mark.parametrize("steepness", [0.25, 1.0, 3.0])
def test_penalty_of_a_linear_critic_is_that_of_its_norm_everywhere(steepness):
    slope = torch.randn(3, 8, 8, generator=draw(1), dtype=torch.float64)
    slope *= steepness / slope.norm()
    real, fake = pictures(seed=2).double(), pictures(seed=3).double()
    found = gradient_penalty(lambda x: (x * slope).sum((1, 2, 3)), real, fake, draw())
    assert float(found) == pytest.approx((steepness - 1) ** 2, abs=1e-12)


def test_penalty_of_a_quadratic_critic_is_taken_between_the_pictures():
    # |grad| of |x|^2 / 2 is |x|; between 0 and a picture of norm 2 it is 2 * share.
    fake = torch.zeros(4, 3, 8, 8)
    real = torch.full_like(fake, 2 / math.sqrt(fake[0].numel()))
    share = torch.rand(4, 1, 1, 1, generator=draw(5)).flatten()
    found = gradient_penalty(lambda x: x.square().sum((1, 2, 3)) / 2, real, fake, draw(5))
    assert float(found.detach()) == pytest.approx(float((2 * share - 1).square().mean()), rel=1e-5)


def test_penalty_of_a_constant_critic_is_one_and_its_gradient_is_finite():
    weight = torch.zeros(3, 8, 8, requires_grad=True)
    found = gradient_penalty(lambda x: (x * weight).sum((1, 2, 3)), pictures(), pictures(), draw())
    found.backward()
    assert float(found.detach()) == pytest.approx(1)
    assert torch.isfinite(weight.grad).all()


def test_penalty_teaches_a_linear_critic_the_norm_one():
    weight = nn.Parameter(3 * torch.ones(3, 8, 8) / math.sqrt(192))
    optimizer = torch.optim.SGD([weight], lr=0.2)
    for step in range(30):
        optimizer.zero_grad()
        real, fake = pictures(seed=step), pictures(seed=step + 100)
        gradient_penalty(lambda x: (x * weight).sum((1, 2, 3)), real, fake, draw()).backward()
        optimizer.step()
    assert float(weight.detach().norm()) == pytest.approx(1, abs=1e-3)


def test_critic_and_generator_pull_the_same_scores_apart_and_together():
    real, fake = torch.tensor([2.0, 4.0]), torch.tensor([1.0, 0.0], requires_grad=True)
    assert float(critic_loss(real, fake).detach()) == pytest.approx(0.5 - 3)
    (up,) = torch.autograd.grad(generator_loss(fake), fake)
    (down,) = torch.autograd.grad(critic_loss(real, fake), fake)
    assert torch.equal(up, -down)
    assert (up < 0).all()


def test_a_critic_tells_smooth_pictures_from_noise():
    torch.manual_seed(1)
    network = Discriminator(DiscriminatorConfig(layers=2, width=8))
    optimizer = torch.optim.Adam(network.parameters(), lr=2e-3, betas=(0.5, 0.999))

    def scores(x):
        return network(x).mean((1, 2, 3))

    def noise(seed):
        return torch.rand(4, 3, 32, 32, generator=draw(seed))

    def smooth(seed):
        return nn.functional.avg_pool2d(noise(seed), 7, 1, 3, count_include_pad=False)

    for step in range(40):
        real, fake = smooth(step), noise(step + 1000)
        loss = critic_loss(scores(real), scores(fake))
        loss = loss + 10 * gradient_penalty(scores, real, fake, draw(step))
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
    with torch.no_grad():
        unseen = critic_loss(scores(smooth(5000)), scores(noise(6000)))
        same = critic_loss(scores(noise(7000)), scores(noise(8000)))
    assert float(unseen) < -0.5
    assert abs(float(same)) < 0.1 * abs(float(unseen))
