"""The interface of a lens in a design loop, with free numbers or without."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

from torch import Tensor, nn

from camkit.models_def.design.fabrication import Copy
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels


class DesignLens(nn.Module, ABC):
    """A lens in a loop.

    Attributes:
        problem: Its fields, wavelengths and depths; of a lens with several configurations those of
            the first.
        pixels: The sensor.
        begin: (variable,), its free numbers as it began, scaled.
        moves: (variable,), what a loop changes; 0 for the lens as it began.
    """

    problem: Problem
    pixels: Pixels
    begin: Tensor
    moves: nn.Parameter

    @abstractmethod
    def scaled(self) -> Tensor:
        """Return the present lens (variable,)."""

    @abstractmethod
    def forward(self) -> tuple[Tensor, Tensor]:
        """Return kernels (depth, field, 3, k, k) and the penalty of the limits (a scalar)."""

    @abstractmethod
    def made_kernels(self, copy: Copy) -> Tensor:
        """Return the kernels (depth, field, 3, k, k) of a copy of the present lens."""

    @abstractmethod
    def views(self) -> Sequence[tuple[Problem, Tensor]]:
        """Return the problems, one for each configuration, each with its variables, scaled."""

    @abstractmethod
    def finished(self) -> Lens:
        """Return the present lens with rims that pass its light."""

    @property
    def depth_count(self) -> int:
        """Return how many depths, over all configurations, have kernels."""
        return sum(len(problem.depths_mm) for problem, _ in self.views())

    @abstractmethod
    def lens(self) -> Lens:
        """Return the present lens as a prescription."""
