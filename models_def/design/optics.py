"""The lens as a torch module: free numbers in, kernels over fields and depths out."""

from dataclasses import replace
from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.least_squares import jacobian
from camkit.models_def.optics.search.problem import Problem, limits_of, residuals, trace_batch
from camkit.models_def.optics.search.splat import Pixels, splat_batch

_RIDGE: Final = 1e-3
_AT_BOUND: Final = 1e-6


class LensModule(nn.Module):
    """A lens with free numbers.

    The parameter `moves` is 0 for the lens as it began. With `whiten` one unit of any of its
    entries changes the spots alike, so that one learning rate serves stiff and soft numbers.

    Attributes:
        problem: What is free, and which fields, wavelengths and depths are looked at.
        pixels: The sensor.
    """

    begin: Tensor
    basis: Tensor

    def __init__(
        self, problem: Problem, pixels: Pixels, begin: Tensor, *, whiten: bool = True
    ) -> None:
        """Begin at `begin` (variable,), scaled.

        Raises:
            ContractError: If the lens has no free number.
        """
        super().__init__()
        if not problem.free.variables:
            raise ContractError("a joint design needs at least one free number of the lens")
        self.problem, self.pixels = problem, pixels
        self.register_buffer("begin", begin.clone())
        basis = whitening(problem, begin) if whiten else torch.eye(len(begin), dtype=begin.dtype)
        self.register_buffer("basis", basis)
        self.moves = nn.Parameter(torch.zeros_like(begin))

    def scaled(self) -> Tensor:
        """Give the present lens (variable,), within its bounds."""
        return (self.begin + self.basis @ self.moves).clamp(0, 1)

    def forward(self) -> tuple[Tensor, Tensor]:
        """Give kernels (depth, field, 3, k, k) and the penalty of the limits (a scalar)."""
        scaled = self.scaled()[None]
        free = self.problem.free
        distances = self.problem.object_distances_mm or (free.lens.object_distance_mm,)
        kernels, penalty = [], torch.zeros((), dtype=scaled.dtype)
        for distance_mm in distances:
            traced = trace_batch(self.problem, scaled, distance_mm)
            kernels.append(splat_batch(traced.landed, self.pixels)[0])
            penalty = penalty + limits_of(self.problem, traced, distance_mm).square().sum()
        return torch.stack(kernels), penalty

    def lens(self) -> Lens:
        """Give the present lens as a prescription."""
        return self.problem.free.made(self.scaled().detach())


def whitening(problem: Problem, scaled: Tensor) -> Tensor:
    """Give the basis (variable, variable) in which all moves change the spots alike.

    It is the inverse square root of J^T J of the RMS residuals, so that a unit move along any axis
    changes the RMS spot by the size of the pixel core. A number at one of its bounds has an axis
    of its own: mixed with others, it would be cut off where they move on without it.
    """
    rms = replace(problem, merit="rms")
    with torch.no_grad():
        _, slope = jacobian(lambda given: residuals(rms, given), scaled[None])
    normal = slope[0].T @ slope[0] / problem.core_mm**2
    inside = ((scaled > _AT_BOUND) & (scaled < 1 - _AT_BOUND)).to(normal.dtype)
    apart = 1 - torch.outer(inside, inside)
    normal = torch.where((apart > 0) & ~torch.eye(len(scaled), dtype=torch.bool), 0.0, normal)
    values, vectors = torch.linalg.eigh(normal)
    floor = _RIDGE * float(values.max().clamp_min(1e-12))
    basis: Tensor = vectors @ torch.diag((values + floor) ** -0.5) @ vectors.T
    return basis
