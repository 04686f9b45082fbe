"""Reading of files that torch saved, as tensors and plain values alone: no code of them runs."""

import pickle
import struct
from pathlib import Path
from typing import Any, Final

import torch

from camkit.errors import ContractError, DecodeError
from camkit.regular_file import check_regular

_DAMAGED: Final = (
    pickle.UnpicklingError,
    RuntimeError,
    EOFError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    struct.error,
)
"""What torch's reader raises of files that it did not write: it walks them as if it had."""


def load_torch(path: Path, what: str) -> Any:
    """Read a file.

    Args:
        path: The file.
        what: What it should be, for errors.

    Raises:
        ContractError: If it is missing, or holds something else.
    """
    try:
        check_regular(path)
        return torch.load(path, map_location="cpu", weights_only=True)
    except OSError as error:
        raise ContractError(f"cannot read {what} {path}: {error.strerror}") from error
    except DecodeError as error:
        raise ContractError(f"cannot read {what} {path}: {error}") from error
    except _DAMAGED as error:
        # torch's own words advise to run code of the file
        raise ContractError(
            f"{path} is no {what}: it holds no plain tensors and values that torch saved "
            "(no code of a file is ever run)"
        ) from error
