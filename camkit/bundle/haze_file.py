"""Haze as safetensors: to bytes and back, with every refusal of a damaged file.

The file holds the tensors of `Haze` under their names and no metadata, so that the same haze always
gives the same bytes; `cell_px` and `pixel_pitch_um` are (1,) float64.
"""

from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.bundle.psf_file import read_optics_bytes, read_tensors
from camkit.errors import BundleError, ContractError
from camkit.haze import Haze

KERNELS: Final = "kernels"
_RANKS: Final = {
    KERNELS: 5,
    "core_share": 3,
    "field_heights_mm": 1,
    "depths_mm": 1,
    "wavelengths_um": 1,
}
_NUMBERS: Final = ("cell_px", "pixel_pitch_um")


def haze_to_bytes(haze: Haze) -> bytes:
    """Encode a haze; the same haze always gives the same bytes."""
    tensors: dict[str, NDArray[Any]] = {name: getattr(haze, name) for name in _RANKS}
    tensors |= {name: np.array([getattr(haze, name)], np.float64) for name in _NUMBERS}
    return save({name: np.ascontiguousarray(array) for name, array in tensors.items()})


def haze_from_bytes(data: bytes, *, what: str = "haze.safetensors") -> Haze:
    """Decode a haze and check it; the arrays are read-only.

    Args:
        data: A whole safetensors file as written by `haze_to_bytes`.
        what: Its name in the error message.

    Raises:
        BundleError: If the file is damaged, a tensor is missing or of the wrong type, or the haze
            is none.
    """
    tensors = read_tensors(data, what=what)
    ranks = _RANKS | dict.fromkeys(_NUMBERS, 1)
    if tensors.keys() != ranks.keys():
        missing = ", ".join(sorted(ranks.keys() - tensors.keys())) or "none"
        extra = ", ".join(sorted(tensors.keys() - ranks.keys())) or "none"
        raise BundleError(
            f"{what} must hold the {len(ranks)} tensors of a haze; missing: {missing}; unknown: "
            f"{extra}. Freeze the optics again"
        )
    for name, rank in ranks.items():
        array, kind = tensors[name], np.float32 if name == KERNELS else np.float64
        if array.dtype != kind or array.ndim != rank or array.size == 0:
            raise BundleError(
                f"{what}: {name} must be {np.dtype(kind)} with {rank} axes, not empty; got "
                f"{array.dtype} {array.shape}"
            )
    for name in _NUMBERS:
        if tensors[name].shape != (1,):
            raise BundleError(f"{what}: {name} must be one number; got {tensors[name].shape}")
    cell_px = float(tensors["cell_px"][0])
    if not cell_px.is_integer():
        raise BundleError(f"{what}: cell_px must be a whole number; got {cell_px}")
    try:
        return Haze(
            **{name: tensors[name] for name in _RANKS},
            cell_px=int(cell_px),
            pixel_pitch_um=float(tensors["pixel_pitch_um"][0]),
        )
    except ContractError as error:
        raise BundleError(f"{what} is refused: {error}") from error


def write_haze(path: Path, haze: Haze) -> None:
    """Write a haze to a safetensors file, replacing one that is there."""
    Path(path).write_bytes(haze_to_bytes(haze))


def read_haze(path: Path) -> Haze:
    """Read a haze from a safetensors file.

    Raises:
        BundleError: If the file is missing, damaged or holds no haze.
    """
    data = read_optics_bytes(path, what="haze")
    return haze_from_bytes(data, what=str(path))
