"""Facts measured at export: those about each network, and the card of the camera."""

from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from camkit.bundle.entry import Count, Entry, NonNegative, Positive, Word

MAX_REACH_PX: Final = 4096
"""Far beyond any network that may be tiled: the reference networks of 64 channels reach 446 px."""
MOST_NAMED: Final = 3
"""Operators that a message names."""
Reach = Annotated[int, Field(ge=0, le=MAX_REACH_PX)]


class HaloError(Entry):
    """The error of a halo: the difference of tiled and whole picture.

    Attributes:
        max_abs: Largest |difference| in the network's own (stabilised) units.
        psnr_db: PSNR of tiled against whole; None where they are equal.
    """

    halo_px: Reach
    max_abs: NonNegative
    psnr_db: float | None


class Port(Entry):
    """Some of the channels of a network's input or output, in order.

    Attributes:
        name: For people and error messages.
        channels: How many.
        scale: Samples along a side for one of the network's input; 1 for inputs.
    """

    name: Word
    channels: Annotated[int, Field(gt=0, le=1024)]
    scale: Annotated[int, Field(ge=1, le=16)] = 1


class NetworkFacts(Entry):
    """One size of network: its member, and facts measured at export and verified by the check.

    Pixels are those of the network's input.

    Attributes:
        member: Name of the fp32 ONNX in the bundle.
        fp16_member: Name of the fp16 ONNX, present only if its range is proven.
        input_name: Name of the tensor (1, channels, H, W) float32 that holds all inputs.
        inputs: What its channels are: one entry for each plane that the stage takes.
        output_name: Name of the tensor (1, channels, scale H, scale W) float32 of all outputs.
        outputs: What its channels are: one entry for each plane that the stage gives.
        receptive_field_radius_px: By the walk through the graph.
        receptive_field_probe_px: By perturbing pixels; the reach is the larger of the two.
        stride_px: H and W must be multiples of it.
        global_operators: Nodes that see the whole picture (none may be tiled exactly).
        halo_error: Error over halo, by increasing halo.
        max_activation: Largest |activation| of all nodes over the golden cases.
        node_activation: The same per node.
        fp16_headroom: Factor by which HDR input may exceed the golden cases.
        fp16_safe: Whether max_activation * fp16_headroom stays below 65504 / 4.
        mac_per_pixel: Multiplications per pixel.
        bytes_per_pixel: Peak of live activations in fp32 per pixel.
        parity_max_abs: Largest |torch - ONNX| on golden and random input.
        parameters: Number of weights.
    """

    member: str
    fp16_member: str | None = None
    input_name: str = "input"
    inputs: Annotated[tuple[Port, ...], Field(min_length=1, max_length=64)]
    output_name: str = "output"
    outputs: Annotated[tuple[Port, ...], Field(min_length=1, max_length=64)]
    receptive_field_radius_px: Reach
    receptive_field_probe_px: Reach
    stride_px: Annotated[int, Field(gt=0, le=256)]
    global_operators: tuple[str, ...] = ()
    halo_error: Annotated[tuple[HaloError, ...], Field(max_length=256)] = ()
    max_activation: NonNegative
    node_activation: dict[str, NonNegative] = Field(default_factory=dict)
    fp16_headroom: Positive = 4.0
    fp16_safe: bool
    mac_per_pixel: NonNegative
    bytes_per_pixel: NonNegative
    parity_max_abs: NonNegative
    parameters: Count

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.fp16_member is not None and not self.fp16_safe:
            raise ValueError("an fp16 member needs fp16_safe, that is a proven range")
        if any(port.scale != 1 for port in self.inputs):
            raise ValueError("the inputs of a network lie on its pixels: scale 1")
        if len({port.scale for port in self.outputs}) > 1:
            raise ValueError("the outputs of a network lie on one grid: one scale")
        halos = [entry.halo_px for entry in self.halo_error]
        if halos != sorted(set(halos)):
            raise ValueError(f"halo_error must come by increasing halo; got {halos}")
        return self

    @property
    def input_channels(self) -> int:
        """Channels of all inputs."""
        return sum(port.channels for port in self.inputs)

    @property
    def output_channels(self) -> int:
        """Channels of all outputs."""
        return sum(port.channels for port in self.outputs)

    @property
    def output_scale(self) -> int:
        """Samples along a side of the outputs for one pixel."""
        return self.outputs[0].scale

    @property
    def global_text(self) -> str:
        """Return the operators that see the whole picture, the first few by name; "" for none."""
        names = self.global_operators
        more = len(names) - MOST_NAMED
        return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")

    @property
    def reach_px(self) -> int:
        """The halo that exact tiling needs: the larger of walk and probe."""
        return max(self.receptive_field_radius_px, self.receptive_field_probe_px)


class CardRow(Entry):
    """One measured number, and the command that measures it again."""

    what: str
    value: float
    unit: str
    command: str


class StatedLaw(Entry):
    """The worst number of a law of a picture, as export met it.

    Attributes:
        worst: The number.
        limit: What is admitted.
        unit: Of both; "share" for parts of 1, which the first bundles of 2.8 call "%".
        kept: Whether the law is kept.
    """

    worst: float
    limit: float
    unit: str = ""
    kept: bool


class Card(Entry):
    """Measured accuracy and speed."""

    accuracy: tuple[CardRow, ...] = ()
    speed: tuple[CardRow, ...] = ()
