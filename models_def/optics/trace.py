"""Sequential ray tracing through rotationally symmetric surfaces, differentiable in torch.

Rays are structures of arrays (x, y, z, L, M, N each a tensor). Surface tensors have the surface
as their first dimension; the rest broadcasts against the rays, so that wavelengths, fields and
whole lenses are traced together.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Self

import torch
from torch import Tensor

from camkit.models_def.optics.glass.catalogue import AIR
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.tracing import kernel
from camkit.models_def.optics.tracing.compilation import compiled_engine
from camkit.models_def.optics.tracing.frame import Pose, from_surface, rotation, to_surface
from camkit.models_def.optics.tracing.gradient import Eager, trace_tensors
from camkit.models_def.optics.tracing.groove import Groove
from camkit.models_def.optics.tracing.kernel import LensTensors, TraceSettings
from camkit.models_def.optics.tracing.meeting import MIN_COSINE, State
from camkit.models_def.optics.tracing.phase_polynomial import PhaseForm
from camkit.models_def.optics.tracing.sag import sag, sag_slope
from camkit.models_def.optics.tracing.series import Series
from camkit.models_def.optics.tracing.steep import STEEP_COSINE, SteepSurface, cross_steep
from camkit.units import to_mm


class Fate(IntEnum):
    """The fate of a ray; the first failure is kept."""

    VALID = 0
    MISSED = kernel.MISSED
    TOTAL_REFLECTION = kernel.TOTAL_REFLECTION
    VIGNETTED = kernel.VIGNETTED
    NOT_CONVERGED = kernel.NOT_CONVERGED
    GROOVE_WALL = kernel.GROOVE_WALL
    SECOND_HIT = kernel.SECOND_HIT


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceTensors:
    """A lens as tensors; first dimension surface, the rest broadcasts against the rays.

    Attributes:
        curvature_per_mm: (surface, ...).
        conic: (surface, ...).
        even_asphere: (surface, term, ...), coefficients of r^2, r^4, ..., or as `series` says.
        thickness_mm: (surface, ...), after each surface; the last leads to the sensor.
        semi_diameter_mm: (surface, ...).
        index: (surface + 1, ...), before the first and after each surface.
        aspheric: Which surfaces have a polynomial part or grooves.
        grooves: Of each surface, None for none; empty where none has any.
        odd_asphere: (surface, term, ...), as `series` says; None where no surface has any.
        series: Of each surface, None for a plain even asphere; empty where all are.
        phase: (surface, term, ...) in radians; None where no surface has any.
        order_mm: (surface, ...), path per radian of phase; broadcasts as the index.
        phases: Of each surface, None for none; empty where none has any.
        poses: Of each surface by design, None where it stands centred; empty where all do.
    """

    curvature_per_mm: Tensor
    conic: Tensor
    even_asphere: Tensor
    thickness_mm: Tensor
    semi_diameter_mm: Tensor
    index: Tensor
    aspheric: tuple[bool, ...]
    grooves: tuple[Groove | None, ...] = ()
    odd_asphere: Tensor | None = None
    series: tuple[Series | None, ...] = ()
    phase: Tensor | None = None
    order_mm: Tensor | None = None
    phases: tuple[PhaseForm | None, ...] = ()
    poses: tuple[Pose | None, ...] = ()

    def converted(self, target: torch.dtype | torch.device) -> Self:
        """Return the same lens in another type or on another device."""
        return replace(
            self,
            curvature_per_mm=self.curvature_per_mm.to(target),
            conic=self.conic.to(target),
            even_asphere=self.even_asphere.to(target),
            thickness_mm=self.thickness_mm.to(target),
            semi_diameter_mm=self.semi_diameter_mm.to(target),
            index=self.index.to(target),
            odd_asphere=None if self.odd_asphere is None else self.odd_asphere.to(target),
            phase=None if self.phase is None else self.phase.to(target),
            order_mm=None if self.order_mm is None else self.order_mm.to(target),
            poses=tuple(p and Pose(p.turn.to(target), p.offset_mm.to(target)) for p in self.poses),
        )

    def height(self, i: int, rho: Tensor) -> Tensor:
        """Return the height in mm of surface i at rho = r^2; see `tracing.sag`."""
        return sag(*self._shape(i, rho))

    def slope(self, i: int, rho: Tensor) -> Tensor:
        """Return dh/d rho of surface i at rho = r^2."""
        return sag_slope(*self._shape(i, rho))

    def _shape(
        self, i: int, rho: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor | None, Series | None]:
        terms = self.even_asphere[i] if self.aspheric[i] else self.even_asphere[i][:0]
        odd = None if self.odd_asphere is None else self.odd_asphere[i]
        series = self.series[i] if self.series else None
        return self.curvature_per_mm[i], self.conic[i], terms, rho, odd, series


@dataclass(frozen=True, slots=True, kw_only=True)
class Rays:
    """Rays at a plane or surface; positions in mm relative to the vertex they belong to.

    Attributes:
        x, y, z: Position.
        l, m, n: Direction cosines, n > 0 except of steep rays.
        fate: int8, see `Fate`. A ray that is not valid rests on the axis with finite values and
            zero gradients.
        path_mm: Optical path, if asked for; of lost rays it means nothing.
        steep: Whether some may run across the axis or backwards, before the first surface.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    l: Tensor  # noqa: E741
    m: Tensor
    n: Tensor
    fate: Tensor
    path_mm: Tensor | None = None
    steep: bool = False

    @property
    def valid(self) -> Tensor:
        """Mask of the rays that are still alive."""
        return self.fate == Fate.VALID


