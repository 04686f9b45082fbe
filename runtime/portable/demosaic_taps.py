"""Light, white balance and demosaic of a block as one convolution."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.portable.graph_builder import GraphBuilder, Value
from camkit.runtime.portable.spectra import PHASES, BlockShape
from camkit.runtime.signal.demosaic import MALVAR_KERNELS

MARGIN_PX: Final = 2
"""Samples around a block that its demosaic looks at."""
CELL_TAPS: Final = 2 + 2 * MARGIN_PX
COLOURS: Final = ((0, 1), (1, 2))
"""Of a cell with red first."""


def demosaicked(
    graph: GraphBuilder, light: Value, phase: Value, gains: Value, shape: BlockShape
) -> Value:
    """Return (3, 4, n, n): weights of a cell, of all phases, each tap times its colour's gain."""
    weights, colours = _demosaic_weights()
    of_taps = (gains.shaped(1, 3) @ graph.constant(colours).gather(phase, 0).shaped(3, -1)).shaped(
        1, CELL_TAPS, CELL_TAPS
    )
    kernels = graph.constant(weights).gather(phase, 0).shaped(12, CELL_TAPS, CELL_TAPS) * of_taps
    whole = shape.side + 2 * MARGIN_PX
    kernels = kernels.shaped(12, 1, CELL_TAPS, CELL_TAPS)
    cells = graph.node("Conv", light.shaped(1, 1, whole, whole), kernels, strides=[2, 2])
    return cells.shaped(3, 4, shape.n, shape.n)


def _demosaic_weights() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return kernels (4, 12, 6, 6) of a 2x2 cell, red at each place, and colours (4, 3, 36)."""
    weights = np.zeros((4, 3, 4, CELL_TAPS, CELL_TAPS))
    colours = np.zeros((4, 3, CELL_TAPS, CELL_TAPS))

    def colour_at(phase: int, y: int, x: int) -> int:
        return COLOURS[(y + phase // 2) % 2][(x + phase % 2) % 2]

    for phase in range(4):
        for y, x in np.ndindex(CELL_TAPS, CELL_TAPS):
            colours[phase, colour_at(phase, y, x), y, x] = 1
        for place, (y, x) in enumerate(PHASES):
            colour = colour_at(phase, y, x)
            row = colour, colour_at(phase, y, x + 1)
            for target in range(3):
                kernel = np.zeros((5, 5), np.float32)
                kernel[2, 2] = 1
                if colour != target:
                    kernel = MALVAR_KERNELS[_kernel_name(colour, target, row)]
                weights[phase, target, place, y : y + 5, x : x + 5] = kernel
    return weights.reshape(4, 12, CELL_TAPS, CELL_TAPS), colours.reshape(4, 3, -1)


def _kernel_name(colour: int, target: int, row: tuple[int, int]) -> str:
    if target == 1:
        return "green"
    if colour == 1:
        return "along_row" if target in row else "along_column"
    return "diagonal"
