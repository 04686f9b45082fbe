"""A frozen norm is the live one on pictures of its statistics, and another on others."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightConfig, HighlightUnet
from camkit.models_def.networks.discriminator import Discriminator, DiscriminatorConfig
from camkit.models_def.networks.instance_norm import (
    FrozenNorm,
    LiveNorm,
    freeze_norms,
    instance_norm,
    live_norms,
)
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet


def twins() -> tuple[NormedUnet, NormedUnet]:
    torch.manual_seed(4)
    live = NormedUnet(NormedConfig(width=4, residual=False)).eval()
    frozen = NormedUnet(NormedConfig(width=4, residual=False, frozen=True)).eval()
    return live, frozen


def test_frozen_norm_is_the_live_one_where_the_statistics_are_its_constants() -> None:
    x = 3 * torch.randn(1, 5, 12, 9) + torch.arange(5.0).reshape(1, 5, 1, 1)
    norm = FrozenNorm(5)
    norm.take(x.mean((0, 2, 3)), x.var((0, 2, 3), correction=0))
    assert torch.allclose(norm(x), LiveNorm(5)(x), atol=1e-6)
    assert torch.allclose(norm(x), nn.functional.instance_norm(x), atol=1e-5)
    brighter = 2 * x
    assert torch.allclose(instance_norm(brighter), instance_norm(x), atol=1e-4)
    assert not torch.allclose(norm(brighter), norm(x), atol=0.1)


def test_frozen_network_gives_the_calibration_picture_as_the_live_one_does() -> None:
    live, frozen = twins()
    picture = torch.rand(1, 6, 128, 128)
    assert freeze_norms(live, frozen, [picture]) == 10
    with torch.no_grad():
        assert torch.allclose(frozen(picture), live(picture), atol=1e-4)
        darker = 0.2 * picture
        assert not torch.allclose(frozen(darker), live(darker), atol=1e-2)


def test_constants_are_means_over_the_calibration_pictures() -> None:
    live, frozen = twins()
    pictures = [torch.rand(1, 6, 128, 128), torch.rand(1, 6, 64, 192) ** 3]
    freeze_norms(live, frozen, pictures)
    with torch.no_grad():
        given = [live.downs[0][:2](live.head(p)) for p in pictures]
    means = torch.stack([g.mean((0, 2, 3)) for g in given]).mean(0)
    variances = torch.stack([g.var((0, 2, 3), correction=0) for g in given]).mean(0)
    norm = frozen.downs[0][2]
    assert torch.allclose(norm.mean.flatten(), means, atol=1e-6)
    assert torch.allclose(norm.scale.flatten(), (variances + 1e-5).rsqrt(), rtol=1e-4)


def test_weights_are_kept_and_the_live_network_is_left_alone() -> None:
    live, frozen = twins()
    before = {name: t.clone() for name, t in live.state_dict().items()}
    freeze_norms(live, frozen, [torch.rand(1, 6, 64, 64)])
    state = frozen.state_dict()
    assert all(torch.equal(state[name], t) for name, t in before.items())
    assert all(torch.equal(live.state_dict()[name], t) for name, t in before.items())
    assert not any(part._forward_pre_hooks for part in live.modules())


def test_whatever_looks_at_a_whole_picture_is_named() -> None:
    critic = Discriminator(DiscriminatorConfig(layers=2, width=4))
    assert len(live_norms(critic)) == 2
    assert len(live_norms(HighlightUnet(HighlightConfig(widths=(4, 4, 4))))) == 8
    assert live_norms(nn.Conv2d(1, 1, 3)) == ()


def test_what_cannot_be_frozen_is_refused() -> None:
    live, frozen = twins()
    with pytest.raises(ContractError, match="statistics of pictures; none were given"):
        freeze_norms(live, frozen, [])
    with pytest.raises(ContractError, match="its twin with frozen ones; got 10 and 0"):
        freeze_norms(live, live, [torch.rand(1, 6, 64, 64)])
