"""Copies of a lens as tensors: their beams aimed at the stop, traced and refocused."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.newton import newton_aim
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.glass.dispersion import D_LINE_UM
from camkit.models_def.optics.paraxial import trace_paraxial
from camkit.models_def.optics.prescription import Lens, require_round
from camkit.models_def.optics.pupil import (
    PupilSamples,
    marked,
    pupil_centre,
    pupil_rays,
    with_fixed_stop,
)
from camkit.models_def.optics.tolerance.deviation import Deviations, no_deviations
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.errors import Array, Compensator
from camkit.models_def.optics.tolerance.figure import (
    Figure,
    aperture_radii_mm,
    figures,
    power_curvature,
)
from camkit.models_def.optics.tolerance.misaligned_trace import meet, trace_misaligned
from camkit.models_def.optics.tolerance.pose import poses
from camkit.models_def.optics.tolerance.refit import beam_of, displacement, least_shift
from camkit.models_def.optics.trace import (
    Rays,
    SurfaceTensors,
    surface_tensors,
    without_walls,
)
from camkit.models_def.optics.tracing.frame import Pose

# beams of copies start from those of the nominal lens, which are close: slopes are measured once
_AIM_STEPS: Final = 4
_AIM_FRESH: Final = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The fields, wavelengths and rays of an analysis.

    Attributes:
        slopes: (field,), tan of the field angles.
        azimuths_rad: (field,), of the image point, from +y towards +x.
        wavelengths_um: (wave,).
        samples: Of the whole unit disc, (ray,).
    """

    slopes: Tensor
    azimuths_rad: Tensor
    wavelengths_um: Tensor
    samples: PupilSamples

    def __post_init__(self) -> None:
        if self.slopes.shape != self.azimuths_rad.shape or not len(self.slopes):
            raise ContractError("a view needs fields, each with a slope and an azimuth")


@dataclass(frozen=True, slots=True, kw_only=True)
class Landing:
    """The landing points of the light of copies; each field turned to +y.

    Attributes:
        rays: (copy, field, wave, ray) on the sensor.
        weight: (copy, field, wave, ray), area of the beams; 0 for lost rays.
        chief_x_mm: (copy, field), chief ray of the reference wavelength.
        chief_y_mm: (copy, field).
        refocus_mm: (copy,), what the compensator moved the sensor away from the lens.
    """

    rays: Rays
    weight: Tensor
    chief_x_mm: Tensor
    chief_y_mm: Tensor
    refocus_mm: Tensor


def fabricated_tensors(
    lens: Lens, deviations: Deviations, wavelengths_um: Tensor
) -> SurfaceTensors:
    """Return the tensors (surface, copy, 1, wave, 1) of copies, float64; decentres lie in poses.

    Args:
        lens: Nominal.
        deviations: The errors; the focus error is added to the last thickness.
        wavelengths_um: (wave,).

    Raises:
        ContractError: If copies have grooves of different depths; trace them one by one.
    """
    nominal = surface_tensors(lens, wavelengths_um)
    relief = 1 + deviations.groove_depth
    if (relief != relief[:1]).any():
        raise ContractError("copies whose grooves are of different depths are traced one by one")

    def column(values: Array) -> Tensor:
        """Return (surface, copy, 1, 1, 1) from (copy, surface)."""
        return torch.from_numpy(values).T[:, :, None, None, None]

    def wide(values: Tensor) -> Tensor:
        """Return (surface, 1, 1, 1, 1) from (surface,)."""
        return values[:, None, None, None, None]

    glass = nominal.index[1:, None]
    if deviations.abbe.any():
        # n - n_d is divided by the relative change of V_d; infrared glasses have no d line
        line = torch.tensor([D_LINE_UM], dtype=torch.float64)
        at_d = surface_tensors(lens, line).index[1:, None]
        glass = at_d + (glass - at_d) / (1 + column(deviations.abbe)[:, :, 0, 0])
    index = (glass + column(deviations.index)[:, :, 0, 0])[:, :, None, :, None]
    thickness = wide(nominal.thickness_mm) + column(deviations.thickness_mm)
    focus = torch.zeros_like(thickness)
    focus[-1] = torch.from_numpy(deviations.focus_mm)[:, None, None, None]
    # a profile s times as high: s sag(r) has the curvature s c, 1 + k over s^2 and terms s a
    deeper = column(relief)
    curvature = wide(nominal.curvature_per_mm) / (1 + column(deviations.radius))
    conic = wide(nominal.conic) + column(deviations.conic)
    if deviations.power_fringes.any():
        radii = wide(torch.tensor(aperture_radii_mm(lens), dtype=torch.float64))
        fringe = power_curvature(wide(nominal.curvature_per_mm), wide(nominal.conic), radii)
        curvature = curvature + column(deviations.power_fringes) * fringe
    return SurfaceTensors(
        curvature_per_mm=curvature * deeper,
        conic=torch.where(deeper == 1, conic, (1 + conic) / deeper**2 - 1),
        even_asphere=nominal.even_asphere[:, :, None, None, None, None] * deeper[:, None],
        thickness_mm=thickness + focus,
        semi_diameter_mm=wide(nominal.semi_diameter_mm),
        index=torch.cat([torch.ones_like(index[:1]), index]),
        aspheric=nominal.aspheric,
        grooves=tuple(
            None if groove is None else replace(groove, depth_mm=groove.depth_mm * float(s))
            for groove, s in zip(nominal.grooves, relief[0], strict=True)
        ),
        odd_asphere=None
        if nominal.odd_asphere is None
        else nominal.odd_asphere[:, :, None, None, None, None] * deeper[:, None],
        series=nominal.series,
        phase=None if nominal.phase is None else nominal.phase[:, :, None, None, None, None],
        order_mm=None if nominal.order_mm is None else nominal.order_mm[:, None, None, :, None],
        phases=nominal.phases,
    )


