"""Copies of a lens in design: what a factory makes of it, focused at assembly.

A lens that is sharp only if it is made perfectly is no good lens, and its filter knows the nominal
kernels only. So captures are made through a copy with errors of its own at every step, with
gradients to the nominal numbers.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.models_def.optics.paraxial import image_distance
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors, perturb
from camkit.models_def.optics.trace import SurfaceTensors

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Copy:
    """The errors of one copy.

    Attributes:
        radius: (surface,), relative.
        thickness_mm: (surface,), 0 for the last one.
        index: (surface,), of the medium behind; 0 for air.
        focus_mm: Of the sensor, after the copy was focused.
    """

    radius: Array
    thickness_mm: Array
    index: Array
    focus_mm: float


def draw_copy(lens: Lens, errors: FabricationErrors, number: int) -> Copy:
    """Draw the errors of a copy, those of `perturb`; the same number gives the same copy."""
    copy_lens = perturb(lens, errors, np.random.default_rng((number, 77)))
    pairs = list(zip(lens.surfaces, copy_lens.surfaces, strict=True))
    curvatures = [(s.curvature_per_mm, m.curvature_per_mm) for s, m in pairs]
    moved_mm = np.array([m.thickness_mm - s.thickness_mm for s, m in pairs])
    return Copy(
        radius=np.array(
            [nominal / actual - 1 if actual else 0.0 for nominal, actual in curvatures]
        ),
        thickness_mm=np.append(moved_mm[:-1], 0.0),
        index=np.array([m.index_offset - s.index_offset for s, m in pairs]),
        focus_mm=float(moved_mm[-1]),
    )


def made_with(
    tensors: SurfaceTensors, copy: Copy, *, reference: SurfaceTensors, object_distance_mm: float
) -> SurfaceTensors:
    """Return a batch of lenses with the errors of a copy; the sensor follows its paraxial focus.

    Args:
        tensors: Of `FreeLens.tensors`, at any wavelengths.
        copy: The errors.
        reference: The same lenses at the reference wavelength, by which copies are focused.
        object_distance_mm: That they are focused at.
    """
    unfocused = _with_errors(reference, copy)
    shift = image_distance(unfocused, object_distance_mm) - image_distance(
        reference, object_distance_mm
    )
    fabricated = _with_errors(tensors, copy)
    gaps = fabricated.thickness_mm
    last = gaps[-1] + shift + copy.focus_mm
    return replace(fabricated, thickness_mm=torch.cat([gaps[:-1], last[None]]))


def _with_errors(tensors: SurfaceTensors, copy: Copy) -> SurfaceTensors:
    def shaped(values: Array, like: torch.Tensor) -> torch.Tensor:
        flat = torch.from_numpy(values).to(like.dtype)
        return flat.reshape(-1, *(1,) * (like.ndim - 1))

    index = np.concatenate([np.zeros(1), copy.index])
    return replace(
        tensors,
        curvature_per_mm=tensors.curvature_per_mm
        / (1 + shaped(copy.radius, tensors.curvature_per_mm)),
        thickness_mm=tensors.thickness_mm + shaped(copy.thickness_mm, tensors.thickness_mm),
        index=tensors.index + shaped(index, tensors.index),
    )
