"""VGG-19 weights come from a file of tensors, by torchvision's names, and run no code."""

import pickle

import pytest
import torch
from safetensors.torch import save_file
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.fine_tuning.vgg import CONVOLUTIONS, VggFeatures, read_vgg
from camkit.models_def.networks.vgg import file_digest


@pytest.fixture(scope="module")
def weights():
    draw = torch.Generator().manual_seed(0)
    table = {}
    for layer, (inputs, outputs) in CONVOLUTIONS.items():
        scale = (2 / (9 * inputs)) ** 0.5
        table[f"features.{layer}.weight"] = scale * torch.randn(
            outputs, inputs, 3, 3, generator=draw
        )
        table[f"features.{layer}.bias"] = 0.1 * torch.randn(outputs, generator=draw)
    # What else a torchvision file holds.
    return table | {"features.16.weight": torch.zeros(2, 2), "classifier.6.bias": torch.zeros(3)}


def by_hand(weights, picture):
    """The published network, layer after layer, to conv3_3 before its ReLU."""

    def conv(x, layer):
        names = f"features.{layer}.weight", f"features.{layer}.bias"
        return functional.conv2d(x, weights[names[0]], weights[names[1]], padding=1)

    mean = torch.tensor([0.485, 0.456, 0.406]).reshape(1, 3, 1, 1)
    std = torch.tensor([0.229, 0.224, 0.225]).reshape(1, 3, 1, 1)
    x = conv((picture - mean) / std, 0).relu()
    x = functional.max_pool2d(conv(x, 2).relu(), 2)
    x = conv(x, 5).relu()
    x = functional.max_pool2d(conv(x, 7).relu(), 2)
    x = conv(x, 10).relu()
    return conv(conv(x, 12).relu(), 14)


@pytest.mark.parametrize("ending", [".pth", ".safetensors"])
def test_features_are_conv3_3_before_its_relu(tmp_path, weights, ending):
    path = tmp_path / f"vgg19{ending}"
    save_file(weights, path) if ending == ".safetensors" else torch.save(weights, path)
    picture = torch.rand(1, 3, 32, 24)
    features = read_vgg(path)(picture)
    assert features.shape == (1, 256, 8, 6)
    assert torch.allclose(features, by_hand(weights, picture), atol=1e-4)
    assert features.min() < 0
    assert len(file_digest(path)) == 64


def test_weights_are_frozen_but_gradients_reach_the_picture():
    network = VggFeatures()
    picture = torch.rand(1, 3, 16, 16, requires_grad=True)
    network(picture).sum().backward()
    assert picture.grad.abs().sum() > 0
    assert all(p.grad is None for p in network.parameters())


def test_a_file_that_would_run_code_is_refused_and_runs_none(tmp_path):
    class Trap:
        def __reduce__(self):
            return (open, (str(tmp_path / "sprung"), "w"))

    path = tmp_path / "vgg19.pth"
    path.write_bytes(pickle.dumps({"features.0.weight": Trap()}, protocol=2))
    with pytest.raises(ContractError, match="no plain tensors"):
        read_vgg(path)
    assert not (tmp_path / "sprung").exists()


def test_another_network_missing_and_broken_files_are_refused(tmp_path, weights):
    path = tmp_path / "x.pth"
    torch.save({"features.0.weight": torch.zeros(64, 1, 3, 3)}, path)
    with pytest.raises(ContractError, match=r"features.0.weight of shape .*got \(64, 1, 3, 3\)"):
        read_vgg(path)
    torch.save(weights | {"features.14.bias": torch.full((256,), float("nan"))}, path)
    with pytest.raises(ContractError, match="holds NaN or inf"):
        read_vgg(path)
    with pytest.raises(ContractError, match="cannot read"):
        read_vgg(tmp_path / "none.pth")
    broken = tmp_path / "x.safetensors"
    broken.write_bytes(b"\x10\0\0\0\0\0\0\0junk")
    with pytest.raises(ContractError, match="no plain tensors"):
        read_vgg(broken)
