"""A network on planes."""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, Self, cast

from pydantic import Field, model_validator

from camkit.bundle.entry import Positive, Word
from camkit.bundle.facts import NetworkFacts, Port
from camkit.bundle.light_bound import BOUND_REACH_PX, LightBound
from camkit.bundle.plane import Plane
from camkit.bundle.sensor import RGB
from camkit.bundle.stages.entry import (
    BOUNDED,
    JoinError,
    Parts,
    StageEntry,
    need_domain,
    need_masks,
    need_rows,
)
from camkit.bundle.stages.foreign.coding import Coding, Numbers, Space
from camkit.bundle.stages.foreign.pack import CODED

DEFAULT_ROLE = "restore"
MAX_FINER = 64
"""Samples along a side for one pixel of the sensor, all networks of a bundle together."""


class Network(StageEntry):
    """A network, in one of the sizes that the bundle holds for its role.

    Its planes are the inputs of the network, in order, and what it gives are its outputs. The last
    input is the best that is known before it: of its grid and domain are the outputs. Behind the
    inputs may come a mask of what clipped, where the light that the network moves is bounded.

    Attributes:
        role: Key of `networks` in the manifest.
        transform: stabilise takes linear planes to equal noise (k-sigma, then square root) before
            the network and back behind it; none hands them on as they are; camera, rec709 and
            srgb code them as `coding` says and take them back behind it (format 2.11).
        scale: Divisor behind the square root; the noise there is 0.5 / scale at any ISO.
        most_light: How many times the largest light of its tile an output may have; what exceeds
            it is not believed.
        lights_px: Farther than this from clipped samples its output is its last plane, bit for bit,
            so it need not run there (format 2.2); None for one that acts everywhere.
        light: How far the local mean of its output may leave that of its last plane (format 2.8);
            None for one that may move light, as before.
        keeps_white: Whether its output is at least its last plane, or white where that is brighter
            (format 2.8): no lamp ends darker than what is known before the network, in the
            colours of the camera and in those of the output.
        coding: The numbers of a network whose transform is a space (format 2.11); else None.
    """

    stands_in: ClassVar[int] = 1
    type: Literal["network"] = "network"
    takes: tuple[Word, ...] = ("rgb", "restored")
    gives: tuple[Word, ...] = ("clean",)
    role: Word = DEFAULT_ROLE
    transform: Literal["stabilise", "none", "camera", "rec709", "srgb"] = "stabilise"
    scale: Positive = 64.0
    most_light: Positive = 16.0
    lights_px: Annotated[int, Field(ge=1, le=1024)] | None = None
    light: Annotated[LightBound | None, BOUNDED] = None
    keeps_white: Annotated[bool, BOUNDED] = False
    coding: Annotated[Coding | None, CODED] = None

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.coding is None) != (self.transform in ("stabilise", "none")):
            raise ValueError("coding goes with the transforms camera, rec709 and srgb, all of them")
        return self

    @property
    def extra_reach_px(self) -> int:
        """Pixels that its stage looks beyond the reach of the network."""
        return 0 if self.light is None else BOUND_REACH_PX

    def join(self, planes: Sequence[Plane], parts: Parts) -> tuple[Plane, ...]:
        """Return the outputs of the network, on a finer grid where it says so."""
        sizes = parts.networks.get(self.role)
        if not sizes:
            raise JoinError(f"the bundle holds no network of the role {self.role!r}")
        planes = self._without_masks(planes)
        first = planes[0]
        need_rows(first)
        for plane in planes:
            if plane.grid != first.grid or plane.axes != first.axes:
                raise JoinError("its planes must lie on one grid")
            need_domain(plane, first.domain if self.transform == "none" else "linear")
            if self.transform == "stabilise":
                _check_noise(len(plane.channels), parts)
        for size, facts in sizes.items():
            _check_ports(size, facts.inputs, planes, noise=self.takes_noise)
        outputs = _outputs(sizes)
        if self.coding is not None:
            self._check_coding(self.coding, planes, outputs, parts)
        if self.light is not None or self.keeps_white:
            self._check_bound(planes[-1], outputs)
        last = planes[-1]
        _check_finest(last, outputs)
        if self.transform == "stabilise":
            _check_stabilised(last, outputs, parts)
        return tuple(
            last.model_copy(
                update={
                    "type": "float32",
                    "channels": _names(port, planes, parts),
                    "grid": last.grid.finer(port.scale),
                }
            )
            for port in outputs
        )

    @property
    def is_one_coding(self) -> bool:
        """Return whether the network gives the numbers that it takes."""
        coding = self.coding
        if coding is None:
            return True
        numbers = self.transform, coding.gain, coding.offset
        return numbers == (coding.output, coding.output_gain, coding.output_offset)

    @property
    def space(self) -> Space | None:
        """Return the space of its coded planes; None where they are not coded."""
        return None if self.coding is None else cast("Space", self.transform)

    @property
    def takes_noise(self) -> bool:
        """Return whether a map of the noise lies behind its planes."""
        return self.coding is not None and self.coding.noise

    def _check_coding(
        self, coding: Coding, planes: Sequence[Plane], outputs: Sequence[Port], parts: Parts
    ) -> None:
        """Refuse numbers of other channels than there are, and colours of what has none."""
        for plane in planes:
            _check_colours(self.transform, plane.channels)
            _check_numbers(coding.gain, len(plane.channels))
            _check_numbers(coding.offset, len(plane.channels))
        for port in outputs:
            if coding.output != "camera" and port.channels not in (1, len(RGB)):
                raise JoinError(
                    f"{coding.output} has red, green and blue; it gives {port.channels}"
                )
            _check_numbers(coding.output_gain, port.channels)
            _check_numbers(coding.output_offset, port.channels)
        if coding.noise and len(parts.sensor.channels) not in (1, len(RGB)):
            raise JoinError("a map of the noise is known of grey or of red, green and blue")

    def _without_masks(self, planes: Sequence[Plane]) -> list[Plane]:
        """Return the planes that are inputs, without the masks behind them."""
        inputs = [plane for plane in planes if plane.domain != "mask"]
        masks = [plane for plane in planes if plane.domain == "mask"]
        if not inputs:
            raise JoinError("it takes at least one plane")
        if masks and self.light is None:
            raise JoinError("it takes a mask only where the light that it moves is bounded")
        if list(planes) != inputs + masks or len(masks) > 1:
            raise JoinError("it takes one mask at most, behind its inputs")
        need_masks(masks, inputs[0], "leaves as they are")
        return inputs

    def _check_bound(self, last: Plane, outputs: Sequence[Port]) -> None:
        """Refuse a bound on outputs that have no counterpart among what is taken."""
        if self.transform != "stabilise":
            raise JoinError("light is bounded where planes are stabilised, and this takes them raw")
        if [(port.channels, port.scale) for port in outputs] != [(len(last.channels), 1)]:
            raise JoinError("its light is bounded by its last plane, which its output must match")


