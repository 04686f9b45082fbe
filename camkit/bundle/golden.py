"""The golden cases of a bundle: what it must compute, packed as safetensors.

Tensors of the case NAME; pictures are float16 where its range holds them, and read as float32:

    NAME.capture                 (h, w) or (c, h, w): uint16 DN, or float32 linear
    NAME.reference               (c, H, W), the sharp scene as the product `image` shows it
    NAME.output.PRODUCT.SIZE     (c, H, W), what the pipeline makes of the capture with that size

Bundles of format 1.0 know one product: their NAME.output.SIZE is NAME.output.image.SIZE, and their
NAME.network_input and NAME.network_output.SIZE are not read.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.arrays import FloatArray
from camkit.bundle.psf_file import read_tensors
from camkit.errors import BundleError, ContractError

MAX_SIDE_PX: Final = 1024
IMAGE: Final = "image"
NO_SIZE: Final = "none"
"""Stands for the size in the outputs of a bundle without networks."""
_HALF_MAX: Final = 65504.0
_CAPTURE_TYPES: Final = (np.uint8, np.uint16, np.uint32, np.float32)
_OF_1_0: Final = ("network_input", "network_output")


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenArrays:
    """The arrays of one case; see the head of the module.

    Attributes:
        capture: As the sensor gives it.
        reference: (c, H, W) sharp scene.
        outputs: Product -> size -> (c, H, W).
    """

    capture: NDArray[Any]
    reference: FloatArray
    outputs: Mapping[str, Mapping[str, FloatArray]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        capture = self.capture
        if capture.ndim not in (2, 3) or capture.dtype not in _CAPTURE_TYPES:
            raise ContractError(
                "capture must be (h, w) or (c, h, w) of uint8, uint16, uint32 or float32; "
                f"got {capture.dtype} {capture.shape}"
            )
        _check_sides("capture", capture)
        pictures = {"reference": self.reference} | {
            f"{product} of size {size}": array
            for product, sizes in self.outputs.items()
            for size, array in sizes.items()
        }
        for name, array in pictures.items():
            if array.dtype != np.float32 or array.ndim != 3 or not np.isfinite(array).all():
                raise ContractError(
                    f"{name} must be finite float32 (c, h, w); got {array.dtype} {array.shape}"
                )
            _check_sides(name, array)
        for product, sizes in self.outputs.items():
            shapes = {array.shape for array in sizes.values()}
            if product == IMAGE:
                shapes.add(self.reference.shape)
            if len(shapes) > 1:
                raise ContractError(
                    f"all of {product} must have one shape (that of the reference for {IMAGE}); "
                    f"got {', '.join(map(str, sorted(shapes)))}"
                )

    def output(self, product: str, size: str) -> FloatArray | None:
        """Return the stored output of a product, or None."""
        return self.outputs.get(product, {}).get(size)


def _check_sides(name: str, array: NDArray[Any]) -> None:
    if max(array.shape[-2:]) > MAX_SIDE_PX or min(array.shape) < 1:
        raise ContractError(f"{name}: a golden picture has 1 to {MAX_SIDE_PX} px a side")


def golden_to_bytes(cases: Mapping[str, GoldenArrays]) -> bytes:
    """Encode cases by name; the same cases always give the same bytes."""
    tensors: dict[str, NDArray[Any]] = {}
    for name, case in cases.items():
        tensors[f"{name}.capture"] = case.capture
        tensors[f"{name}.reference"] = _halved(case.reference)
        for product, sizes in case.outputs.items():
            tensors |= {
                f"{name}.output.{product}.{size}": _halved(array) for size, array in sizes.items()
            }
    return save({name: np.ascontiguousarray(array) for name, array in tensors.items()})


def _halved(picture: FloatArray) -> NDArray[Any]:
    """Return a picture in half precision, unless it leaves its range."""
    return picture if np.abs(picture).max() > _HALF_MAX else picture.astype(np.float16)


def golden_from_bytes(data: bytes) -> dict[str, GoldenArrays]:
    """Decode cases by name.

    Raises:
        BundleError: If the file is damaged, a tensor is of no case or unknown, or shapes disagree.
    """
    tensors = read_tensors(data, what="golden.safetensors")
    parts: dict[str, dict[str, Any]] = {}
    for name, array in tensors.items():
        case, *rest = name.split(".")
        members = parts.setdefault(case, {"outputs": {}})
        match rest:
            case ["capture"]:
                members["capture"] = array
            case ["reference"]:
                members["reference"] = _widened(array)
            case ["output", size]:
                members["outputs"].setdefault(IMAGE, {})[size] = _widened(array)
            case ["output", product, size]:
                members["outputs"].setdefault(product, {})[size] = _widened(array)
            case [old, *_] if old in _OF_1_0:
                pass
            case _:
                raise BundleError(f"golden.safetensors: tensor {name!r} is of no known kind")
    return {name: _to_case(name, members) for name, members in sorted(parts.items())}


def _widened(picture: NDArray[Any]) -> NDArray[Any]:
    return picture.astype(np.float32) if picture.dtype == np.float16 else picture


def _to_case(name: str, members: Mapping[str, Any]) -> GoldenArrays:
    if missing := {"capture", "reference"} - members.keys():
        raise BundleError(f"golden case {name!r} lacks {' and '.join(sorted(missing))}")
    try:
        return GoldenArrays(**members)
    except ContractError as error:
        raise BundleError(f"golden case {name!r}: {error}") from error
