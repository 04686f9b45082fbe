"""Arrays by name as an NPZ, written without holding a second copy of any."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray


def write_archive(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write an uncompressed NPZ; equal arrays give equal bytes."""
    with path.open("wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
