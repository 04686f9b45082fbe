"""Streak optics as safetensors: to bytes and back, with every refusal of a damaged file.

The file holds the tensors of `StreakOptics` under their names and no metadata, so that the same
optics always give the same bytes; `pixel_pitch_um` is (1,) float64.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.bundle.psf_file import read_optics_bytes, read_tensors
from camkit.errors import BundleError, ContractError
from camkit.streaks import StreakOptics

LIGHT: Final = ("core", "bare_core", "profiles", "sections", "haze")
AXES: Final = ("angles_rad", "depths_mm", "wavelengths_um")
PITCH: Final = "pixel_pitch_um"
_RANKS: Final = {"core": 4, "bare_core": 4, "profiles": 4, "sections": 3, "haze": 4, PITCH: 1}


def streaks_to_bytes(optics: StreakOptics) -> bytes:
    """Encode streak optics; the same optics always give the same bytes."""
    tensors: dict[str, NDArray[Any]] = {name: getattr(optics, name) for name in (*LIGHT, *AXES)}
    tensors[PITCH] = np.array([optics.pixel_pitch_um], np.float64)
    return save({name: np.ascontiguousarray(array) for name, array in tensors.items()})


def streaks_from_bytes(data: bytes, *, what: str = "streaks.safetensors") -> StreakOptics:
    """Decode streak optics and check them; the arrays are read-only.

    Raises:
        BundleError: If the file is damaged, a tensor is missing or of the wrong type, or the
            optics are none.
    """
    return streaks_from_tensors(read_tensors(data, what=what), what=what)


def streaks_from_tensors(tensors: Mapping[str, NDArray[Any]], *, what: str) -> StreakOptics:
    """Check the tensors of streak optics; see `streaks_from_bytes`."""
    names = {*LIGHT, *AXES, PITCH}
    if tensors.keys() != names:
        missing = ", ".join(sorted(names - tensors.keys())) or "none"
        extra = ", ".join(sorted(tensors.keys() - names)) or "none"
        raise BundleError(
            f"{what} must hold the {len(names)} tensors of streak optics; missing: {missing}; "
            f"unknown: {extra}. Freeze the plate again"
        )
    for name, array in tensors.items():
        kind = np.float32 if name in LIGHT else np.float64
        rank = _RANKS.get(name, 1)
        if array.dtype != kind or array.ndim != rank or array.size == 0:
            raise BundleError(
                f"{what}: {name} must be {np.dtype(kind)} with {rank} axes, not empty; got "
                f"{array.dtype} {array.shape}"
            )
    if tensors[PITCH].shape != (1,):
        raise BundleError(f"{what}: {PITCH} must be one number; got {tensors[PITCH].shape}")
    try:
        return StreakOptics(
            **{name: tensors[name] for name in (*LIGHT, *AXES)},
            pixel_pitch_um=float(tensors[PITCH][0]),
        )
    except ContractError as error:
        raise BundleError(f"{what} is refused: {error}") from error


def write_streaks(path: Path, optics: StreakOptics) -> None:
    """Write streak optics to a safetensors file, replacing one that is there."""
    Path(path).write_bytes(streaks_to_bytes(optics))


def read_streaks(path: Path) -> StreakOptics:
    """Read streak optics from a safetensors file.

    Raises:
        BundleError: If the file is missing, damaged or holds no streak optics.
    """
    data = read_optics_bytes(path, what="streaks")
    return streaks_from_bytes(data, what=str(path))
