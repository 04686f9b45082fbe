"""The light on the pixels of an array: a fine picture through a kernel, one sub-pixel each.

    fine (n, m h, m w) -- kernel -- sub-pixel `phase` of every m x m -- light (n, h, w)

Beyond its border a picture goes on as its outermost sub-pixels do.

References: Sun 2021, eq. (4.1).
"""

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.kinds.spad.finer.linear import Grid


def see_through(fine: FloatArray, kernel: FloatArray, grid: Grid) -> FloatArray:
    """Return the light of every pixel.

    Args:
        fine: (n, m h, m w) float32.
        kernel: (k, k), k odd: the light of a point as it falls on the sub-pixels.
        grid: m, and the sub-pixel at which a pixel sees.

    Returns:
        (n, h, w) float32.

    Raises:
        ContractError: If the picture is not of whole pixels.
    """
    scale, (height, width) = grid.scale, fine.shape[1:]
    if height % scale or width % scale:
        raise ContractError(
            f"a fine picture must be of whole {scale}x{scale} pixels; got {width}x{height}"
        )
    half = kernel.shape[0] // 2
    wide = np.pad(fine, ((0, 0), (half, half), (half, half)), mode="edge")
    pixels = np.zeros((len(fine), height // scale, width // scale), np.float32)
    for (dy, dx), share in np.ndenumerate(kernel):
        if share == 0:
            continue
        # light of a point moves by (dy, dx) - half, so a pixel sees what lies that far before it
        rows = slice(2 * half - dy + grid.phase, 2 * half - dy + height, scale)
        columns = slice(2 * half - dx + grid.phase, 2 * half - dx + width, scale)
        pixels += np.float32(share) * wide[:, rows, columns]
    return pixels
