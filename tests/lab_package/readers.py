"""Kernels as the laboratory's program writes them: a header line, then numbers row by row."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_lab(path: Path) -> NDArray[np.float64]:
    """Return (row, col, colour, h, w)."""
    header, *lines = path.read_text(encoding="utf-8").splitlines()
    return np.array(" ".join(lines).split(), np.float64).reshape(*map(int, header.split()))
