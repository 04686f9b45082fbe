"""The lens as a torch module: free numbers in, kernels over fields and depths out."""

from dataclasses import replace
from typing import Any, Final, Literal

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.design.fabrication import Copy, made_with
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.analysis.psf_model import WAVE_BELOW, PsfModel, psf_model
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.search.finish import finished
from camkit.models_def.optics.search.least_squares import Residuals, jacobian
from camkit.models_def.optics.search.problem import (
    Change,
    Problem,
    Traced,
    limits_of,
    residuals,
    trace_batch,
)
from camkit.models_def.optics.search.splat import Pixels, splat_batch
from camkit.models_def.optics.search.wave_splat import wave_batch, wave_problem
from camkit.models_def.optics.tolerance.landing import window_px
from camkit.models_def.optics.trace import SurfaceTensors
from camkit.units import UM_PER_MM

MoveUnits = Literal["range", "own"]

WIDEST_PX: Final = 385
_LOST_LIGHT: Final = 0.01
_SPARE: Final = 1.25
_LEAST_PX: Final = 33
_AIRY_RADII: Final = 16.6
"""Radius that holds 99 % of an Airy pattern."""
_RIDGE: Final = 1e-3
_AT_BOUND: Final = 1e-6


class _Bounded(torch.autograd.Function):
    """Numbers within 0..1; one beyond a bound still feels what leads back, which clamp forgets."""

    @staticmethod
    def forward(ctx: Any, free: Tensor) -> Tensor:
        """Return the numbers within their bounds."""
        ctx.save_for_backward(free)
        return free.clamp(0, 1)

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> Tensor:
        """Return the gradient without the part that leads further out."""
        (free,), (slope,) = ctx.saved_tensors, slopes
        outward = ((free < 0) & (slope > 0)) | ((free > 1) & (slope < 0))
        return torch.where(outward, 0.0, slope)


def bounded(free: Tensor) -> Tensor:
    """Return numbers within 0..1; those beyond still feel what leads back."""
    inside: Tensor = _Bounded.apply(free)  # type: ignore[no-untyped-call]
    return inside


class LensKernels:
    """The kernels of a lens with free numbers before a sensor."""

    def __init__(self, problem: Problem, pixels: Pixels) -> None:
        """Prepare what does not depend on the lens."""
        self.problem, self.pixels = problem, pixels
        self._wave_problem = wave_problem(problem)

    def nominal(self, scaled: Tensor, sharp: Tensor) -> tuple[Tensor, Tensor]:
        """Return kernels (depth, field, 3, k, k) and the penalty of the limits (a scalar).

        Args:
            scaled: (variable,); gradients flow.
            sharp: (depth, field), which are summed from waves.
        """
        batch, problem = scaled[None], self.problem
        kernels, penalty = [], torch.zeros((), dtype=scaled.dtype)
        for depth, distance_mm in enumerate(problem.depths_mm):
            traced = trace_batch(problem, batch, distance_mm)
            kernels.append(self._at(traced, batch, distance_mm, sharp[depth]))
            if distance_mm == problem.limited_mm:
                penalty = limits_of(problem, traced, distance_mm).square().sum()
        return torch.stack(kernels), penalty

    def fabricated(self, scaled: Tensor, sharp: Tensor, copy: Copy) -> Tensor:
        """Return the kernels of a copy, see `nominal`."""
        batch, problem = scaled[None], self.problem
        focused_mm = problem.free.lens.object_distance_mm

        def change(tensors: SurfaceTensors, reference: SurfaceTensors) -> SurfaceTensors:
            return made_with(tensors, copy, reference=reference, object_distance_mm=focused_mm)

        kernels = []
        for depth, distance_mm in enumerate(problem.depths_mm):
            traced = trace_batch(problem, batch, distance_mm, change)
            kernels.append(self._at(traced, batch, distance_mm, sharp[depth], change))
        return torch.stack(kernels)

    def _at(
        self,
        traced: Traced,
        batch: Tensor,
        distance_mm: float,
        sharp: Tensor,
        change: Change | None = None,
    ) -> Tensor:
        """Return the kernels (field, 3, k, k) by rays, those of sharp fields by waves if wanted."""
        whole_pupil = self.problem.whole_pupil
        rays = splat_batch(traced.landings, self.pixels, whole_pupil=whole_pupil)[0]
        if not bool(sharp.any()):
            return rays
        waves, summed = wave_batch(
            self._wave_problem, batch, distance_mm, self.pixels, sharp, change
        )
        return torch.where(summed[:, None, None, None], waves, rays)


