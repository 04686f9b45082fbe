"""The names under which recipes and checkpoints know the networks."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, Final

from torch import nn

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
from camkit.models_def.networks.near_lights import REACH_PX, NearLights
from camkit.models_def.networks.normed_unet import NormedConfig, NormedUnet
from camkit.models_def.networks.trimmed_unet import TrimmedConfig, TrimmedUnet


def _lean(base: LeanConfig, **config: Any) -> LeanUnet:
    return LeanUnet(replace(base, **config))


def _near_lights(base: LeanConfig, **config: Any) -> nn.Module:
    return NearLights(_lean(base, **config))


def _trimmed(**config: Any) -> nn.Module:
    return TrimmedUnet(TrimmedConfig(**config))


def _full(**config: Any) -> nn.Module:
    return FullUnet(FullConfig(**config))


def _constant(**config: Any) -> nn.Module:
    return ConstantUnet(ConstantConfig(**config))


def _normed(**config: Any) -> nn.Module:
    return NormedUnet(NormedConfig(**config))


_NEAR_LIGHTS: Final[dict[str, Callable[..., nn.Module]]] = {
    "lights_s": partial(_near_lights, LIGHTS_S),
    "lights_m": partial(_near_lights, LIGHTS_M),
}
_BUILDERS: Final[dict[str, Callable[..., nn.Module]]] = {
    "lean_s": partial(_lean, LEAN_S),
    "lean_m": partial(_lean, LEAN_M),
    "lean_l": partial(_lean, LEAN_L),
    **_NEAR_LIGHTS,
    "trimmed_unet": _trimmed,
    "full_unet": _full,
    "constant_unet": _constant,
    "normed_unet": _normed,
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
        name: One of `NETWORK_NAMES`.
        config: Fields of the network's config that differ from its defaults, as a recipe has them
            (lists are taken for tuples).

    Returns:
        A network with the attributes `in_channels` and `stride_px`; weights are drawn from torch's
        global generator.

    Raises:
        ContractError: If the name or a field is unknown or a value is out of range.
    """
    if name not in _BUILDERS:
        raise ContractError(f"network must be one of {', '.join(NETWORK_NAMES)}; got {name!r}")
    frozen = {k: tuple(v) if isinstance(v, list) else v for k, v in config.items()}
    try:
        return _BUILDERS[name](**frozen)
    except ContractError:
        raise
    except (TypeError, ValueError) as error:
        raise ContractError(f"network {name} does not take this configuration: {error}") from error