def _check_colours(space: str, channels: tuple[str, ...]) -> None:
    if space != "camera" and len(channels) != 1 and channels != RGB:
        raise JoinError(f"{space} has red, green and blue; a plane has {', '.join(channels)}")


def _check_numbers(numbers: Numbers, channels: int) -> None:
    if len(numbers) not in (1, channels):
        raise JoinError(f"{len(numbers)} gains or offsets do not go with {channels} channels")


def _check_ports(size: str, ports: Sequence[Port], planes: Sequence[Plane], *, noise: bool) -> None:
    expected = [port.channels for port in ports]
    got = [*(len(plane.channels) for plane in planes), *[1][:noise]]
    if expected != got:
        raise JoinError(
            f"its network of size {size} has inputs of {_listed(expected)} channels "
            f"({', '.join(port.name for port in ports)}); its planes have {_listed(got)}"
        )


def _check_noise(count: int, parts: Parts) -> None:
    """Refuse to stabilise what is not of the sensor's channels: their noise alone is known."""
    channels = parts.sensor.channels
    if count != len(channels):
        raise JoinError(
            f"it stabilises by the noise of {', '.join(channels)}, one of each; a plane has {count}"
        )


def _check_stabilised(last: Plane, outputs: Sequence[Port], parts: Parts) -> None:
    """Refuse outputs that cannot be taken back to light."""
    for port in outputs:
        _check_noise(port.channels, parts)
        if port.channels != len(last.channels):
            raise JoinError(
                f"stabilised outputs become light by the noise of its last plane, which has "
                f"{len(last.channels)} channel(s)"
            )


def _check_finest(plane: Plane, outputs: Sequence[Port]) -> None:
    """Refuse outputs that no memory holds."""
    finest = plane.grid.pitch_ratio / max(port.scale for port in outputs)
    if finest < 1 / MAX_FINER:
        raise JoinError(
            f"its outputs are {1 / finest:g} times as fine as the sensor; at most {MAX_FINER} "
            "times is admitted"
        )


def _outputs(sizes: Mapping[str, NetworkFacts]) -> tuple[Port, ...]:
    first = next(iter(sizes.values())).outputs
    for size, facts in sizes.items():
        if facts.outputs != first:
            raise JoinError(f"its sizes differ in their outputs; compare {size} with the others")
    return first


def _names(port: Port, planes: Sequence[Plane], parts: Parts) -> tuple[str, ...]:
    """Return the channel names of an output: those of the last plane of that many, or numbers."""
    for plane in reversed(planes):
        if len(plane.channels) == port.channels:
            return plane.channels
    if len(parts.sensor.channels) == port.channels:
        return parts.sensor.channels
    return tuple(f"{port.name}{i}"[-16:] for i in range(port.channels))


def _listed(counts: Sequence[int]) -> str:
    return " + ".join(map(str, counts)) or "no"