def surface_tensors(lens: Lens, wavelengths_um: Tensor) -> SurfaceTensors:
    """Return the tensors of a lens, float64.

    Args:
        lens: The prescription.
        wavelengths_um: Any shape; the index has (surface + 1, *shape).
    """
    surfaces = lens.surfaces
    parts = [s.polynomial for s in surfaces]
    phases = [s.phase for s in surfaces]
    phased = any(phase is not None for phase in phases)
    waves = wavelengths_um.to(torch.float64)
    glass = [refractive_index(s.medium, waves) + s.index_offset for s in surfaces]

    def column(values: list[float]) -> Tensor:
        return torch.tensor(values, dtype=torch.float64)

    return SurfaceTensors(
        curvature_per_mm=column([s.curvature_per_mm for s in surfaces]),
        conic=column([s.conic for s in surfaces]),
        even_asphere=padded([part.even for part in parts]),
        thickness_mm=column([s.thickness_mm for s in surfaces]),
        semi_diameter_mm=column([s.semi_diameter_mm for s in surfaces]),
        index=torch.stack([refractive_index(lens.object_medium, waves), *glass]),
        aspheric=tuple(_is_aspheric(s) for s in surfaces),
        grooves=tuple(_groove(s) for s in surfaces),
        odd_asphere=padded([part.odd for part in parts]) if any(p.odd for p in parts) else None,
        series=tuple(p.series for p in parts) if any(p.series for p in parts) else (),
        phase=padded([p.coefficients if p else () for p in phases]) if phased else None,
        order_mm=_orders_mm(phases, waves) if phased else None,
        phases=tuple(p.form if p else None for p in phases) if phased else (),
        poses=_poses(surfaces),
    )


def _poses(surfaces: Sequence[Surface]) -> tuple[Pose | None, ...]:
    """Return the poses of surfaces: those of an element turn about its front vertex."""
    poses: list[Pose | None] = []
    stance, depth_mm = None, 0.0
    for surface in surfaces:
        if surface.stance is not None:
            stance, depth_mm = surface.stance, 0.0
        if stance is None:
            poses.append(None)
        else:
            turn = rotation(torch.tensor(stance.tilt_rad, dtype=torch.float64))
            vertex = torch.tensor([0.0, 0.0, depth_mm], dtype=torch.float64)
            shift = torch.tensor([*stance.decentre_mm, 0.0], dtype=torch.float64)
            poses.append(Pose(turn=turn, offset_mm=turn @ vertex - vertex + shift))
        depth_mm += surface.thickness_mm
        stance = None if surface.glass == AIR.name else stance
    return tuple(poses) if any(poses) else ()


def padded(rows: Sequence[Sequence[float]]) -> Tensor:
    """Return rows of coefficients as a tensor (row, term), float64, zeros behind."""
    terms = max(len(row) for row in rows)
    filled = [[*row, *[0.0] * (terms - len(row))] for row in rows]
    return torch.tensor(filled, dtype=torch.float64).reshape(len(rows), terms)


def _is_aspheric(surface: Surface) -> bool:
    part = surface.polynomial
    return part.series is not None or any(part.even) or surface.grooves is not None


def _orders_mm(phases: Sequence[Phase | None], waves: Tensor) -> Tensor:
    orders = torch.tensor([p.order_mm(1.0) if p else 0.0 for p in phases], dtype=torch.float64)
    return orders.reshape(-1, *[1] * waves.ndim) * waves


