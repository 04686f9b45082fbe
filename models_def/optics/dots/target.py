"""The light that is wanted of 11x11 dots, and how like it another light is."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.errors import ContractError
from camkit.models_def.optics.dots.camera import ORDERS

FloatGrid = NDArray[np.float64]
_NUMBERS: Final = "biuf"


def to_target(values: NDArray[Any]) -> FloatGrid:
    """Return light (11, 11), shares that sum to 1.

    Args:
        values: (11, 11) relative light, >= 0 and finite, of any sum > 0.

    Raises:
        ContractError: If it is none.
    """
    side = (ORDERS, ORDERS)
    if values.dtype.kind not in _NUMBERS or values.shape != side:
        raise ContractError(
            f"a PSF for a plate must be {ORDERS}x{ORDERS} real numbers; got {values.dtype} "
            f"{values.shape}"
        )
    target = values.astype(np.float64)
    if not np.isfinite(target).all():
        raise ContractError("a PSF must be finite; it holds NaN or infinite values")
    if target.min() < 0:
        raise ContractError(f"a PSF must be >= 0, as light is; its least value is {target.min():g}")
    # by its peak first: the sum of finite values may not be finite
    peak = float(target.max())
    if peak == 0:
        raise ContractError("a PSF needs light; it is 0 everywhere")
    target /= peak
    return np.asarray(target / target.sum())


@dataclass(frozen=True, slots=True, kw_only=True)
class Likeness:
    """The likeness of a light to the wanted one.

    Attributes:
        correlation: Pearson's, over the dots.
        rmse: Root of the mean squared difference, each with its peak at 1.
        efficiency: Share of all light that lies in the dots.
    """

    correlation: float
    rmse: float
    efficiency: float

    def to_json(self) -> dict[str, float]:
        """Return plain JSON values."""
        return {
            "correlation": round(self.correlation, 7),
            "rmse": round(self.rmse, 6),
            "efficiency": round(self.efficiency, 5),
        }


def likeness(light: FloatGrid, target: FloatGrid) -> Likeness:
    """Compare the light of dots with the one that was wanted.

    Args:
        light: (n, n) shares of all light, n odd and as of the target.
        target: (n, n) relative light, of any sum.

    References: Sun 2021, figure 4.4. The correlation of an even light is not defined; it counts
        as 1 where both are even, else as 0.
    """
    spread, target_spread = light - light.mean(), target - target.mean()
    scale = float(np.sqrt((spread**2).sum() * (target_spread**2).sum()))
    even = 1e-12 * float(light.max() * target.max())
    correlation = (
        float((spread * target_spread).sum()) / scale
        if scale > even
        else float(np.ptp(light) <= 1e-9 * light.max() and np.ptp(target) <= 1e-9 * target.max())
    )
    difference = light / light.max() - target / target.max()
    return Likeness(
        correlation=correlation,
        rmse=float(np.sqrt((difference**2).mean())),
        efficiency=float(light.sum()),
    )
