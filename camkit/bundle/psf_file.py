"""The frozen PSF as safetensors: to bytes and back, with every refusal of a damaged file.

The file holds seven tensors and no metadata, so that the same PSF always gives the same bytes:
`kernels` (float32) and, as float64, `field_heights_mm`, `depths_mm`, `wavelengths_um`,
`pixel_pitch_um` (1,), `distortion_coefficients` (channel, 4), `distortion_radius_mm` (1,) and
`relative_illumination`. A PSF that is not radial adds `symmetry`, its name in ASCII (uint8), and a
grid its positions, `grid_x_mm` and `grid_y_mm`. Kernels of a moved sensor (format 2.5) add
`focus_kernels` (float32) and `focus_um`; even powers of the distortion (format 2.6) add
`distortion_even_coefficients` (channel, 3). A file of `camkit psf import` adds `uncertainty` (3,):
noise, shift in pixels and width of `camkit.psf.PsfUncertainty`. A file of `camkit freeze` says in
words where it is from: `source` of its metadata. Bundles hold neither. A file of a lens with
several configurations (format 2.12) holds such tensors for each: `states/state_tensors.py`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, get_args

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from camkit.bundle.strict_json import read_json
from camkit.caller import option_text
from camkit.errors import BundleError, ContractError
from camkit.psf import FrozenPsf, PsfUncertainty, Symmetry
from camkit.radial import RadialDistortion
from camkit.side_file import MOST_BYTES, read_side_bytes

_AXES: Final = ("field_heights_mm", "depths_mm", "wavelengths_um", "relative_illumination")
_SCALARS: Final = ("pixel_pitch_um", "distortion_radius_mm")
_TENSORS: Final = frozenset({"kernels", "distortion_coefficients", *_AXES, *_SCALARS})
_SYMMETRY: Final = "symmetry"
_LENGTH_BYTES: Final = 8
_MAX_HEADER_BYTES: Final = 2**20
_GRID: Final = ("grid_x_mm", "grid_y_mm")
_ADDED: Final = {"radial": (), "uniform": (_SYMMETRY,), "grid": (_SYMMETRY, *_GRID)}
"""What a PSF of each symmetry holds besides."""
_EVEN: Final = "distortion_even_coefficients"
_FOCUS: Final = ("focus_um", "focus_kernels")
STATES: Final = "configurations"
"""The tensor that files of several states of a lens alone have."""
_SOURCE: Final = "source"
UNCERTAINTY: Final = "uncertainty"
"""The tensor that files of measured PSFs alone have."""
_SIDES: Final = ("field", "depth", "wavelength", "h", "w")
_KERNELS: Final = {"kernels": _SIDES, "focus_kernels": ("shift", *_SIDES)}


def read_tensors(data: bytes, *, what: str) -> dict[str, NDArray[Any]]:
    """Decode safetensors bytes to arrays that nobody can write to.

    Args:
        data: A whole safetensors file.
        what: Its name in the error message.

    Raises:
        BundleError: If the bytes are not a sound safetensors file of numpy types, or its header
            holds a name twice.
    """
    _check_header(data, what)
    try:
        tensors = load(data)
    except (SafetensorError, KeyError, TypeError, ValueError, OverflowError) as error:
        raise BundleError(
            f"{what} is not a sound safetensors file ({error}); export it again"
        ) from error
    for array in tensors.values():
        array.flags.writeable = False
    return tensors


def _check_header(data: bytes, what: str) -> None:
    """Refuse a header that readers take differently; the library reports all else."""
    length = int.from_bytes(data[:_LENGTH_BYTES], "little")
    if data[_LENGTH_BYTES : _LENGTH_BYTES + 1] != b"{":
        raise BundleError(f"{what} is no safetensors file; is it another kind of file?")
    if length > min(len(data) - _LENGTH_BYTES, _MAX_HEADER_BYTES):
        raise BundleError(
            f"{what} is not a sound safetensors file (its header is said to have {length} bytes); "
            "export it again"
        )
    read_json(data[_LENGTH_BYTES : _LENGTH_BYTES + length], what=f"the header of {what}")


def psf_to_bytes(psf: FrozenPsf, uncertainty: PsfUncertainty | None = None) -> bytes:
    """Encode a frozen PSF as safetensors; the same PSF always gives the same bytes.

    Args:
        psf: The PSF.
        uncertainty: Of a measured one, for training; a bundle holds none.
    """
    tensors = psf_tensors(psf)
    if uncertainty is not None:
        numbers = (uncertainty.noise, uncertainty.shift_px, uncertainty.width)
        tensors[UNCERTAINTY] = np.array(numbers, dtype=np.float64)
    return save(tensors)


def psf_tensors(psf: FrozenPsf) -> dict[str, NDArray[Any]]:
    """Return the tensors of a frozen PSF by name, each contiguous."""
    tensors: dict[str, NDArray[Any]] = {
        "kernels": np.ascontiguousarray(psf.kernels),
        "field_heights_mm": np.asarray(psf.field_heights_mm, dtype=np.float64),
        "depths_mm": np.asarray(psf.depths_mm, dtype=np.float64),
        "wavelengths_um": np.asarray(psf.wavelengths_um, dtype=np.float64),
        "pixel_pitch_um": np.array([psf.pixel_pitch_um], dtype=np.float64),
        "distortion_coefficients": np.ascontiguousarray(
            psf.distortion.coefficients, dtype=np.float64
        ),
        "distortion_radius_mm": np.array([psf.distortion.radius_mm], dtype=np.float64),
        "relative_illumination": np.asarray(psf.relative_illumination, dtype=np.float64),
    }
    if psf.symmetry != "radial":
        tensors[_SYMMETRY] = np.frombuffer(psf.symmetry.encode("ascii"), dtype=np.uint8)
    if psf.grid_x_mm is not None and psf.grid_y_mm is not None:
        tensors |= {
            name: np.asarray(positions, dtype=np.float64)
            for name, positions in zip(_GRID, (psf.grid_x_mm, psf.grid_y_mm), strict=True)
        }
    if psf.distortion.even_coefficients is not None:
        tensors[_EVEN] = np.asarray(psf.distortion.even_coefficients, dtype=np.float64)
    if psf.focus_um is not None and psf.focus_kernels is not None:
        tensors[_FOCUS[0]] = np.asarray(psf.focus_um, dtype=np.float64)
        tensors[_FOCUS[1]] = psf.focus_kernels
    return {name: np.ascontiguousarray(array) for name, array in tensors.items()}


def psf_from_bytes(data: bytes, *, what: str = "psf.safetensors") -> FrozenPsf:
    """Decode a frozen PSF and check it.

    Args:
        data: A whole safetensors file as written by `psf_to_bytes`.
        what: Its name in the error message.

    Returns:
        The PSF, its arrays read-only.

    Raises:
        BundleError: If the file is damaged, a tensor is missing or has the wrong type or shape,
            or the PSF is not one: NaN, negative or unnormalised kernels, axes out of order.
    """
    return psf_from_tensors(read_tensors(data, what=what), what=what)


def psf_from_tensors(tensors: Mapping[str, NDArray[Any]], *, what: str) -> FrozenPsf:
    """Check the tensors of a file and return the frozen PSF; see `psf_from_bytes`."""
    if STATES in tensors:
        raise BundleError(
            f"{what} holds several configurations of a lens, and one is taken here; freeze it "
            f"with {option_text('configuration')}"
        )
    symmetry = _read_symmetry(tensors, what)
    _check_tensors(tensors, symmetry, what)
    try:
        return FrozenPsf(
            kernels=tensors["kernels"],
            field_heights_mm=tensors["field_heights_mm"],
            depths_mm=tensors["depths_mm"],
            wavelengths_um=tensors["wavelengths_um"],
            pixel_pitch_um=float(tensors["pixel_pitch_um"][0]),
            distortion=RadialDistortion(
                coefficients=tensors["distortion_coefficients"],
                radius_mm=float(tensors["distortion_radius_mm"][0]),
                even_coefficients=tensors.get(_EVEN),
            ),
            relative_illumination=tensors["relative_illumination"],
            symmetry=symmetry,
            grid_x_mm=tensors.get(_GRID[0]),
            grid_y_mm=tensors.get(_GRID[1]),
            focus_um=tensors.get(_FOCUS[0]),
            focus_kernels=tensors.get(_FOCUS[1]),
        )
    except ContractError as error:
        raise BundleError(f"{what} is refused: {error}") from error


def _read_symmetry(tensors: Mapping[str, NDArray[Any]], what: str) -> Symmetry:
    """Return the symmetry that a file names; radial where it names none."""
    tensor = tensors.get(_SYMMETRY)
    if tensor is None:
        return "radial"
    for name in get_args(Symmetry):
        if tensor.dtype == np.uint8 and tensor.tobytes() == name.encode("ascii"):
            symmetry: Symmetry = name
            return symmetry
    raise BundleError(f"{what}: symmetry must be one of {', '.join(get_args(Symmetry))}")


def _check_tensors(tensors: Mapping[str, NDArray[Any]], symmetry: Symmetry, what: str) -> None:
    wanted_names = _TENSORS | set(_ADDED[symmetry])
    if tensors.keys() & set(_FOCUS):
        wanted_names |= set(_FOCUS)
    if _EVEN in tensors:
        wanted_names |= {_EVEN}
    if tensors.keys() - {_SYMMETRY} != wanted_names - {_SYMMETRY}:
        missing = ", ".join(sorted(wanted_names - tensors.keys())) or "none"
        extra = ", ".join(sorted(tensors.keys() - wanted_names)) or "none"
        raise BundleError(
            f"{what} must hold the {len(wanted_names)} tensors of a frozen PSF; "
            f"missing: {missing}; unknown: {extra}. Freeze the PSF again"
        )
    for name, sides in _KERNELS.items():
        kernels = tensors.get(name)
        if kernels is None:
            continue
        if kernels.dtype != np.float32 or kernels.ndim != len(sides) or kernels.size == 0:
            raise BundleError(
                f"{what}: {name} must be float32 ({', '.join(sides)}), not empty; "
                f"got {kernels.dtype} {kernels.shape}"
            )
    rows = tensors["distortion_coefficients"].shape[:1]
    shapes = {"distortion_coefficients": (*rows, 4), _EVEN: (*rows, 3)} | dict.fromkeys(
        _SCALARS, (1,)
    )
    for name in sorted(wanted_names - {_SYMMETRY, *_KERNELS}):
        array = tensors[name]
        shape = shapes.get(name, (array.size,))
        if array.dtype != np.float64 or array.shape != shape:
            raise BundleError(
                f"{what}: {name} must be float64 of shape {shape}; got {array.dtype} {array.shape}"
            )


def with_source(data: bytes, source: str) -> bytes:
    """Return a safetensors file that says in words where its tensors are from."""
    return save(load(data), metadata={_SOURCE: source})


def read_source(data: bytes) -> str | None:
    """Return what `with_source` put into a sound safetensors file; None where nothing did."""
    length = int.from_bytes(data[:_LENGTH_BYTES], "little")
    header = json.loads(data[_LENGTH_BYTES : _LENGTH_BYTES + length])
    source = header.get("__metadata__", {}).get(_SOURCE)
    return source if isinstance(source, str) else None


def write_psf(path: Path, psf: FrozenPsf, uncertainty: PsfUncertainty | None = None) -> None:
    """Write a frozen PSF to a safetensors file, replacing one that is there; see `psf_to_bytes`."""
    Path(path).write_bytes(psf_to_bytes(psf, uncertainty))


def read_psf(path: Path) -> FrozenPsf:
    """Read a frozen PSF from a safetensors file.

    Raises:
        BundleError: If the file is missing, damaged or not a PSF.
    """
    return read_measurement(path)[0]


def read_measurement(path: Path) -> tuple[FrozenPsf, PsfUncertainty | None]:
    """Read a frozen PSF from a safetensors file, and how far it may be off if that is stated.

    Raises:
        BundleError: If the file is missing, damaged or not a PSF.
    """
    tensors = dict(read_tensors(read_optics_bytes(path, what="PSF"), what=str(path)))
    numbers = tensors.pop(UNCERTAINTY, None)
    psf = psf_from_tensors(tensors, what=str(path))
    if numbers is None:
        return psf, None
    if numbers.dtype != np.float64 or numbers.shape != (3,):
        raise BundleError(f"{path}: {UNCERTAINTY} must be float64 (3,); got {numbers.shape}")
    noise, shift_px, width = numbers.tolist()
    try:
        return psf, PsfUncertainty(noise=noise, shift_px=shift_px, width=width)
    except ContractError as error:
        raise BundleError(f"{path} is refused: {error}") from error


def read_optics_bytes(path: Path, *, what: str) -> bytes:
    """Read a file of optics whole.

    Args:
        path: The file.
        what: What it should hold, for the error message.

    Raises:
        BundleError: If it cannot be read.
    """
    try:
        return read_side_bytes(Path(path), f"the {what}", most_bytes=MOST_BYTES)
    except ContractError as error:
        raise BundleError(str(error)) from error
