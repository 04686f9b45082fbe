"""The golden cases of a bundle: what it must compute, packed as safetensors.

Tensors of the case NAME, all but the first two optional:

    NAME.capture                 (h, w) uint16 mosaic in DN, or (3, h, w) float32 linear
    NAME.reference               (3, h, w) float32, the sharp scene
    NAME.output.SIZE             (3, h, w) float32, the pipeline's output with that size
    NAME.network_input           (c, h, w) float32, what the network is given
    NAME.network_output.SIZE     (c, h, w) float32, what it makes of it
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.bundle.psf_file import read_tensors
from camkit.contracts import FloatArray
from camkit.errors import BundleError, ContractError

MAX_SIDE_PX: Final = 192

_SIZED: Final = ("output", "network_output")
_SIZES: Final = ("S", "M", "L")


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenArrays:
    """The arrays of one case; see the head of the module. Sizes are keys of the two mappings."""

    capture: NDArray[np.uint16] | FloatArray
    reference: FloatArray
    outputs: Mapping[str, FloatArray] = field(default_factory=dict)
    network_input: FloatArray | None = None
    network_outputs: Mapping[str, FloatArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        capture = self.capture
        plane = capture.ndim == 2 or (capture.ndim == 3 and capture.shape[0] == 3)
        if not plane or capture.dtype not in (np.uint16, np.float32):
            raise ContractError(
                "capture must be (h, w) uint16 or (3, h, w) float32; "
                f"got {capture.dtype} {capture.shape}"
            )
        if max(capture.shape[-2:]) > MAX_SIDE_PX or min(capture.shape) < 1:
            raise ContractError(f"a golden capture has 1 to {MAX_SIDE_PX} px a side")
        for name, array in [("reference", self.reference), *self.outputs.items()]:
            self._check_planes(name, array, channels=3)
        if self.network_outputs and self.network_input is None:
            raise ContractError("network outputs need the network input")
        if self.network_input is not None:
            self._check_planes("network_input", self.network_input, channels=None)
        for name, array in self.network_outputs.items():
            self._check_planes(name, array, channels=None)

    def _check_planes(self, name: str, array: FloatArray, *, channels: int | None) -> None:
        if array.dtype != np.float32 or array.ndim != 3 or not np.isfinite(array).all():
            raise ContractError(
                f"{name} must be finite float32 (c, h, w); got {array.dtype} {array.shape}"
            )
        if channels is not None and array.shape != (channels, *self.capture.shape[-2:]):
            raise ContractError(
                f"{name} must have 3 planes of the capture's {self.capture.shape[-2:]}; "
                f"got {array.shape}"
            )


def golden_to_bytes(cases: Mapping[str, GoldenArrays]) -> bytes:
    """Encode cases by name; the same cases always give the same bytes."""
    tensors: dict[str, NDArray[Any]] = {}
    for name, case in cases.items():
        tensors[f"{name}.capture"] = case.capture
        tensors[f"{name}.reference"] = case.reference
        if case.network_input is not None:
            tensors[f"{name}.network_input"] = case.network_input
        tensors |= {f"{name}.output.{size}": array for size, array in case.outputs.items()}
        tensors |= {
            f"{name}.network_output.{size}": array for size, array in case.network_outputs.items()
        }
    return save({name: np.ascontiguousarray(array) for name, array in tensors.items()})


def golden_from_bytes(data: bytes) -> dict[str, GoldenArrays]:
    """Decode cases by name.

    Raises:
        BundleError: If the file is damaged, a tensor is of no case or unknown kind, or shapes
            disagree.
    """
    tensors = read_tensors(data, what="golden.safetensors")
    parts: dict[str, dict[str, Any]] = {}
    for name, array in tensors.items():
        case, kind, size = _split(name)
        known = parts.setdefault(case, {"output": {}, "network_output": {}})
        if kind in _SIZED:
            known[kind][size] = array
        else:
            known[kind] = array
    return {name: _to_case(name, known) for name, known in sorted(parts.items())}


def _split(name: str) -> tuple[str, str, str]:
    case, _, rest = name.partition(".")
    kind, _, size = rest.partition(".")
    is_sized = kind in _SIZED and size in _SIZES
    if not is_sized and (kind not in ("capture", "reference", "network_input") or size):
        raise BundleError(f"golden.safetensors: tensor {name!r} is of no known kind")
    return case, kind, size


def _to_case(name: str, known: Mapping[str, Any]) -> GoldenArrays:
    if missing := {"capture", "reference"} - known.keys():
        raise BundleError(f"golden case {name!r} lacks {' and '.join(sorted(missing))}")
    try:
        return GoldenArrays(
            capture=known["capture"],
            reference=known["reference"],
            outputs=known["output"],
            network_input=known.get("network_input"),
            network_outputs=known["network_output"],
        )
    except ContractError as error:
        raise BundleError(f"golden case {name!r}: {error}") from error
