"""Launch points for every ray of a beam.

Newton's method starts at the paraxial entrance pupil. That settles most lenses in a few steps.
Rays that it does not settle (wide angles, fast retrofocus lenses) start again from the chief ray
of their field (`chief_path`), and their points of the stop move out from its middle in stages.
Of beams of many rays a few are aimed so, and foretell the others (`pupil_map`).
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.aiming.chief_path import chief_path, lens_length_mm
from camkit.models_def.optics.aiming.field import is_steep, lead_factor
from camkit.models_def.optics.aiming.newton import Aim, newton_aim
from camkit.models_def.optics.aiming.pupil_map import MANY, few_rays, foretold
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.paraxial import entrance_pupil
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.trace import Rays, SurfaceTensors, refract, trace

_STEPS: Final = (4,)
_STAGES: Final = (0.0, 0.25, 0.5, 0.75, 1.0)


def aim(lens: Lens, tensors: SurfaceTensors, target: tuple[Tensor, Tensor], slope: Tensor) -> Aim:
    """Find launch points, without gradient.

    Args:
        lens: The prescription: its stop and its object distance.
        tensors: The lens at the wavelengths of the rays.
        target: Wanted points x and y on the stop in mm; they broadcast with slope.
        slope: tan of the field angle (`field.field_slope`).
    """
    blank = torch.zeros_like(target[0] + slope)
    points, slope = (target[0] + blank, target[1] + blank), slope + blank
    plane = not bool(tensors.curvature_per_mm[0].any()) and not tensors.aspheric[0]
    if lens.stop == 0 and plane and not bool(is_steep(slope).any()):
        return Aim(x=points[0], y=points[1], weight=torch.ones_like(blank))
    tensors = with_open_apertures(tensors)
    with torch.no_grad():
        count = target[0].shape[-1]
        if target[0].ndim == 1 and count >= MANY:
            return _mapped(lens, tensors, target, slope)
        begin = _paraxial_begin(lens, tensors, points, slope)
        return _settled(lens, tensors, points, slope, begin, _STEPS)


def _mapped(
    lens: Lens, tensors: SurfaceTensors, target: tuple[Tensor, Tensor], slope: Tensor
) -> Aim:
    """Aim a few rays of each beam, and all others from where those foretell."""
    few = few_rays(len(target[0]))
    some = slope[..., few]
    points = (target[0][few] + 0 * some, target[1][few] + 0 * some)
    begin = _paraxial_begin(lens, tensors, points, some)
    aimed = _settled(lens, tensors, points, some, begin, _STEPS)
    begin = foretold(_rays_at_stop(lens, tensors, slope), target, few, aimed)
    return _settled(lens, tensors, target, slope, begin, (1, *_STEPS))


def _settled(
    lens: Lens,
    tensors: SurfaceTensors,
    points: tuple[Tensor, Tensor],
    slope: Tensor,
    begin: tuple[Tensor, Tensor],
    steps: tuple[int, ...],
) -> Aim:
    """Aim every ray by itself, from where it is given.

    Args:
        lens: The prescription.
        tensors: The lens, its rims open.
        points: On the stop.
        slope: Of the fields.
        begin: Launch points.
        steps: Of Newton's method; what it does not settle goes on apart from the others, with the
            next number of steps, and in the end from the chief ray outwards.
    """
    at_stop, length_mm = _rays_at_stop(lens, tensors, slope), lens_length_mm(lens)
    aimed_rays = newton_aim(at_stop, points, begin, steps=steps[0], length_mm=length_mm)
    is_lost = aimed_rays.weight == 0
    if not bool(is_lost.any()):
        return aimed_rays
    few = _of_rays(tensors, is_lost)
    goal = (points[0].expand(is_lost.shape)[is_lost], points[1].expand(is_lost.shape)[is_lost])
    slopes = slope.expand(is_lost.shape)[is_lost]
    if len(steps) > 1:
        second = _settled(
            lens, few, goal, slopes, (aimed_rays.x[is_lost], aimed_rays.y[is_lost]), steps[1:]
        )
    else:
        second = _staged(lens, few, goal, slopes)
    pairs = ((aimed_rays.x, second.x), (aimed_rays.y, second.y), (aimed_rays.weight, second.weight))
    x, y, weight = (values.masked_scatter(is_lost, better) for values, better in pairs)
    return Aim(x=x, y=y, weight=weight)


def _rays_at_stop(
    lens: Lens, tensors: SurfaceTensors, slope: Tensor
) -> Callable[[Tensor, Tensor], Rays]:
    """Return what takes launch points to the rays on the stop."""

    def at_stop(x: Tensor, y: Tensor) -> Rays:
        rays = launch(x, y, slope, lens.object_distance_mm)
        return refract(tensors, trace(tensors, rays, surfaces=range(lens.stop)), lens.stop)

    return at_stop


def _of_rays(tensors: SurfaceTensors, mask: Tensor) -> SurfaceTensors:
    """Return the lens as it is for some of its rays (ray,): those of a mask in their shape."""

    def pick(values: Tensor, lead: int) -> Tensor:
        if values.ndim <= lead:
            return values
        batch = values.shape[lead:]
        aligned = values.reshape(*values.shape[:lead], *[1] * (mask.ndim - len(batch)), *batch)
        return aligned.expand(*values.shape[:lead], *mask.shape)[..., mask]

    return replace(
        tensors,
        curvature_per_mm=pick(tensors.curvature_per_mm, 1),
        conic=pick(tensors.conic, 1),
        even_asphere=pick(tensors.even_asphere, 2),
        thickness_mm=pick(tensors.thickness_mm, 1),
        semi_diameter_mm=pick(tensors.semi_diameter_mm, 1),
        index=pick(tensors.index, 1),
        odd_asphere=None if tensors.odd_asphere is None else pick(tensors.odd_asphere, 2),
        phase=None if tensors.phase is None else pick(tensors.phase, 2),
        order_mm=None if tensors.order_mm is None else pick(tensors.order_mm, 1),
    )


def _staged(
    lens: Lens, tensors: SurfaceTensors, points: tuple[Tensor, Tensor], slope: Tensor
) -> Aim:
    """Aim from the chief ray outwards; each stage begins where the two before it foretell."""
    at_stop, length_mm = _rays_at_stop(lens, tensors, slope), lens_length_mm(lens)
    y = -chief_path(lens).lead_at(slope) * lead_factor(slope)
    here = last = (torch.zeros_like(y), y)
    for stage in _STAGES:
        ahead = (2 * here[0] - last[0], 2 * here[1] - last[1])
        goal = (stage * points[0], stage * points[1])
        aimed_rays = newton_aim(at_stop, goal, ahead, length_mm=length_mm)
        last, here = here, (aimed_rays.x, aimed_rays.y)
    return aimed_rays


def _paraxial_begin(
    lens: Lens, tensors: SurfaceTensors, points: tuple[Tensor, Tensor], slope: Tensor
) -> tuple[Tensor, Tensor]:
    """Return where rays to the paraxial images of points of the stop start."""
    place, scale = (
        torch.nan_to_num(v, nan=0.0, posinf=0.0, neginf=0.0)
        for v in entrance_pupil(tensors, lens.stop)
    )
    x, y, distance_mm = scale * points[0], scale * points[1], lens.object_distance_mm
    if math.isinf(distance_mm):
        return x, y - place * lead_factor(slope)
    share, top = distance_mm / (distance_mm + place), -slope * distance_mm
    return x * share, top + (y - top) * share
