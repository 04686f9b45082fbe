"""The golden case of the stage haze: a coarse picture of the whole sensor, as safetensors.

A golden capture of 192 px is a dozen cells and shows little of a haze that is wider; this case is
the whole frame, in cells:

    cells      (c, h, w) float16: a capture
    picture    (c, h, w) float16: the scene that the stage restores from it
    gain       (c, h, w) float16: the factor by which the stage multiplies the capture
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.arrays import FloatArray
from camkit.bundle.psf_file import read_tensors
from camkit.errors import BundleError

MAX_CELLS: Final = 1024
"""Along a side."""
_NAMES: Final = ("cells", "picture", "gain")


@dataclass(frozen=True, slots=True, kw_only=True)
class HazeGolden:
    """The case; see the head of the module.

    Attributes:
        cells: (c, h, w) float32.
        picture: (c, h, w) float32.
        gain: (c, h, w) float32.
    """

    cells: FloatArray
    picture: FloatArray
    gain: FloatArray


def haze_golden_to_bytes(case: HazeGolden) -> bytes:
    """Encode the case; the same case always gives the same bytes."""
    halves = {name: getattr(case, name).astype(np.float16) for name in _NAMES}
    return save({name: np.ascontiguousarray(array) for name, array in halves.items()})


def haze_golden_from_bytes(data: bytes, *, what: str) -> HazeGolden:
    """Decode the case.

    Args:
        data: A whole safetensors file as written by `haze_golden_to_bytes`.
        what: Its name in the error message.

    Raises:
        BundleError: If it is damaged, or its tensors are not three finite pictures of one shape.
    """
    tensors: dict[str, NDArray[Any]] = read_tensors(data, what=what)
    if tensors.keys() != set(_NAMES):
        raise BundleError(f"{what} must hold {', '.join(_NAMES)}; got {', '.join(sorted(tensors))}")
    shape = tensors["cells"].shape
    for name, array in tensors.items():
        sound = array.dtype == np.float16 and array.ndim == 3 and array.shape == shape
        if not sound or not array.size or max(shape[1:]) > MAX_CELLS:
            raise BundleError(
                f"{what}: {name} must be float16 (c, h, w) of one shape, at most {MAX_CELLS} a "
                f"side; got {array.dtype} {array.shape}"
            )
        if not np.isfinite(array).all():
            raise BundleError(f"{what}: {name} holds NaN or inf")
    return HazeGolden(**{name: array.astype(np.float32) for name, array in tensors.items()})
