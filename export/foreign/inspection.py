"""Every obstacle of a foreign network at once; what it costs, and how a picture is tiled."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from camkit.bundle.facts import NetworkFacts, Port
from camkit.caller import command_text
from camkit.errors import BundleError, ContractError, ParityError, UnsupportedError
from camkit.export.foreign.canonical import canonical_draft, prove_equal, to_model
from camkit.export.foreign.contract import Contract
from camkit.export.foreign.global_statistics import with_constants, with_local_means
from camkit.export.foreign.onnx_file import ForeignModel
from camkit.runtime.content import CELL_PX
from camkit.runtime.job.walker import FIXED_BYTES
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.graph_walk import GraphFacts
from camkit.runtime.network.windows import NetworkWindows, SizedNetwork, WindowLimits, lay_network
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES

PICTURE_PX: Final = (4000, 6000)
"""(height, width) of a picture of 24 megapixels."""
STAGES_BYTES: Final = 60_000_000
"""Taken by the stages around a network at that size, roughly."""
_EVEN_PX: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Inspection:
    """The findings about a network.

    Attributes:
        name: Of its file.
        model: Decoded.
        obstacles: What must change before it can be added, all of it.
        warnings: What its owner should know.
        facts: Read from its canonical graph; None where there is none.
        difference: From the original.
        tiles: How a picture of 24 megapixels is tiled within the usual cap; None where it cannot.
        needed_bytes: What that takes, the stages around it included.
    """

    name: str
    model: ForeignModel
    obstacles: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    facts: GraphFacts | None = None
    difference: float | None = None
    tiles: dict[str, Any] | None = None
    needed_bytes: int | None = None

    def to_json(self) -> dict[str, Any]:
        """Return plain JSON values."""
        model, facts = self.model, self.facts
        record: dict[str, Any] = {
            "network": self.name,
            "opset": model.opset,
            "type": model.type,
            "input_channels": model.channels,
            "obstacles": list(self.obstacles),
            "warnings": list(self.warnings),
        }
        if facts is None:
            return record
        return record | {
            "output_channels": facts.output_channels,
            "scale": facts.output_scale,
            "reach_px": facts.receptive_field_radius_px,
            "stride_px": facts.stride_px,
            "global_operators": list(facts.global_operators),
            "parameters": facts.parameters,
            "kmac_per_pixel": round(facts.mac_per_pixel / 1e3, 3),
            "bytes_per_pixel": round(facts.block_bytes_per_pixel, 1),
            "difference": self.difference,
            "tiles_24mp": self.tiles,
            "needed_mb_24mp": None if self.needed_bytes is None else self.needed_bytes // 10**6,
        }

    def lines(self) -> list[str]:
        """Return lines for people."""
        model, facts = self.model, self.facts
        lines = [f"{self.name}: opset {model.opset}, {model.type}, {model.channels} channels in"]
        if facts is not None:
            finer = "" if facts.output_scale == 1 else f", {facts.output_scale} times as fine"
            lines += [
                f"  gives     {facts.output_channels} channels{finer}",
                f"  reach     {facts.receptive_field_radius_px} px, stride {facts.stride_px} px",
                f"  cost      {facts.mac_per_pixel / 1e3:.3g} kMAC per pixel, "
                f"{facts.block_bytes_per_pixel:.4g} bytes per pixel, {facts.parameters} parameters",
            ]
        if self.difference is not None:
            lines.append(f"  canonical graph within {self.difference:.1e} of the original")
        if self.tiles is not None and self.needed_bytes is not None:
            plan = ", ".join(f"{key} {value}" for key, value in self.tiles.items() if key != "mode")
            lines.append(f"  24 MP     {self.needed_bytes // 10**6} MB: {plan}")
        lines += [f"  warning   {text}" for text in self.warnings]
        lines += [f"  obstacle  {text}" for text in self.obstacles]
        if not self.obstacles:
            lines.append("  nothing stands in its way")
        return lines


def inspection_of(name: str, model: ForeignModel, contract: Contract | None = None) -> Inspection:
    """Find everything that stands in the way of a network.

    Args:
        name: Of its file.
        model: Decoded.
        contract: What it should take and give; None looks at the graph alone.
    """
    draft, obstacles = canonical_draft(model)
    if draft is None or obstacles:
        return Inspection(name=name, model=model, obstacles=obstacles)
    try:
        data = to_model(draft, model.channels)
        facts = inspect_graph(data)
        difference, _ = prove_equal(model, data, facts)
    except (BundleError, ParityError) as error:
        return Inspection(name=name, model=model, obstacles=(str(error),))
    findings = [*_global_obstacles(facts, contract), *contract_obstacles(facts, contract)]
    tiles = None
    try:
        data, facts = _settled(data, facts, contract)
        size_px = PICTURE_PX
        if contract is not None and contract.planes == "packed":
            size_px = (PICTURE_PX[0] // 2, PICTURE_PX[1] // 2)
        if not facts.global_operators or (contract is not None and contract.mode == "whole"):
            tiles = lay_whole_picture(data, facts, size_px)
    except ContractError as error:  # of the memory, which whoever processes may raise
        findings.append(f"24 megapixels by {command_text('process')}: {error}")
    except (BundleError, UnsupportedError) as error:
        findings.append(f"at 24 megapixels, {error}")
    fixed = FIXED_BYTES + STAGES_BYTES
    return Inspection(
        name=name,
        model=model,
        obstacles=tuple(findings),
        warnings=tuple(_warnings(facts)),
        facts=facts,
        difference=difference,
        tiles=None if tiles is None else tiles.to_json(),
        needed_bytes=None if tiles is None else fixed + tiles.needed_bytes(),
    )


def _settled(data: bytes, facts: GraphFacts, contract: Contract | None) -> tuple[bytes, GraphFacts]:
    """Return a graph whose statistics of the whole picture are settled as a contract says.

    Its constants are those of an even picture: they change no cost.
    """
    if contract is None or not facts.global_operators:
        return data, facts
    if contract.mode == "local":
        data = with_local_means(data, contract.local_px)
    elif contract.mode == "constants":
        side = -(-_EVEN_PX // facts.stride_px) * facts.stride_px
        even = np.full((1, facts.input_channels, side, side), 0.5, np.float32)
        data = with_constants(data, [even])
    return data, inspect_graph(data)


def _global_obstacles(facts: GraphFacts, contract: Contract | None) -> list[str]:
    names, mode = facts.global_operators, "refuse" if contract is None else contract.mode
    if not names or mode != "refuse":
        return []
    more = f" and {len(names) - 3} more" if len(names) > 3 else ""
    names_text = ", ".join(names[:3]) + more
    return [
        f"it looks at the whole picture ({names_text}), so tiles would differ from it: state "
        '[global] mode = "constants", "local:N" or "whole" in the contract'
    ]


def contract_obstacles(facts: GraphFacts, contract: Contract | None) -> list[str]:
    """Return where a graph and a contract disagree."""
    if contract is None:
        return []
    findings = []
    if facts.input_channels != contract.channels:
        parts = " + ".join(map(str, contract.plane_channels)) + (" + 1" if contract.noise else "")
        findings.append(
            f"it takes {facts.input_channels} channels; planes of the contract have {parts}"
        )
    if contract.scale not in (None, facts.output_scale):
        findings.append(
            f"its output is {facts.output_scale} time(s) as fine as its input, the contract says "
            f"{contract.scale}"
        )
    if contract.residual != "none":
        last = contract.plane_channels[-1]
        if (facts.output_channels, facts.output_scale) != (last, 1):
            findings.append(f"a residual has the {last} channel(s) and the grid of its last plane")
    expected = {"packed": {(3, 2), (4, 1)}, "mosaic": {(3, 1), (1, 1)}}
    if contract.is_of_mosaic:
        allowed = expected[contract.planes]
        if (facts.output_channels, facts.output_scale) not in allowed:
            texts = " or ".join(f"{c} channels at scale {s}" for c, s in sorted(allowed))
            findings.append(
                f"from {contract.planes} planes it gives {facts.output_channels} channels at scale "
                f"{facts.output_scale}; expected {texts}"
            )
    elif facts.output_channels != 3:
        findings.append(
            f"it gives {facts.output_channels} channels; red, green and blue are expected"
        )
    return findings


def _warnings(facts: GraphFacts) -> list[str]:
    findings = []
    if facts.unblocked_convolutions:
        names = facts.unblocked_convolutions
        findings.append(
            f"{len(names)} convolutions off onnxruntime's blocked path ({names[0]}, ...): tiles "
            "are compared with the whole when it is added"
        )
    return findings


def lay_whole_picture(data: bytes, facts: GraphFacts, size_px: tuple[int, int]) -> NetworkWindows:
    """Plan the windows of a picture within the usual cap.

    Args:
        data: A canonical graph.
        facts: Read from it.
        size_px: (height, width) on the grid of its input.

    Raises:
        ContractError: If the memory does not do.
    """
    engine = NetworkEngine(
        data, threads=1, scale=facts.output_scale, block_bytes=facts.block_bytes_per_pixel
    )
    network = SizedNetwork(
        size="M",
        run=engine.run,
        facts=plain_facts(facts),
        block_bytes=facts.block_bytes_per_pixel,
        segments=engine.segments,
    )
    limits = WindowLimits(
        cap_bytes=DEFAULT_MAX_MEM_BYTES,
        spent_bytes=FIXED_BYTES + STAGES_BYTES,
        mode="exact",
        cell_px=CELL_PX,
    )
    return lay_network(size_px, [network], limits)


def plain_facts(facts: GraphFacts, **changes: Any) -> NetworkFacts:
    """Return facts as a manifest states them, nothing measured yet.

    Args:
        facts: Read from the graph.
        changes: Fields that are known besides.
    """
    fields: dict[str, Any] = {
        "member": "network.onnx",
        "inputs": (Port(name="planes", channels=facts.input_channels),),
        "outputs": (Port(name="clean", channels=facts.output_channels, scale=facts.output_scale),),
        "receptive_field_radius_px": facts.receptive_field_radius_px,
        "receptive_field_probe_px": 0,
        "stride_px": facts.stride_px,
        "global_operators": facts.global_operators,
        "max_activation": 0.0,
        "fp16_safe": False,
        "mac_per_pixel": facts.mac_per_pixel,
        "bytes_per_pixel": facts.bytes_per_pixel,
        "parity_max_abs": 0.0,
        "parameters": facts.parameters,
    }
    return NetworkFacts(**(fields | changes))
