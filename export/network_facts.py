"""Facts measured about a network at export, for the manifest and for `camkit check`.

torch network -> draft_network     its graph, and the facts that follow from it: enough to run it
              -> measure_network   on its inputs in the pipeline: reach, range, parity, halo
"""

from dataclasses import dataclass
from typing import Final

from torch import nn

from camkit.arrays import FloatArray
from camkit.bundle.container import MAX_BUNDLE_BYTES
from camkit.bundle.facts import NetworkFacts
from camkit.errors import ContractError, UnsupportedError
from camkit.export.graph_measurements import arena_bytes, measured_of
from camkit.export.onnx_graph import check_parity, to_fp16, to_onnx
from camkit.models_def.networks.instance_norm import live_norms
from camkit.models_def.training.sample import SampleLayout
from camkit.progress import working
from camkit.runtime.network.graph import inspect_graph

FP16_HEADROOM: Final = 4.0
MOST_HALF_BYTES: Final = MAX_BUNDLE_BYTES // 2
"""Of both precisions of a network; a larger one has fp32 alone, or no bundle could hold it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExportedNetwork:
    """An exported network with its facts and members; the fp32 model is among them."""

    facts: NetworkFacts
    members: dict[str, bytes]


@working("turning a network into ONNX")
def draft_network(name: str, network: nn.Module, layout: SampleLayout) -> ExportedNetwork:
    """Export a network with the facts of its graph; nothing is measured yet.

    Args:
        name: Of its member, without suffix.
        network: The trained network.
        layout: What it takes and gives.

    Raises:
        ContractError: If the network takes or gives something else, or looks at whole pictures.
        ParityError: If torch and ONNX disagree.
    """
    if live := live_norms(network):
        raise ContractError(
            f"{name} has {len(live)} norms that look at a whole picture ({live[0]}, ...), so it "
            "cannot be tiled; camkit freeze-norms makes those of a normed_unet constants"
        )
    model = to_onnx(network, channels=layout.input_channels, scale=layout.scale)
    graph = inspect_graph(model)
    facts = NetworkFacts(
        member=f"{name}.onnx",
        inputs=layout.inputs,
        outputs=layout.outputs,
        receptive_field_radius_px=graph.receptive_field_radius_px,
        receptive_field_probe_px=0,
        stride_px=graph.stride_px,
        global_operators=graph.global_operators,
        max_activation=0.0,
        fp16_safe=False,
        mac_per_pixel=graph.mac_per_pixel,
        bytes_per_pixel=arena_bytes(graph),
        parity_max_abs=0.0,
        parameters=graph.parameters,
    )
    return ExportedNetwork(facts=facts, members={facts.member: model})


@working("measuring a network")
def measure_network(
    draft: ExportedNetwork, network: nn.Module, windows: list[FloatArray]
) -> ExportedNetwork:
    """Measure all facts that a bundle states of a network.

    Args:
        draft: Of `draft_network`.
        network: The same network in torch.
        windows: (1, channels, h, w) typical inputs, those of the golden cases among them; the
            first is the largest.

    Raises:
        ParityError: If torch and ONNX disagree.
    """
    facts = draft.facts
    model = draft.members[facts.member]
    parity = check_parity(network, model, windows, scale=facts.output_scale)
    measured = dict(measured_of(model, inspect_graph(model), windows))
    members = dict(draft.members)
    half = _half(model, measured["node_activation"])
    fp16_member = None if half is None else facts.member.replace(".onnx", "_fp16.onnx")
    if fp16_member is not None and half is not None:
        members[fp16_member] = half
    measured |= {
        "fp16_member": fp16_member,
        "fp16_headroom": FP16_HEADROOM,
        "fp16_safe": fp16_member is not None,
        "parity_max_abs": parity,
    }
    return ExportedNetwork(
        facts=NetworkFacts.model_validate({**dict(facts), **measured}), members=members
    )


def _half(model: bytes, activations: dict[str, float]) -> bytes | None:
    """Return a network in half precision where its range is proven and a bundle holds both."""
    if 3 * len(model) > 2 * MOST_HALF_BYTES:
        return None
    try:
        return to_fp16(model, activations, headroom=FP16_HEADROOM)
    except UnsupportedError:
        return None