def land(lens: Lens, deviations: Deviations, view: View, compensator: Compensator) -> Landing:
    """Trace the beams of every copy, field and wavelength to the sensor.

    Every ray is aimed at its point of the stop, whose size is that of the nominal lens. Errors
    act on the whole pupil: nothing is mirrored.

    Args:
        lens: Nominal.
        deviations: Of the copies.
        view: Fields, wavelengths, rays.
        compensator: See `errors.Tolerances`; of `gap` the move of the sensor alone, see
            `air_gap` for the gap's.

    Raises:
        ContractError: If the chief ray of a copy is lost, or no ray arrives.
    """
    require_round(lens, "a Monte-Carlo analysis of tolerances")
    if deviations.groove_depth.any() and deviations.copies > 1:
        alone = (deviations.of_copy(number) for number in range(deviations.copies))
        return _joined([land(lens, one, view, compensator) for one in alone])
    fixed = with_fixed_stop(lens)
    with torch.no_grad():
        rays, weight = trace_copies(fixed, deviations, view)
        shift = _refocus(fixed, deviations, view, compensator, (rays, weight))
        wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
        middle = replace(view, wavelengths_um=wave, samples=pupil_centre())
        chief, alive = trace_copies(fixed, deviations, middle, walls=False)
        if not bool((alive > 0).all()) or not bool((weight > 0).any(-1).all()):
            raise ContractError(
                "the light of a Monte-Carlo sample is lost; use smaller errors or fields"
            )
        rays, chief = _shifted(rays, shift), _shifted(chief, shift)
    return Landing(
        rays=rays,
        weight=weight,
        chief_x_mm=chief.x[:, :, 0, 0],
        chief_y_mm=chief.y[:, :, 0, 0],
        refocus_mm=shift,
    )


def _joined(parts: list[Landing]) -> Landing:
    """Join the landings of single copies."""

    def cat(values: Iterable[Tensor]) -> Tensor:
        return torch.cat(list(values))

    names = [f.name for f in fields(Rays) if f.name not in {"path_mm", "steep"}]
    columns: dict[str, Any] = {n: cat(getattr(p.rays, n) for p in parts) for n in names}
    return Landing(
        rays=Rays(**columns),
        **{f.name: cat(getattr(p, f.name) for p in parts) for f in fields(Landing)[1:]},
    )


