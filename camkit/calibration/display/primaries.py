"""The colours of a display as a camera sees them, by least squares over its primaries and white.

    light of a capture / exposure = matrix . light of the display (R, G, B) + what else shines

The offset is the display's black and what the lens scatters from the marks.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.errors import DecodeError

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Primaries:
    """Colours of a display.

    Attributes:
        matrix: (3, 3) light of the display, 0..1, to light of the sensor's colours, 1 at the
            sensor's white in the first capture of a colour.
        offset: (3,) light that is there without any.
        names: Of the colours that were captured.
        residuals: (colour, 3) what the fit leaves, of the brightest white.
    """

    matrix: FloatGrid
    offset: FloatGrid
    names: tuple[str, ...]
    residuals: FloatGrid

    @property
    def residual(self) -> float:
        """Return the RMS of the residuals."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def to_record(self) -> dict[str, Any]:
        """Return plain values."""
        return {
            "matrix": [[float(f"{value:.6g}") for value in row] for row in self.matrix],
            "offset": [float(f"{value:.6g}") for value in self.offset],
            "residual_percent": float(f"{100 * self.residual:.3g}"),
            "worst_percent": float(f"{100 * np.abs(self.residuals).max():.3g}"),
            "colours": list(self.names),
        }


def fit_primaries(names: Sequence[str], display: FloatGrid, light: FloatGrid) -> Primaries:
    """Fit the matrix.

    Args:
        names: Of the colours.
        display: (colour, 3) light of the display.
        light: (colour, 3) light of the sensor's colours, of equal exposure.

    Raises:
        DecodeError: If the colours are too few or alike.
    """
    columns = np.column_stack([display, np.ones(len(display))])
    if len(display) < columns.shape[1] or np.linalg.matrix_rank(columns) < columns.shape[1]:
        raise DecodeError(f"{len(display)} colours do not tell the primaries of a display")
    solution = np.linalg.lstsq(columns, light, rcond=None)[0]
    brightest = float(light.max())
    if not brightest > 0:
        raise DecodeError("the captures of colours are black")
    return Primaries(
        matrix=np.asarray(solution[:3].T, dtype=np.float64),
        offset=np.asarray(solution[3], dtype=np.float64),
        names=tuple(names),
        residuals=(light - columns @ solution) / brightest,
    )
