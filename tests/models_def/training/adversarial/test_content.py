"""Gram matrices against a slow reference; terms count as they are weighed."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.networks.vgg import VggLevels
from camkit.models_def.training.adversarial.content import (
    Conv33,
    Relu32,
    content_terms,
    gram,
    gram_loss,
)
from camkit.models_def.training.adversarial.views import make_views, pixel_loss
from camkit.models_def.training.recipe import ContentRecipe


def features(seed=0, shape=(2, 3, 4, 5)):
    return torch.rand(*shape, generator=torch.Generator().manual_seed(seed))


def slow_gram(x):
    """Eq. (3.6), entry by entry."""
    channels, height, width = x.shape
    found = torch.zeros(channels, channels)
    for i in range(channels):
        for j in range(channels):
            for y in range(height):
                for z in range(width):
                    found[i, j] += x[i, y, z] * x[j, y, z]
    return found / (channels * height * width)


def views(output, target):
    return make_views(output, target, torch.ones(1, 3), torch.eye(3))


def test_gram_matrices_are_those_of_a_slow_reference():
    x = features()
    assert torch.allclose(gram(x), torch.stack([slow_gram(one) for one in x]), atol=1e-6)


def test_gram_loss_is_the_sum_of_absolute_differences_and_blind_to_places():
    x, y = features(1), features(2)
    slow = [(slow_gram(a) - slow_gram(b)).abs().sum() for a, b in zip(x, y, strict=True)]
    assert float(gram_loss(x, y)) == pytest.approx(float(sum(slow)) / 2, rel=1e-4)
    assert float(gram_loss(x, x.flip(2))) == pytest.approx(0, abs=1e-6)
    assert float(gram_loss(x, x.flip(1))) > 1e-3


def test_features_are_those_behind_conv3_2_at_a_quarter_of_the_size():
    substitute = Relu32(None)
    picture = features(3, (1, 3, 16, 24))
    found = substitute(picture)
    assert found.shape == (1, 64, 4, 6)
    assert float(found.min()) == 0  # behind a ReLU
    assert list(substitute.levels.blocks[-1]) == ["10", "12"]
    assert torch.equal(found, Relu32(None)(picture))


def test_weights_of_vgg_are_read_where_a_file_is_given(tmp_path):
    torch.manual_seed(5)
    levels = VggLevels(blocks=3)
    state = {name: torch.rand_like(t) / 100 for name, t in levels.state_dict().items()}
    torch.save(state, tmp_path / "vgg19.pth")
    network = Relu32(tmp_path / "vgg19.pth")
    assert torch.equal(network.levels.state_dict()["features.12.bias"], state["features.12.bias"])
    with pytest.raises(ContractError, match="cannot read"):
        Relu32(tmp_path / "none.pth")


def test_fine_tuning_looks_at_conv3_3_before_its_relu(tmp_path):
    torch.manual_seed(5)
    levels = VggLevels(blocks=3, next_one=True)
    torch.save(levels.state_dict(), tmp_path / "vgg19.pth")
    network, picture = Conv33(tmp_path / "vgg19.pth"), features(3, (1, 3, 16, 24))
    assert network(picture).shape == (1, 256, 4, 6)
    assert network(picture).min() < 0


def test_unknown_pixels_have_no_gradient():
    output, target = features(1, (1, 3, 8, 8)).requires_grad_(), features(2, (1, 3, 8, 8))
    target[..., :4] = -1
    recipe = ContentRecipe(l1_weight=1.0, feature_weight=1.0)
    terms = content_terms(views(output, target), recipe, torch.Tensor.contiguous)
    sum(value for _, value in terms.values()).backward()
    assert (output.grad[..., :4] == 0).all()
    assert (output.grad[..., 4:] != 0).any()


def test_only_terms_that_count_are_computed():
    seen = views(features(6, (1, 3, 16, 16)), features(7, (1, 3, 16, 16)))
    assert set(content_terms(seen, ContentRecipe(), None)) == {"l1"}
    recipe = ContentRecipe(l1_weight=0.0, gram_weight=2.0, feature_weight=0.5)
    terms = content_terms(seen, recipe, Relu32(None))
    assert {name: weight for name, (weight, _) in terms.items()} == {"gram": 2.0, "features": 0.5}
    phi = Relu32(None)
    expected = gram_loss(phi(seen.fake), phi(seen.real))
    assert float(terms["gram"][1]) == pytest.approx(float(expected), rel=1e-5)
    (_, l1) = content_terms(seen, ContentRecipe(), None)["l1"]
    assert float(l1) == pytest.approx(float(pixel_loss(seen)))


def test_gradients_reach_the_output_alone():
    output = features(8, (1, 3, 16, 16)).requires_grad_()
    target = features(9, (1, 3, 16, 16)).requires_grad_()
    recipe = ContentRecipe(l1_weight=0.0, gram_weight=1.0, feature_weight=1.0)
    terms = content_terms(views(output, target), recipe, Relu32(None))
    sum(value for _, value in terms.values()).backward()
    assert output.grad.any()
    assert target.grad is None
