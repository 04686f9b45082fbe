"""Networks by name, and what each costs."""

import pytest
import torch
from torch import nn

from camkit.errors import ContractError
from camkit.models_def.networks.catalog import NETWORK_NAMES, build_network

# name: parameters, kMAC per pixel, total stride
COSTS = {
    "lean_s": (77_376, 4.56, 8),
    "lean_m": (285_824, 16.50, 16),
    "lean_l": (586_944, 34.49, 16),
    "lights_s": (77_376, 3.70, 8),
    "lights_m": (225_920, 14.70, 16),
    "trimmed_unet": (468_237, 98.85, 4),
    "full_unet": (33_608_861, 236.70, 64),
    "constant_unet": (845_525, 217.31, 16),
    "normed_unet": (21_463_632, 256.32, 64),
    "nafnet": (1_137_635, 20.34, 16),
}


def _kmac_per_px(network: nn.Module, side: int = 64) -> float:
    macs = 0

    def count(layer: nn.Module, inputs: tuple[torch.Tensor], output: torch.Tensor) -> None:
        nonlocal macs
        swept = inputs[0] if isinstance(layer, nn.ConvTranspose2d) else output
        macs += swept.shape[-2] * swept.shape[-1] * layer.weight.numel()

    for layer in network.modules():
        if isinstance(layer, nn.Conv2d | nn.ConvTranspose2d):
            layer.register_forward_hook(count)
    network(torch.zeros(1, 6, side, side))
    return macs / side**2 / 1000


def test_every_name_has_its_stated_cost() -> None:
    assert set(COSTS) == set(NETWORK_NAMES)
    for name, (parameters, kmac, stride_px) in COSTS.items():
        network = build_network(name)
        assert sum(p.numel() for p in network.parameters()) == parameters
        assert _kmac_per_px(network) == pytest.approx(kmac, abs=0.005)
        assert (network.stride_px, network.in_channels) == (stride_px, 6)


@pytest.mark.parametrize("name", [n for n in NETWORK_NAMES if not n.startswith("lights")])
def test_three_channel_network_maps_a_picture_to_a_picture(name: str) -> None:
    network = build_network(name, in_channels=3)
    assert network(torch.rand(1, 3, 64, 128)).shape == (1, 3, 64, 128)


def test_lists_of_a_recipe_are_taken_for_tuples() -> None:
    network = build_network("trimmed_unet", widths=[4, 8, 16])
    assert network.config.widths == (4, 8, 16)


def test_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(
        ContractError,
        match="lean_s, lean_m, lean_l, lights_s, lights_m, trimmed_unet",
    ):
        build_network("unet")


@pytest.mark.parametrize("config", [{"width": 2.5}, {"width": "wide"}, {"stages": None}])
def test_values_that_torch_cannot_take_are_refused_in_one_line(config: dict[str, object]) -> None:
    with pytest.raises(ContractError, match="normed_unet does not take this configuration"):
        build_network("normed_unet", **config)


def test_unknown_field_is_refused() -> None:
    with pytest.raises(ContractError, match="lean_m does not take this configuration"):
        build_network("lean_m", depth=3)
