"""The range of the numbers inside a network, and whether half precision can represent them."""

from collections.abc import Iterable, Mapping
from typing import Final

from camkit.arrays import FloatArray
from camkit.runtime.network.engine import largest_activations
from camkit.runtime.network.graph import with_node_outputs

FP16_LIMIT: Final = 65504 / 4
"""Largest activation, headroom included, for which an fp16 network is admitted: 2 bits to spare."""


def node_activations(model: bytes, windows: Iterable[FloatArray]) -> dict[str, float]:
    """Measure the largest |activation| of every tensor that a network computes.

    Args:
        model: The fp32 ONNX.
        windows: (1, channels, h, w) float32 inputs.

    Returns:
        Largest |value| over all windows by tensor, NaN where one occurred.

    Raises:
        BundleError: If the model is not admissible.
    """
    data, names = with_node_outputs(model)
    return largest_activations(data, names, windows)


def fits_fp16(activations: Mapping[str, float], *, headroom: float) -> bool:
    """Return whether all activations, times a headroom, lie well within the range of fp16.

    CPU runs of an fp16 graph stay finite beyond 65504 and prove nothing; fp32 activations do.
    """
    return all(value * headroom < FP16_LIMIT for value in activations.values())
