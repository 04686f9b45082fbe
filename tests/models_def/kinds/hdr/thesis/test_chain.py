"""The three networks in a row: each is given what the one before gives, masked where it should."""

import torch

from camkit.models_def.kinds.hdr.thesis.chain import ThesisChain, saturated
from camkit.models_def.kinds.hdr.thesis.fusion import FusionConfig
from camkit.models_def.kinds.hdr.thesis.highlight import HighlightConfig
from camkit.models_def.kinds.hdr.thesis.splitting import SplittingConfig


def small_chain():
    torch.manual_seed(0)
    chain = ThesisChain(
        SplittingConfig(width=4, dilations=(1, 2), vgg_widths=(2, 2, 2, 2, 2)),
        HighlightConfig(widths=(4, 6)),
        FusionConfig(width=4, merged=4),
    )
    torch.nn.init.normal_(chain.splitting.last.weight, std=0.1)
    return chain


def test_a_pixel_is_saturated_where_any_colour_is():
    capture = torch.zeros(1, 3, 1, 3)
    capture[0, 2, 0, 1], capture[0, 0, 0, 2] = 1.0, 0.98
    assert saturated(capture).flatten().tolist() == [0, 1, 0]


def test_every_network_is_given_what_the_one_before_gives():
    chain = small_chain()
    capture = 1.2 * torch.rand(1, 3, 16, 32)
    found = chain.outputs(capture)
    clean, streaks = chain.splitting(capture)
    assert torch.equal(found.clean, clean)
    assert torch.equal(found.streaks, streaks)
    assert torch.equal(found.lights, chain.highlight(streaks))
    wanted = chain.fusion(clean, torch.where(saturated(capture) > 0, found.lights, 0.0))
    assert torch.equal(found.fused, wanted)
    assert torch.equal(chain(capture), wanted)
    assert chain.stride_px == 16


def test_the_last_loss_reaches_the_first_layer_but_not_vgg():
    chain = small_chain()
    capture = torch.full((1, 3, 16, 16), 0.5)
    capture[..., :4] = 1.0
    (chain(capture) - 2).square().mean().backward()
    assert chain.splitting.compress.weight.grad.abs().sum() > 0
    assert all(p.grad is None for p in chain.splitting.vgg.parameters())
