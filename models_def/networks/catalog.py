"""The names under which recipes and checkpoints know the networks."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from torch import nn

from camkit.entry_points import entry_points, load_entry_point
from camkit.errors import ContractError
from camkit.models_def.networks.constant_unet import ConstantConfig, ConstantUnet
from camkit.models_def.networks.full_unet import FullConfig, FullUnet
from camkit.models_def.networks.lean_unet import (
    LEAN_L,
    LEAN_M,
    LEAN_S,
    LIGHTS_M,
    LIGHTS_S,
    LeanConfig,
    LeanUnet,
)
from camkit.models_def.networks.nafnet import NafConfig, Nafnet
from camkit.models_def.networks.near_lights import REACH_PX, NearLights
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet
from camkit.models_def.networks.trimmed_unet import TrimmedConfig, TrimmedUnet

GROUP: Final = "camkit.networks"
"""Of entry points, by which packages bring networks: what builds one of keyword arguments."""

Builders = Mapping[str, Callable[..., nn.Module]]
"""Name -> what builds a network of the fields of its config."""


def configured(network: Callable[..., nn.Module], config: Callable[..., Any]) -> Any:
    """Return what builds a network of the fields of its config."""
    return lambda **fields: network(config(**fields))


def changed(network: Callable[..., nn.Module], base: Any) -> Any:
    """Return what builds a network of a config with some fields changed."""
    return lambda **fields: network(replace(base, **fields))


def _near_lights(config: LeanConfig) -> nn.Module:
    return NearLights(LeanUnet(config))


_NEAR_LIGHTS: Final[Builders] = {
    "lights_s": changed(_near_lights, LIGHTS_S),
    "lights_m": changed(_near_lights, LIGHTS_M),
}
_BUILDERS: Final[dict[str, Callable[..., nn.Module]]] = {
    "lean_s": changed(LeanUnet, LEAN_S),
    "lean_m": changed(LeanUnet, LEAN_M),
    "lean_l": changed(LeanUnet, LEAN_L),
    **_NEAR_LIGHTS,
    "trimmed_unet": configured(TrimmedUnet, TrimmedConfig),
    "full_unet": configured(FullUnet, FullConfig),
    "constant_unet": configured(ConstantUnet, ConstantConfig),
    "normed_unet": configured(NormedUnet, NormedConfig),
    "nafnet": configured(Nafnet, NafConfig),
}

NETWORK_NAMES: Final = tuple(_BUILDERS)


def lights_px(name: str) -> int | None:
    """Return the distance from lights up to which a network acts; None if it acts everywhere."""
    return REACH_PX if name in _NEAR_LIGHTS else None


def check_patch(name: str, network: nn.Module, patch_px: int) -> None:
    """Refuse the side of a patch that a network cannot take.

    Raises:
        ContractError: If it is not a multiple of the network's stride.
    """
    stride_px: Any = network.stride_px
    if patch_px < 1 or patch_px % stride_px:
        raise ContractError(
            f"schedule.patch_px must be a multiple of {stride_px} for {name}; got {patch_px}"
        )


def build_network(name: str, **config: Any) -> nn.Module:
    """Build an untrained network.

    Args:
        name: One of `NETWORK_NAMES`, or an entry point of the group `camkit.networks`.
        config: Fields of the network's config that differ from its defaults, as a recipe has them
            (lists are taken for tuples).

    Returns:
        A network with the attributes `in_channels` and `stride_px`; weights are drawn from torch's
        global generator.

    Raises:
        ContractError: If the name or a field is unknown or a value is out of range.
    """
    return build_one(_all_builders(name), name, config)


def _all_builders(name: str) -> Builders:
    """Return the networks of camkit, and that of this name if a package brings it."""
    installed = entry_points(GROUP)
    if name in _BUILDERS or name not in installed:
        return _BUILDERS | dict.fromkeys(installed, _not_loaded)
    builder = load_entry_point(installed[name], "network")
    if not callable(builder):
        raise ContractError(f"the network {name!r} of {installed[name].value} builds nothing")
    return {name: builder}


def _not_loaded(**_: Any) -> nn.Module:
    """Refuse to build: nobody asks for it."""
    raise AssertionError


def build_one(builders: Builders, name: str, config: Mapping[str, Any]) -> nn.Module:
    """Build an untrained network of a list.

    Args:
        builders: The list.
        name: In it.
        config: Fields that differ from the defaults; lists are taken for tuples.

    Raises:
        ContractError: If the name or a field is unknown, or a value out of range.
    """
    if name not in builders:
        raise ContractError(f"network must be one of {', '.join(builders)}; got {name!r}")
    frozen = {k: tuple(v) if isinstance(v, list) else v for k, v in config.items()}
    try:
        return builders[name](**frozen)
    except ContractError:
        raise
    except (TypeError, ValueError) as error:
        raise ContractError(f"network {name} does not take this configuration: {error}") from error
