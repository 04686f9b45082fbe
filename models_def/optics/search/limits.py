"""Limits of a lens, as residuals that vanish inside them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.search.penalty import edge_gaps, ray_penalty, reach_rho
from camkit.models_def.optics.trace import Rays, SurfaceTensors

_PENALTY_PER_MM: Final = 3.0
_SOFT: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The limits of a lens, beside the ranges of its free numbers.

    Attributes:
        distortion: Greatest distortion that costs nothing, as a share of the ideal image height;
            inf for no limit.
        min_edge_mm: Least edge thickness of an element.
        min_air_mm: Least distance of the edges of two elements.
        min_bfl_mm: Least distance of the sensor from the last vertex.
        max_curvature_per_mm: Greatest curvature of the solved surface, which has no range.
        max_steepness: Greatest product of the curvature of a surface and the height of the beam
            on it.
    """

    distortion: float = math.inf
    min_edge_mm: float = 1.0
    min_air_mm: float = 0.1
    min_bfl_mm: float = 0.0
    max_curvature_per_mm: float = 0.08
    max_steepness: float = 0.8

    def __post_init__(self) -> None:
        if not (self.distortion > 0 and self.max_curvature_per_mm > 0):
            raise ContractError(
                "distortion and max_curvature_per_mm must be > 0; got "
                f"{self.distortion:g} and {self.max_curvature_per_mm:g}"
            )


def limit_residuals(
    limits: Limits,
    tensors: SurfaceTensors,
    surface_rays: list[Rays],
    *,
    solved: int | None,
    glass: tuple[bool, ...],
) -> dict[str, Tensor]:
    """Return residuals (start, residual) by the keys of `Limits` that they hold.

    Thickness at the centre is a matter of bounds.

    Args:
        limits: The limits.
        tensors: (surface, start, 1, 1, 1).
        surface_rays: On every surface, (start, field, wave, ray); heights are those of living rays.
        solved: The surface whose curvature is solved for.
        glass: Whether the medium after each surface is glass.
    """
    gaps, curvature = (t[..., 0, 0, 0] for t in (tensors.thickness_mm, tensors.curvature_per_mm))
    rho = [reach_rho(rays, tensors.thickness_mm[0]) for rays in surface_rays]
    least = [limits.min_edge_mm if inside else limits.min_air_mm for inside in glass[:-1]]
    # a stop is a plane in air: it may stand where a surface bulges through it
    real = [before or after for before, after in zip((False, *glass), glass, strict=False)]
    least = [edge if real[i] and real[i + 1] else -math.inf for i, edge in enumerate(least)]
    edges = edge_gaps(tensors, rho)[..., 0, 0, 0]
    thin = torch.relu(torch.tensor(least, dtype=gaps.dtype)[:, None] - edges)
    steep = torch.relu(steepness(curvature, rho) - limits.max_steepness)
    short = torch.relu(limits.min_bfl_mm - gaps[-1])[None]
    rows = {"min_edge_mm or min_air_mm": thin, "max_steepness": steep, "min_bfl_mm": short}
    if solved is not None:
        rows["max_curvature_per_mm"] = (
            torch.relu(torch.abs(curvature[solved]) - limits.max_curvature_per_mm)[None] * 10
        )
    return {key: row.T * _PENALTY_PER_MM for key, row in rows.items()}


def steepness(curvature: Tensor, rho: list[Tensor]) -> Tensor:
    """Return |curvature| times the height of the beam (surface, start).

    Args:
        curvature: (surface, start).
        rho: On every surface, see `reach_rho`.
    """
    # the root behind a floor: its slope is finite though all living rays may lie on the axis
    reach = torch.stack(rho)[..., 0, 0, 0].clamp_min(1e-12).sqrt()
    return torch.abs(curvature * reach)


def ray_residuals(tensors: SurfaceTensors, launched: Rays, surface_rays: Sequence[Rays]) -> Tensor:
    """Return residuals (start, field) of rays that are lost or near to it.

    Args:
        tensors: (surface, start, 1, 1, 1).
        launched: (start, field, 1, ray), those that bound the beam.
        surface_rays: On every surface, (start, field, wave, ray).
    """
    # the logarithm, as rays that pass far beyond a surface would drown all else
    paid = torch.log1p(ray_penalty(tensors, launched, surface_rays)).mean((-2, -1))
    # the root has a finite slope where nothing is paid
    return _PENALTY_PER_MM * (torch.sqrt(paid + _SOFT**2) - _SOFT)


def distortion_residuals(limits: Limits, chief_y: Tensor, ideal_y: Tensor) -> Tensor:
    """Return residuals (start, field) of chief rays that land too far from their ideal heights.

    Args:
        limits: The limits.
        chief_y: (start, field) in mm.
        ideal_y: (field,) or (start, field) in mm, not 0.
    """
    bent = torch.relu(torch.abs(chief_y / ideal_y - 1) - limits.distortion)
    return 10 * _PENALTY_PER_MM * bent
