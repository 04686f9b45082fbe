"""Torch checkpoint to bundle, in the order of the work.

    golden_cases    small captures of known scenes
    folding         its nodes in the form that costs least
    onnx_graph      a network becomes ONNX, held against torch
    graph_measurements  what running a graph shows
    network_facts   what is measured about it
    proving         golden members, activations on golden cases, the check before a name
    remeasured      a bundle that is there, with parts that were measured
    designed_optics  the lens or plate as designed, for the bundle
    energy, card    the card and the preview for people
    parts           the parts of a bundle, and the usual names of their files
    assemble        everything packed, proved, written
    foreign         trained networks of others
    packing         `camkit.export.bundle` and `camkit export`

Nothing is written when a proof fails.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from camkit.export.foreign.doors import add_network, inspect_network
    from camkit.export.packing import bundle

__all__ = ["add_network", "bundle", "inspect_network"]


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module 'camkit.export' has no attribute {name!r}")
    home = "camkit.export.packing" if name == "bundle" else "camkit.export.foreign.doors"
    return getattr(import_module(home), name)
