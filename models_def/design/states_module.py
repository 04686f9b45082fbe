"""A lens with several configurations in the loop: each state is looked at like one more depth."""

from dataclasses import replace

import torch
from torch import Tensor, nn

from camkit.models_def.design.fabrication import Copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.lens_module import (
    LensKernels,
    MoveUnits,
    bounded,
    sharp_fields,
    unit_basis,
    whitened,
)
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.search.finish import finished_states
from camkit.models_def.optics.search.joint_states import JointProblem
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels


class StatesModule(DesignLens):
    """A lens with free numbers, shared by its configurations or of one of them.

    Kernels of all states stand one behind the other along the axis of depths. The penalty holds the
    limits of every state and what it lost of its focal length.

    Attributes:
        joint: What is free, and the problem of every state.
    """

    basis: Tensor
    sharp: Tensor

    def __init__(
        self,
        joint: JointProblem,
        pixels: Pixels,
        begin: Tensor,
        *,
        whiten: bool = True,
        units: MoveUnits = "range",
    ) -> None:
        """Start at `begin` (variable,), scaled; see `LensModule`."""
        super().__init__()
        self.joint, self.pixels = joint, pixels
        self.problem = joint.terms[0].problem
        self.register_buffer("begin", begin.clone())
        span = torch.tensor(
            [v.variable.high - v.variable.low for v in joint.variables], dtype=torch.float64
        )
        basis = _whitening(joint, begin) if whiten else unit_basis(span, units)
        self.register_buffer("basis", basis)
        self.moves = nn.Parameter(torch.zeros_like(begin))
        sharp = [sharp_fields(t.problem, begin[t.places], pixels) for t in joint.terms]
        self.register_buffer("sharp", torch.cat(sharp))
        self._kernels = [LensKernels(term.problem, pixels) for term in joint.terms]

    def scaled(self) -> Tensor:
        """Return the present lens (variable,), within its bounds."""
        return bounded(self.begin + self.basis @ self.moves)

    def views(self) -> list[tuple[Problem, Tensor]]:
        """Return the problem of every state with its variables."""
        scaled = self.scaled()
        return [(term.problem, scaled[term.places]) for term in self.joint.terms]

    def forward(self) -> tuple[Tensor, Tensor]:
        """Return kernels (state and depth, field, 3, k, k) and the penalty (a scalar)."""
        every, penalty = [], torch.zeros((), dtype=self.begin.dtype)
        pairs = zip(self._kernels, self.views(), self._sharp_parts(), self.joint.terms, strict=True)
        for lens_kernels, (_, scaled), sharp, term in pairs:
            kernels, limits = lens_kernels.nominal(scaled, sharp)
            every.append(kernels)
            efl_loss = term.efl_residuals(scaled[None]).square().sum()
            penalty = penalty + term.weight * (limits + efl_loss)
        return torch.cat(every), penalty

    def made_kernels(self, copy: Copy) -> Tensor:
        """Return the kernels (state and depth, field, 3, k, k) of a copy of the present lens."""
        parts = zip(self._kernels, self.views(), self._sharp_parts(), strict=True)
        return torch.cat([k.fabricated(scaled, sharp, copy) for k, (_, scaled), sharp in parts])

    def _sharp_parts(self) -> tuple[Tensor, ...]:
        counts = [len(term.problem.depths_mm) for term in self.joint.terms]
        return torch.split(self.sharp, counts)

    def finished(self) -> Lens:
        """Return the present lens with rims that pass the light of all its states."""
        return finished_states(self.joint, self.scaled().detach())

    def lens(self) -> Lens:
        """Return the present lens with its configurations."""
        return self.joint.lens_at(self.scaled().detach())


def _whitening(joint: JointProblem, begin: Tensor) -> Tensor:
    terms = tuple(replace(t, problem=replace(t.problem, merit="rms")) for t in joint.terms)
    rms = replace(joint, terms=terms)
    return whitened(rms.residuals, begin, joint.terms[0].problem.core_mm)
