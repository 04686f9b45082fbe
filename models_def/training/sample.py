"""A training sample: what a network is given, by name, and what it should make of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import torch
from torch import Tensor, nn

from camkit.bundle.facts import Port
from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleLayout:
    """The shape of the samples of one role.

    Attributes:
        inputs: What the network is given, in the order of its channels.
        outputs: What it gives, in the order of its channels; one scale.
        turned: Whether a sample turned or mirrored is as good a sample. Not where the network
            should know which way blur points.
        masks: What a sample holds besides, on the samples of the inputs, for what is done behind
            the network.
    """

    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    turned: bool = True
    masks: tuple[Port, ...] = ()

    def __post_init__(self) -> None:
        if not self.inputs or len({port.scale for port in self.outputs}) != 1:
            raise ContractError("samples need inputs, and outputs of one scale")

    @property
    def input_channels(self) -> int:
        """Channels of all inputs."""
        return sum(port.channels for port in self.inputs)

    @property
    def stored_channels(self) -> int:
        """Channels of all inputs and masks."""
        return self.input_channels + sum(port.channels for port in self.masks)

    @property
    def output_channels(self) -> int:
        """Channels of all outputs."""
        return sum(port.channels for port in self.outputs)

    @property
    def scale(self) -> int:
        """Samples along a side of the outputs for one of the inputs."""
        return self.outputs[0].scale

    def check(self, name: str, network: nn.Module) -> None:
        """Refuse a network that does not map these samples to their targets.

        Args:
            name: Of the network, for the message.
            network: What it is.

        Raises:
            ContractError: Naming what it takes and gives.
        """
        stride_px: Any = network.stride_px
        side_px = 4 * stride_px
        planes = torch.zeros(1, self.input_channels, side_px, side_px)
        shape = (1, self.output_channels, self.scale * side_px, self.scale * side_px)
        was_training = network.training
        network.eval()
        try:
            with torch.no_grad():
                got = tuple(torch.as_tensor(network(planes)).shape)
        except RuntimeError as error:
            raise ContractError(
                f"{name} does not take the {self.input_channels} channels of its role "
                f"({', '.join(port.name for port in self.inputs)}): {error}"
            ) from error
        finally:
            network.train(was_training)
        if got != shape:
            raise ContractError(
                f"{name} must make {shape} of {tuple(planes.shape)}; it makes {got}"
            )

    def by_name(self, planes: Tensor) -> dict[str, Tensor]:
        """Split (b, channels, h, w) of all inputs, or inputs and masks, by their names."""
        ports = self.inputs
        if planes.shape[1] != self.input_channels:
            ports += self.masks
        parts = torch.split(planes, [port.channels for port in ports], dim=1)
        return {port.name: part for port, part in zip(ports, parts, strict=True)}

    def batch(self, planes: Tensor, target: Tensor, weight: Tensor) -> "Batch":
        """Return the patches of a step from (b, stored channels, p, p) planes."""
        inputs = self.by_name(planes)
        masks = {port.name: inputs.pop(port.name) for port in self.masks}
        return Batch(inputs=inputs, target=target, weight=weight, masks=masks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A finished sample.

    Attributes:
        inputs: Name -> (c, s, s), what the network is given, and the masks.
        target: (c, scale s, scale s), what it should give; negative where nothing can be known.
        weight: (c,) factor to the square-root domain of the signal, see `losses`.
    """

    inputs: Mapping[str, Tensor]
    target: Tensor
    weight: Tensor

    def stacked(self, layout: SampleLayout) -> Tensor:
        """Return inputs and masks as one (channels, s, s), in the order of the layout.

        Raises:
            ContractError: If the sample is not of that layout.
        """
        ports = layout.inputs + layout.masks
        planes = torch.cat([self.inputs[port.name] for port in ports])
        side = layout.scale * planes.shape[-1]
        shape = (layout.output_channels, side, side)
        if len(planes) != layout.stored_channels or tuple(self.target.shape) != shape:
            raise ContractError(
                f"a sample must have {layout.stored_channels} channels and a target of {shape}; "
                f"got {tuple(planes.shape)} and {tuple(self.target.shape)}"
            )
        return planes


@dataclass(frozen=True, slots=True, kw_only=True)
class Batch:
    """Patches of one step.

    Attributes:
        inputs: Name -> (b, c, p, p), in the order of the network's channels.
        target: (b, c, scale p, scale p).
        weight: (b, c).
        masks: Name -> (b, c, p, p).
    """

    inputs: Mapping[str, Tensor]
    target: Tensor
    weight: Tensor
    masks: Mapping[str, Tensor] = field(default_factory=dict)

    @property
    def planes(self) -> Tensor:
        """All inputs as one (b, channels, p, p)."""
        return torch.cat(list(self.inputs.values()), dim=1)


Finish = Callable[[Tensor, Batch], Tensor]
"""A step behind a network: its (b, c, h, w) output and the batch -> (b, c, h, w)."""
