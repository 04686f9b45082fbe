"""Instance norms that look at a picture, and what stands in for them in a bundle: constants.

    LiveNorm     (x - mean) / deviation of the picture's own channel; not exact under tiling
    FrozenNorm   the same with the mean and deviation of calibration pictures; exact

A frozen norm that is given a picture of just these statistics gives what the live one gives; on any
other picture it does something else, which costs quality. How much is measured where norms are
frozen (`camkit freeze-norms`).
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError

VARIANCE_FLOOR: Final = 1e-5


def instance_norm(x: Tensor) -> Tensor:
    """Return (b, c, h, w) of mean 0 and variance 1 per picture and channel.

    A channel of one pixel becomes 0.
    """
    variance, mean = torch.var_mean(x, dim=(2, 3), correction=0, keepdim=True)
    return (x - mean) * torch.rsqrt(variance + VARIANCE_FLOOR)


class LiveNorm(nn.Module):
    """An instance norm without gain and offset."""

    sees_whole_picture: Final = True

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.channels = channels

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from the same."""
        return instance_norm(x)


class FrozenNorm(nn.Module):
    """An instance norm whose mean and deviation are constants; a new one has 0 and 1."""

    mean: Tensor
    scale: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(channels, 1, 1))
        self.register_buffer("scale", torch.ones(channels, 1, 1))

    def forward(self, x: Tensor) -> Tensor:
        """Return (b, c, h, w) from the same."""
        return (x - self.mean) * self.scale

    def take(self, mean: Tensor, variance: Tensor) -> None:
        """Set the constants from (c,) means and variances, in place."""
        self.mean.copy_(mean.reshape(-1, 1, 1))
        self.scale.copy_(torch.rsqrt(variance + VARIANCE_FLOOR).reshape(-1, 1, 1))


def picture_norm(channels: int, *, frozen: bool) -> nn.Module:
    """Return a norm of one kind or the other."""
    return FrozenNorm(channels) if frozen else LiveNorm(channels)


def live_norms(network: nn.Module) -> tuple[str, ...]:
    """Return the names of the parts of a network that look at a whole picture."""
    return tuple(
        name
        for name, part in network.named_modules()
        if getattr(part, "sees_whole_picture", False) or isinstance(part, nn.InstanceNorm2d)
    )


@torch.no_grad()
def freeze_norms(live: nn.Module, frozen: nn.Module, pictures: Sequence[Tensor]) -> int:
    """Return a network of frozen norms the weights of its live twin, and constants, in place.

    A constant is the mean, over the calibration pictures, of what the live norm computed: its
    means, and its variances.

    Args:
        live: With `LiveNorm`s.
        frozen: The same network with `FrozenNorm`s in their places.
        pictures: (1, c, h, w) inputs each.

    Returns:
        How many norms there are.

    Raises:
        ContractError: If there are no pictures, no norms, or the networks are not twins.
    """
    places = [name for name, part in live.named_modules() if isinstance(part, LiveNorm)]
    norms = {name: part for name, part in frozen.named_modules() if isinstance(part, FrozenNorm)}
    if not pictures:
        raise ContractError("norms are frozen with the statistics of pictures; none were given")
    if not places or set(places) != set(norms):
        raise ContractError(
            f"expected a network with live norms and its twin with frozen ones; got {len(places)} "
            f"and {len(norms)}"
        )
    statistics: dict[str, list[tuple[Tensor, Tensor]]] = {name: [] for name in places}
    with _watched(live, statistics):
        for picture in pictures:
            live(picture)
    weights = dict(live.state_dict())
    for name, norm in norms.items():
        means, variances = (torch.cat(parts) for parts in zip(*statistics[name], strict=True))
        norm.take(means.mean(0), variances.mean(0))
        weights |= {f"{name}.mean": norm.mean, f"{name}.scale": norm.scale}
    frozen.load_state_dict(weights)
    return len(places)


@contextmanager
def _watched(
    network: nn.Module, statistics: dict[str, list[tuple[Tensor, Tensor]]]
) -> Iterator[None]:
    """Record the (b, c) means and variances of the inputs of named parts."""

    def keeper(name: str) -> Any:
        def keep(_part: nn.Module, inputs: tuple[Tensor, ...]) -> None:
            variance, mean = torch.var_mean(inputs[0], dim=(2, 3), correction=0)
            statistics[name].append((mean, variance))

        return keep

    hooks = [
        network.get_submodule(name).register_forward_pre_hook(keeper(name)) for name in statistics
    ]
    try:
        yield
    finally:
        for hook in hooks:
            hook.remove()
