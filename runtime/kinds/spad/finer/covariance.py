"""The assumed covariance of pictures: the likeness of two sub-pixels at a distance.

C(d) = contrast^2 exp(-(d / reach)^exponent), in units of the squared mean.

Only its rise from 0 matters to an estimate that keeps the mean, see `linear`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.stages import SuperResolve
from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class PictureCovariance:
    """The covariance of pictures, the same in all directions.

    Attributes:
        contrast: Standard deviation of light over its mean.
        reach: Sub-pixels at which it has fallen to 1 / e.
        exponent: How it falls, in (0, 2].
    """

    contrast: float
    reach: float
    exponent: float

    def __post_init__(self) -> None:
        values = (self.contrast, self.reach, self.exponent)
        if not all(math.isfinite(v) and v > 0 for v in values) or self.exponent > 2:
            raise ContractError(
                "contrast and reach of a covariance must be > 0, its exponent in (0, 2]; got "
                f"{self.contrast}, {self.reach}, {self.exponent}"
            )

    @classmethod
    def of(cls, stage: SuperResolve) -> "PictureCovariance":
        """Return what a stage takes for granted."""
        return cls(contrast=stage.contrast, reach=stage.reach, exponent=stage.exponent)

    def lags(self, most: int) -> NDArray[np.float64]:
        """Return C at all distances up to `most` sub-pixels, (2 most + 1, 2 most + 1)."""
        line = np.arange(-most, most + 1)
        distance = np.hypot(line[:, None], line)
        return np.asarray(self.contrast**2 * np.exp(-((distance / self.reach) ** self.exponent)))