class LensModule(DesignLens):
    """A lens with free numbers.

    The parameter `moves` is 0 for the lens as it began. With `whiten` one unit of any of its
    entries changes the spots alike, so that one learning rate serves stiff and soft numbers.
    Without it `units` says whether 1 is the range of a number or 1 in its own unit.

    Attributes:
        problem: What is free, and which fields, wavelengths and depths are looked at.
        pixels: The sensor.
    """

    basis: Tensor
    sharp: Tensor

    def __init__(
        self,
        problem: Problem,
        pixels: Pixels,
        begin: Tensor,
        *,
        whiten: bool = True,
        units: MoveUnits = "range",
    ) -> None:
        """Start at `begin` (variable,), scaled.

        Raises:
            ContractError: If the lens has no free number.
        """
        super().__init__()
        if not problem.free.variables:
            raise ContractError("a joint design needs at least one free number of the lens")
        self.problem, self.pixels = problem, pixels
        self.register_buffer("begin", begin.clone())
        span = problem.free.high - problem.free.low
        basis = whitening(problem, begin) if whiten else unit_basis(span, units)
        self.register_buffer("basis", basis)
        self.moves = nn.Parameter(torch.zeros_like(begin))
        # in checkpoints: a run that is resumed goes on with the fields that it began with
        self.register_buffer("sharp", sharp_fields(problem, begin, pixels))
        self._kernels = LensKernels(problem, pixels)

    def scaled(self) -> Tensor:
        """Return the present lens (variable,), within its bounds."""
        return bounded(self.begin + self.basis @ self.moves)

    def forward(self) -> tuple[Tensor, Tensor]:
        """Return kernels (depth, field, 3, k, k) and the penalty of the limits (a scalar)."""
        return self._kernels.nominal(self.scaled(), self.sharp)

    def made_kernels(self, copy: Copy) -> Tensor:
        """Return the kernels (depth, field, 3, k, k) of a copy of the present lens."""
        return self._kernels.fabricated(self.scaled(), self.sharp, copy)

    def views(self) -> list[tuple[Problem, Tensor]]:
        """Return the one problem and its variables."""
        return [(self.problem, self.scaled())]

    def finished(self) -> Lens:
        """Return the present lens with rims that pass its light."""
        return finished(self.problem, self.scaled().detach())

    def lens(self) -> Lens:
        """Return the present lens as a prescription."""
        return self.problem.free.lens_at(self.scaled().detach())


def sharp_fields(problem: Problem, scaled: Tensor, pixels: Pixels) -> Tensor:
    """Return which fields (depth, field) are summed from waves: those not too wide for them."""
    shape = len(problem.depths_mm), len(problem.slopes)
    if pixels.regime == "rays":
        return torch.zeros(shape, dtype=torch.bool)
    models = design_models(problem, scaled)
    return torch.stack([model.ratio.amax(1) < WAVE_BELOW for model in models])


def design_models(problem: Problem, scaled: Tensor, shares: Tensor | None = None) -> list[PsfModel]:
    """Return the PSF model that a lens (variable,) needs at each depth of a problem.

    Args:
        problem: Fields, wavelengths and depths.
        scaled: The lens.
        shares: (colour, wavelength), see `psf_model`.
    """
    lens = problem.free.lens_at(scaled)
    return [
        psf_model(
            with_object_distance(lens, depth_mm), problem.slopes, problem.wavelengths_um, shares
        )
        for depth_mm in problem.depths_mm
    ]


def fitting_window_px(problem: Problem, scaled: Tensor, pixels: Pixels) -> int:
    """Return the odd window that holds 99 % of the light of every field, depth and colour.

    A quarter is added, so that a design may spread light further than it found it.

    Args:
        problem: Fields, wavelengths and depths.
        scaled: (variable,), the lens.
        pixels: Their window is not used.

    Raises:
        ContractError: If the window would be wider than 385 px.
    """
    wide = replace(pixels, kernel_px=WIDEST_PX)
    with torch.no_grad():
        kernels = torch.stack(
            [
                splat_batch(
                    trace_batch(problem, scaled[None], depth_mm).landings,
                    wide,
                    whole_pupil=problem.whole_pupil,
                )[0]
                for depth_mm in problem.depths_mm
            ]
        )
    light_share = float(kernels.sum((-2, -1)).amin())
    if light_share < 1 - _LOST_LIGHT:
        raise ContractError(
            f"the lens is too blurred to begin with: {WIDEST_PX} px hold {light_share:.0%} of the "
            "light of its worst field; begin from a sharper lens (or [starts]), or set kernel_px"
        )
    least = 2 * round(_SPARE * window_px(kernels, _LOST_LIGHT) / 2) + 1
    if pixels.regime == "waves":
        longest_um = float(problem.wavelengths_um.max())
        airy_mm = airy_radius_mm(problem.free.lens_at(scaled), longest_um)
        least += 2 * round(_AIRY_RADII * airy_mm * UM_PER_MM / pixels.pitch_um)
    return min(max(least, _LEAST_PX), WIDEST_PX)


def unit_basis(span: Tensor, units: MoveUnits) -> Tensor:
    """Return the basis (variable, variable) of moves in ranges, or in units of their own."""
    inverse_span = torch.where(span > 0, 1 / span.clamp_min(1e-300), 0.0)
    return torch.diag(torch.ones_like(span) if units == "range" else inverse_span)


def whitening(problem: Problem, scaled: Tensor) -> Tensor:
    """Return the basis (variable, variable) in which all moves change the spots alike.

    It is the inverse square root of J^T J of the RMS residuals, so that a unit move along any axis
    changes the RMS spot by the size of the pixel core. A number at one of its bounds has an axis
    of its own: mixed with others, it would be cut off where they move on without it.
    """
    rms = replace(problem, merit="rms")
    return whitened(lambda variables: residuals(rms, variables), scaled, problem.core_mm)


def whitened(rms: Residuals, scaled: Tensor, core_mm: float) -> Tensor:
    """Return the basis of `whitening` by RMS residuals."""
    with torch.no_grad():
        _, slope = jacobian(rms, scaled[None])
    normal = slope[0].T @ slope[0] / core_mm**2
    inside = ((scaled > _AT_BOUND) & (scaled < 1 - _AT_BOUND)).to(normal.dtype)
    at_bound = 1 - torch.outer(inside, inside)
    normal = torch.where((at_bound > 0) & ~torch.eye(len(scaled), dtype=torch.bool), 0.0, normal)
    values, vectors = torch.linalg.eigh(normal)
    floor = _RIDGE * float(values.max().clamp_min(1e-12))
    basis: Tensor = vectors @ torch.diag((values + floor) ** -0.5) @ vectors.T
    return basis
