"""The archive of arrays that photons become, read and checked."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError
from camkit.runtime.kinds.spad.containers.npy_header import BROKEN_HEADER

_PRODUCTS: Final = ("depth_m", "lifetime_ps", "intensity", "frames", "transient")
_AXES: Final = {
    **dict.fromkeys(("depth_m", "lifetime_ps", "sigma_ps", "valid", "intensity"), (2, 3)),
    **dict.fromkeys(("frames", "transient"), (3,)),
    "time_ps": (1,),
}
"""Numbers of axes that arrays may have to be shown, by name."""
_COUNTS: Final = frozenset({"intensity", "frames", "transient"})


def read_archive(path: Path) -> dict[str, NDArray[Any]]:
    """Read the arrays of a result.

    Raises:
        DecodeError: If it is no archive of arrays, holds none that photons become, or arrays that
            do not belong together.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
    except BROKEN_HEADER as error:
        raise DecodeError(f"cannot read {path}: {error}") from error
    if not arrays.keys() & {*_PRODUCTS}:
        names = ", ".join(sorted(arrays)) or "nothing"
        raise DecodeError(
            f"{path} holds {names}; a result has one of {', '.join(sorted(_PRODUCTS))}"
        )
    try:
        _check_arrays(arrays)
    except DecodeError as error:
        raise DecodeError(f"{path}: {error}") from error
    return arrays


def _check_arrays(arrays: Mapping[str, NDArray[Any]]) -> None:
    """Check types, axes and sizes.

    Raises:
        DecodeError: Names the array.
    """
    for name in arrays.keys() & _AXES.keys():
        values = arrays[name]
        kinds = "b" if name == "valid" else "fiu"
        if values.dtype.kind not in kinds or values.ndim not in _AXES[name] or not values.size:
            raise DecodeError(f"{name} cannot be {values.dtype} {values.shape}")
        if name in _COUNTS and not np.isfinite(values).all():
            raise DecodeError(f"{name} holds NaN or infinite photons")
    first = next(name for name in _PRODUCTS if name in arrays)
    for name, axes in (("sigma_ps", 3), ("valid", 3), ("intensity", 2)):
        if name in arrays and arrays[name].shape[-axes:] != arrays[first].shape[-axes:]:
            shapes = f"{arrays[name].shape} beside {first} of {arrays[first].shape}"
            raise DecodeError(f"{name} cannot be {shapes}")
    if {"transient", "time_ps"} <= arrays.keys():
        times, frames = len(arrays["time_ps"]), len(arrays["transient"])
        if times != frames:
            raise DecodeError(f"time_ps has {times} numbers for {frames} frames")
