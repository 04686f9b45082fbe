"""The levels of VGG-19 are those of the published network; its file is checked by name."""

import pytest
import torch
from safetensors.torch import save_file
from torch.nn import functional

from camkit.errors import ContractError
from camkit.models_def.networks.vgg import VggLevels, take_vgg

NARROW = (4, 6, 8, 8, 8)


def by_hand(network, picture, pool):
    """Layer after layer of the published `features`, tapped behind the second of each block."""
    state = network.state_dict()
    mean = torch.tensor([0.485, 0.456, 0.406]).reshape(1, 3, 1, 1)
    std = torch.tensor([0.229, 0.224, 0.225]).reshape(1, 3, 1, 1)
    x, levels = (picture - mean) / std, []
    for layer in (
        0,
        2,
        "pool",
        5,
        7,
        "pool",
        10,
        12,
        14,
        16,
        "pool",
        19,
        21,
        23,
        25,
        "pool",
        28,
        30,
    ):
        if layer == "pool":
            x = pool(x, 2)
            continue
        names = f"features.{layer}.weight", f"features.{layer}.bias"
        x = functional.conv2d(x, state[names[0]], state[names[1]], padding=1).relu()
        if layer in (2, 7, 12, 21, 30):
            levels.append(x)
    return levels


@pytest.mark.parametrize(
    ("pooling", "pool"), [("average", functional.avg_pool2d), ("max", functional.max_pool2d)]
)
def test_levels_are_the_second_convolutions_of_the_five_blocks(pooling, pool):
    network, picture = VggLevels(widths=NARROW, pooling=pooling), torch.rand(1, 3, 32, 48)
    levels = network(picture)
    assert [tuple(x.shape[1:]) for x in levels] == [
        (width, 32 >> i, 48 >> i) for i, width in enumerate(NARROW)
    ]
    for found, wanted in zip(levels, by_hand(network, picture, pool), strict=True):
        assert torch.allclose(found, wanted, atol=1e-5)


def test_fewer_blocks_give_the_same_levels():
    picture = torch.rand(1, 3, 16, 16)
    whole, part = VggLevels(widths=NARROW), VggLevels(blocks=3, widths=NARROW)
    # the last block ends sooner, so what is drawn behind it differs, but nothing before
    assert torch.equal(whole(picture)[2], part(picture)[2])
    assert len(part(picture)) == 3


def test_the_next_convolution_is_a_level_before_its_relu():
    picture = torch.rand(1, 3, 16, 16)
    network = VggLevels(blocks=3, widths=NARROW, pooling="max", next_one=True)
    *levels, raw = network(picture)
    weight, bias = (network.state_dict()[f"features.14.{name}"] for name in ("weight", "bias"))
    assert torch.equal(raw, functional.conv2d(levels[-1], weight, bias, padding=1))
    assert raw.min() < 0
    assert len(levels) == 3


def test_weights_are_frozen_but_gradients_reach_the_picture():
    network = VggLevels(blocks=2, widths=NARROW)
    picture = torch.rand(1, 3, 8, 8, requires_grad=True)
    network(picture)[-1].sum().backward()
    assert picture.grad.abs().sum() > 0
    assert all(p.grad is None for p in network.parameters())


@pytest.mark.parametrize("ending", [".pth", ".safetensors"])
def test_a_file_gives_its_weights_and_may_hold_more(tmp_path, ending):
    source, network = VggLevels(widths=NARROW), VggLevels(blocks=4, widths=NARROW)
    table = {name: tensor + 1 for name, tensor in source.state_dict().items()}
    path = tmp_path / f"vgg{ending}"
    save_file(table, path) if ending == ".safetensors" else torch.save(table, path)
    take_vgg(network, path)
    assert all(torch.equal(t, table[name]) for name, t in network.state_dict().items())


def test_a_file_without_a_layer_is_refused(tmp_path):
    table = VggLevels(blocks=4, widths=NARROW).state_dict()
    torch.save(table, tmp_path / "vgg.pth")
    with pytest.raises(ContractError, match=r"expected features.23.weight of shape .*got nothing"):
        take_vgg(VggLevels(widths=NARROW), tmp_path / "vgg.pth")


def test_broken_files_are_refused(tmp_path):
    table, path = VggLevels(blocks=1).state_dict(), tmp_path / "vgg.pth"
    torch.save(table | {"features.0.bias": torch.full((64,), float("nan"))}, path)
    with pytest.raises(ContractError, match="holds NaN or inf"):
        take_vgg(VggLevels(blocks=1), path)
    broken = tmp_path / "vgg.safetensors"
    broken.write_bytes(b"\x10\0\0\0\0\0\0\0junk")
    with pytest.raises(ContractError, match="no plain tensors"):
        take_vgg(VggLevels(blocks=1), broken)


def test_a_file_that_holds_no_table_is_refused(tmp_path):
    torch.save([torch.zeros(1)], tmp_path / "vgg.pth")
    with pytest.raises(ContractError, match="must hold a table of tensors; got list"):
        take_vgg(VggLevels(blocks=1), tmp_path / "vgg.pth")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [({"blocks": 6}, "5 blocks"), ({"blocks": 0}, "5 blocks"), ({"pooling": "sum"}, "average or")],
)
def test_impossible_shapes_are_refused(wrong, message):
    with pytest.raises(ContractError, match=message):
        VggLevels(**wrong)
