"""Frozen states of a lens as safetensors: the tensors of every PSF, and their names.

`configurations` holds the names in UTF-8 (uint8), one a line; the first is the usual one. A tensor
of the state NAME is called NAME/TENSOR: those of a PSF file, and `efl_mm`, `f_number` and
`object_distance_mm`, float64 (1,). Readers before format 2.12 refuse such a file.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from safetensors.numpy import save

from camkit.bundle.psf_file import STATES, psf_from_tensors, psf_tensors
from camkit.bundle.states.lens_state import LensState, check_states
from camkit.errors import BundleError, ContractError

_NUMBERS: Final = ("efl_mm", "f_number", "object_distance_mm")


def states_to_bytes(states: Sequence[LensState]) -> bytes:
    """Encode states as safetensors; the same states always give the same bytes.

    Raises:
        ContractError: If they are not of one lens, see `check_states`.
    """
    check_states(states)
    names = "\n".join(state.name for state in states).encode()
    tensors: dict[str, NDArray[Any]] = {STATES: np.frombuffer(names, dtype=np.uint8)}
    for state in states:
        numbers = {name: np.array([getattr(state, name)], dtype=np.float64) for name in _NUMBERS}
        of_state = psf_tensors(state.psf) | numbers
        tensors |= {f"{state.name}/{name}": array for name, array in of_state.items()}
    return save(tensors)


def states_from_tensors(tensors: Mapping[str, NDArray[Any]], *, what: str) -> tuple[LensState, ...]:
    """Check the tensors of a file and return its states in their order.

    Args:
        tensors: As `read_tensors` gives them.
        what: Name of the file in the error message.

    Raises:
        BundleError: If names, tensors or a PSF are wrong, or two states do not fit each other.
    """
    names = _names(tensors[STATES], what)
    own_tensors: dict[str, dict[str, NDArray[Any]]] = {name: {} for name in names}
    for key, array in tensors.items():
        name, slash, tensor = key.rpartition("/")
        if slash and name in own_tensors:
            own_tensors[name][tensor] = array
        elif key != STATES:
            raise BundleError(f"{what}: {key} is of none of the configurations {', '.join(names)}")
    try:
        states = tuple(_state(name, own_tensors[name], what) for name in names)
        check_states(states)
    except ContractError as error:
        raise BundleError(f"{what} is refused: {error}") from error
    return states


def _names(array: NDArray[Any], what: str) -> list[str]:
    try:
        text = array.tobytes().decode() if array.dtype == np.uint8 else ""
    except UnicodeDecodeError:
        text = ""
    names = text.split("\n")
    if not all(names) or len(set(names)) < len(names):
        raise BundleError(
            f"{what}: {STATES} must be names in UTF-8 (uint8), one a line, each once; got "
            f"{array.dtype} {array.shape}"
        )
    return names


def _state(name: str, tensors: dict[str, NDArray[Any]], what: str) -> LensState:
    numbers = {}
    for key in _NUMBERS:
        array = tensors.pop(key, None)
        if array is None or array.dtype != np.float64 or array.shape != (1,):
            raise BundleError(f"{what}: {name}/{key} must be float64 of shape (1,)")
        numbers[key] = float(array[0])
    psf = psf_from_tensors(tensors, what=f"{what}, configuration {name}")
    return LensState(name=name, psf=psf, **numbers)