def _groove(surface: Surface) -> Groove | None:
    grooves = surface.grooves
    if grooves is None:
        return None
    return Groove(
        depth_mm=to_mm(grooves.depth_um),
        walls=grooves.walls,
        tool_radius_mm=to_mm(grooves.tool_radius_um),
        solid_after=surface.glass != AIR.name,
    )


def without_walls(tensors: SurfaceTensors) -> SurfaceTensors:
    """Return the lens with ideal grooves, for rays that are a reference and must not be lost."""
    ideal = (None if g is None else replace(g, walls=False) for g in tensors.grooves)
    return replace(tensors, grooves=tuple(ideal))


def count_fates(fate: Tensor) -> dict[Fate, int]:
    """Count the rays of each fate; every fate has an entry."""
    counts = torch.bincount(fate.flatten().to(torch.int64), minlength=len(Fate)).tolist()
    return {kind: int(counts[kind]) for kind in Fate}


def trace(
    tensors: SurfaceTensors,
    rays: Rays,
    *,
    surfaces: range | None = None,
    surface_rays: list[Rays] | None = None,
    path: bool = False,
    compiled: bool = False,
) -> Rays:
    """Trace rays to the plane after the last surface (the sensor, if all are traced).

    The computation is done in the widest type of its inputs, in blocks; the gradient is exact
    and needs 24 (float32) or 48 bytes per ray and surface, or as much per ray for large bundles
    (see `tracing.gradient`). Second derivatives and forward mode are not available.

    Args:
        tensors: The lens.
        rays: At the vertex plane of the first surface to be traced (any z is taken along).
        surfaces: Which surfaces, in order; all by default.
        surface_rays: Receives the rays on each surface, after refraction, relative to its vertex
            (the nominal one of a surface that stands tilted or decentred).
        path: Whether `path_mm` of the result is the optical path: that of the given rays (or 0)
            plus the sum of index times way up to the final plane.
        compiled: Fuse the lens into one loop by `torch.compile`: worth its minute of compilation
            for many rays. Without a C++ compiler, or with `surface_rays`, this is the plain trace.

    Returns:
        Rays on the plane that lies the last thickness after the last surface (z = 0 there).
    """
    order = surfaces if surfaces is not None else range(len(tensors.aspheric))
    if not order:
        return rays
    if rays.steep:
        return _trace_steep(tensors, rays, order, surface_rays=surface_rays, path=path)
    if any(tensors.poses[order.start : order.stop]):
        return _trace_posed(tensors, rays, order, surface_rays=surface_rays, path=path)
    result = _trace(tensors, rays, order, surface_rays=surface_rays, path=path, compiled=compiled)
    return replace(result, z=torch.zeros_like(result.z))


def refract(tensors: SurfaceTensors, rays: Rays, i: int) -> Rays:
    """Trace rays onto surface i, judge them, and bend them (Snell); they stay on it."""
    surface_rays: list[Rays] = []
    trace(tensors, rays, surfaces=range(i, i + 1), surface_rays=surface_rays)
    return surface_rays[0]


def _trace_steep(
    tensors: SurfaceTensors,
    rays: Rays,
    surfaces: range,
    *,
    surface_rays: list[Rays] | None,
    path: bool,
) -> Rays:
    """Trace steep rays through the first surface by `tracing.steep`, then as all others."""
    i = surfaces.start
    state, fate, length = cross_steep(
        _steep_surface(tensors, i), _state(rays), rays.fate, rays.path_mm if path else None
    )
    met = Rays(**state._asdict(), fate=fate, path_mm=length if path else None)
    if surface_rays is not None:
        surface_rays.append(met)
    z = met.z - tensors.thickness_mm[i]
    onward = replace(met, z=z, steep=bool((met.n < STEEP_COSINE).any()))
    if surfaces[1:]:
        return trace(tensors, onward, surfaces=surfaces[1:], surface_rays=surface_rays, path=path)
    fates = torch.where((fate == 0) & (met.n <= MIN_COSINE), kernel.MISSED, fate).to(torch.int8)
    still = kernel.rest(_state(onward), fates, adaptive=True)
    way = -still.z / still.n
    end = still._replace(
        x=still.x + way * still.l, y=still.y + way * still.m, z=torch.zeros_like(still.z)
    )
    if met.path_mm is not None:
        length = met.path_mm + tensors.index[i + 1] * way
    return Rays(**end._asdict(), fate=fates, path_mm=length if path else None)