def trace_copies(
    lens: Lens, deviations: Deviations, view: View, *, walls: bool = True
) -> tuple[Rays, Tensor]:
    """Return rays (copy, field, wave, ray) on the sensor before refocus, and their weights.

    Without walls those of grooves take none: a chief ray is a reference.
    """
    tensors = fabricated_tensors(lens, deviations, view.wavelengths_um)
    tensors = tensors if walls else without_walls(tensors)
    thickness = tensors.thickness_mm[:, :, 0, 0, 0]
    stands = poses(deviations, glass_elements(lens), thickness, view.azimuths_rad)
    shapes = figures(lens, deviations, view.azimuths_rad)
    nominal = surface_tensors(lens, view.wavelengths_um[:, None])
    slope = view.slopes[:, None, None].expand(-1, len(view.wavelengths_um), 1)
    rays, weight = pupil_rays(lens, nominal, view.samples, slope)
    if lens.stop > 0 or stands[0] is not None or lens.surfaces[0].curvature_per_mm:
        rays, weight = _aimed(lens, (tensors, stands, shapes), view, (rays, slope))
    shape = (deviations.copies, *rays.x.shape[-3:])
    rays = Rays(
        **{k: getattr(rays, k).expand(shape).clone() for k in ("x", "y", "z", "l", "m", "n")},
        fate=rays.fate.expand(shape).clone(),
    )
    landings = trace_misaligned(tensors, stands, rays, figures=shapes)
    return landings, torch.where(landings.valid, weight, 0.0)


def _aimed(
    lens: Lens,
    copies: tuple[SurfaceTensors, list[Pose | None], list[Figure | None]],
    view: View,
    start: tuple[Rays, Tensor],
) -> tuple[Rays, Tensor]:
    """Aim the nominal rays anew, at the stop of every copy."""
    tensors, stands, shapes = copies
    opened = with_open_apertures(tensors)
    rays, slope = start

    def at_stop(x: Tensor, y: Tensor) -> Rays:
        launched = launch(x, y, slope, lens.object_distance_mm)
        incoming = trace_misaligned(opened, stands, launched, figures=shapes, end=lens.stop)
        return meet(opened, stands[lens.stop], incoming, lens.stop, shapes[lens.stop])

    blank = torch.zeros_like(tensors.thickness_mm[0] + rays.x)
    radius = lens.aperture_value
    target = (view.samples.x * radius, view.samples.y * radius)
    begin = (rays.x + blank, rays.y + blank)
    aim = newton_aim(at_stop, target, begin, steps=_AIM_STEPS, fresh=_AIM_FRESH)
    share = 1.0 if view.samples.weight is None else view.samples.weight * len(view.samples.x)
    aimed = launch(aim.x, aim.y, slope, lens.object_distance_mm)
    return marked(aimed, aim.weight), aim.weight * share


def _refocus(
    lens: Lens,
    deviations: Deviations,
    view: View,
    compensator: Compensator,
    traced: tuple[Rays, Tensor],
) -> Tensor:
    """Return the movement of the sensors by the compensator (copy,)."""
    if compensator == "none":
        return torch.zeros(deviations.copies, dtype=torch.float64)
    nothing = no_deviations(lens)
    if compensator == "paraxial":
        return _image_mm(lens, deviations) - _image_mm(lens, nothing)
    # the focus error comes after the compensator, which must not see it
    error = torch.from_numpy(deviations.focus_mm)
    beam, nominal = beam_of(*traced), beam_of(*trace_copies(lens, nothing, view))
    if compensator == "gap":
        return least_shift(displacement(beam, nominal), beam) + error
    return least_shift(beam.points, beam) + error - least_shift(nominal.points, nominal)


def _image_mm(lens: Lens, deviations: Deviations) -> Tensor:
    """Return the paraxial image distances (copy,) from the last vertex, reference wavelength."""
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    tensors = fabricated_tensors(lens, deviations, wave)
    one = torch.ones_like(tensors.index[0] * tensors.curvature_per_mm[0])
    distant = math.isinf(lens.object_distance_mm)
    height, slope = (one, 0 * one) if distant else (lens.object_distance_mm * one, one)
    height, slope = trace_paraxial(tensors, height, slope, range(len(lens.surfaces)))
    return (-height / slope).reshape(-1)


def _shifted(rays: Rays, shift_mm: Tensor) -> Rays:
    way = shift_mm[:, None, None, None] / rays.n
    return replace(rays, x=rays.x + way * rays.l, y=rays.y + way * rays.m)
