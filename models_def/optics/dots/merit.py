"""The merit of a plate of dots: light outside the dots, and light at the wrong ones.

    merit = 1 - E + weight * mean((I / E - target)^2) / peak^2,    E = sum of I over the dots

Both terms fall together for a while; then more light costs likeness, and `weight` sets the price.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.models_def.optics.dots.target import FloatGrid

WEIGHT: Final = 1000.0
"""A hundredth of the light for 0.003 of RMSE, the peak being 1: half the error of the thesis."""
_TINY: Final = 1e-300


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Merit:
    """The error of the light of dots, 0 at best.

    Attributes:
        target: (n, n) of unit sum.
        weight: Of likeness beside light.
    """

    target: FloatGrid
    weight: float = WEIGHT

    def of(self, light: FloatGrid) -> NDArray[np.float64]:
        """Return the merit (...) of light (..., n, n), shares of all light."""
        total = light.sum((-2, -1))
        difference = light / np.maximum(total, _TINY)[..., None, None] - self.target
        return np.asarray(1 - total + self._price * (difference**2).sum((-2, -1)))

    def slope(self, light: FloatGrid) -> FloatGrid:
        """Return the slope (n, n) of the merit by light (n, n)."""
        total = max(float(light.sum()), _TINY)
        share = light / total
        difference = share - self.target
        return np.asarray(2 * self._price * (difference - (difference * share).sum()) / total - 1)

    @property
    def _price(self) -> float:
        return self.weight / (self.target.size * float(self.target.max()) ** 2)