def _steep_surface(tensors: SurfaceTensors, i: int) -> SteepSurface:
    """Return a surface for steep rays; one with grooves, a phase or a tilt has no rim for them."""
    special = (parts[i] for parts in (tensors.grooves, tensors.phases, tensors.poses) if parts)
    reach = tensors.semi_diameter_mm[i]
    return SteepSurface(
        curvature=tensors.curvature_per_mm[i],
        conic=tensors.conic[i],
        profile=lambda rho: (tensors.height(i, rho), tensors.slope(i, rho)),
        aspheric=tensors.aspheric[i],
        reach_mm=torch.zeros_like(reach) if any(special) else reach,
        before=tensors.index[i],
        after=tensors.index[i + 1],
    )


def _trace_posed(
    tensors: SurfaceTensors,
    rays: Rays,
    surfaces: range,
    *,
    surface_rays: list[Rays] | None,
    path: bool,
) -> Rays:
    """Trace rays surface by surface, each in its own frame, between them in the nominal one."""
    flush = replace(tensors, thickness_mm=torch.zeros_like(tensors.thickness_mm))
    for i in surfaces:
        pose = tensors.poses[i]
        hit_rays: list[Rays] = []
        here = rays if pose is None else _framed(rays, to_surface(pose, _state(rays)))
        rays = _trace(flush, here, range(i, i + 1), surface_rays=hit_rays, path=path)
        hits = hit_rays[0]
        if pose is not None:
            rays = _framed(rays, from_surface(pose, _state(rays)))
            hits = _framed(hits, from_surface(pose, _state(hits)))
        if surface_rays is not None:
            surface_rays.append(hits)
        rays = replace(rays, z=rays.z - tensors.thickness_mm[i])
    way = -rays.z / rays.n
    length = rays.path_mm
    end = _state(rays)._replace(
        x=rays.x + way * rays.l, y=rays.y + way * rays.m, z=torch.zeros_like(rays.z)
    )
    if length is not None and path:
        length = length + tensors.index[surfaces.stop] * way
    return replace(_framed(rays, end), path_mm=length)


def _state(rays: Rays) -> State:
    return State(rays.x, rays.y, rays.z, rays.l, rays.m, rays.n)


def _framed(rays: Rays, state: State) -> Rays:
    """Return rays in another frame, the lost ones at rest, those sent backwards lost."""
    fate = torch.where((rays.fate == 0) & (state.n <= MIN_COSINE), kernel.MISSED, rays.fate)
    fate = fate.to(torch.int8)
    return replace(rays, **kernel.rest(state, fate, adaptive=True)._asdict(), fate=fate)


def _trace(
    tensors: SurfaceTensors,
    rays: Rays,
    surfaces: range,
    *,
    surface_rays: list[Rays] | None = None,
    path: bool = False,
    compiled: bool = False,
) -> Rays:
    first, end = surfaces.start, surfaces.stop
    settings = TraceSettings(
        aspheric=tensors.aspheric[first:end],
        grooves=tensors.grooves[first:end] or (None,) * len(surfaces),
        path=path,
        series=tensors.series[first:end],
        phases=tensors.phases[first:end],
    )
    like = tensors.curvature_per_mm[first:end]
    none = like.new_zeros(len(like), 0)

    def part(value: Tensor | None, otherwise: Tensor) -> Tensor:
        return otherwise if value is None else value[first:end]

    lens = LensTensors(
        tensors.curvature_per_mm[first:end],
        tensors.conic[first:end],
        tensors.even_asphere[first:end],
        tensors.thickness_mm[first:end],
        tensors.semi_diameter_mm[first:end],
        tensors.index[first : end + 1],
        part(tensors.odd_asphere, none),
        part(tensors.phase, none),
        part(tensors.order_mm, like.new_zeros(len(like))),
    )
    state = State(rays.x, rays.y, rays.z, rays.l, rays.m, rays.n)
    dtype = functools.reduce(torch.promote_types, (v.dtype for v in (*lens, *state)))
    lens = LensTensors(*(v.to(dtype) for v in lens))
    state = State(*(v.to(dtype) for v in state))
    engine = compiled_engine() if compiled and surface_rays is None else Eager()
    result = trace_tensors(
        settings, engine, lens, state, rays.fate, with_surfaces=surface_rays is not None
    )
    if surface_rays is not None:
        states = zip(result.record.states, result.record.fates, strict=True)
        surface_rays += [
            Rays(**surface_state._asdict(), fate=fate) for surface_state, fate in states
        ]
    length = result.path
    if length is not None and rays.path_mm is not None:
        length = length + rays.path_mm
    return Rays(**result.end._asdict(), fate=result.record.fate, path_mm=length)
