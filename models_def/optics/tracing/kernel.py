"""Rays through the surfaces of a lens: the arithmetic, without gradients (`adjoint` has them).

Positions are relative to the vertex of the surface at hand. Nothing here branches on a ray, so
that `torch.compile` can fuse a whole lens into one loop; only the number of Newton steps follows
the data, and only where it may (`TraceSettings.adaptive`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.groove import Groove, meet_grooves, meets_again
from camkit.models_def.optics.tracing.meeting import (
    MIN_COSINE,
    Bound,
    Meeting,
    Numbers,
    State,
    meet_asphere,
    meet_conic,
    to_plane,
)
from camkit.models_def.optics.tracing.phase_polynomial import PhaseForm, phase_value
from camkit.models_def.optics.tracing.profile import TINY
from camkit.models_def.optics.tracing.series import Series

MISSED: Final = 1
TOTAL_REFLECTION: Final = 2
VIGNETTED: Final = 3
NOT_CONVERGED: Final = 4
GROOVE_WALL: Final = 5
SECOND_HIT: Final = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceSettings:
    """The static settings of a trace.

    Attributes:
        aspheric: Which surfaces have a polynomial part or grooves.
        grooves: Of each surface; None for none.
        path: Whether the optical path is summed.
        adaptive: Whether Newton steps end when every ray has converged.
        series: Of each surface; None for a plain even asphere. Empty where all are.
        phases: Of each surface; None for none. Empty where none has any.
    """

    aspheric: tuple[bool, ...]
    grooves: tuple[Groove | None, ...]
    path: bool
    adaptive: bool = True
    series: tuple[Series | None, ...] = ()
    phases: tuple[PhaseForm | None, ...] = ()


class LensTensors(NamedTuple):
    """The tensors of a lens: first dimension surface (see `trace.SurfaceTensors`)."""

    curvature: Tensor
    conic: Tensor
    even_asphere: Tensor
    thickness: Tensor
    semi_diameter: Tensor
    indices: Tensor
    odd_asphere: Tensor
    phase: Tensor
    order: Tensor


def numbers(lens: LensTensors, settings: TraceSettings) -> list[Numbers]:
    """Return the numbers of every surface, computed for all surfaces at once."""
    c, k = lens.curvature, lens.conic
    kc = c + k * c
    orders = range(1, lens.even_asphere.shape[1] + 1)
    slopes = [lens.even_asphere[:, j - 1] * (2 * j) for j in orders]
    ratio = lens.indices[:-1] / lens.indices[1:]
    square = ratio * ratio
    columns = [c, k, c * k, kc, kc * c, c * k * c]
    rest = [lens.semi_diameter**2, lens.thickness, lens.indices[:-1], lens.indices[1:]]
    rest += [ratio, square, 1 - square]
    heads = zip(*(v.unbind(0) for v in columns), strict=True)
    tails = zip(*(v.unbind(0) for v in rest), strict=True)
    terms = [row.unbind(0) for row in lens.even_asphere.unbind(0)]
    bends = list(zip(*(v.unbind(0) for v in slopes), strict=True)) or [()] * len(terms)
    plain = [
        Numbers(*head, tuple(a), tuple(b), *tail)  # type: ignore[call-arg]
        for head, a, b, tail in zip(heads, terms, bends, tails, strict=True)
    ]
    if not settings.series and not settings.phases:
        return plain
    series = settings.series or (None,) * len(plain)
    phases = settings.phases or (None,) * len(plain)
    odds = [tuple(row.unbind(0)) for row in lens.odd_asphere.unbind(0)]
    terms_rad = [tuple(row.unbind(0)) for row in lens.phase.unbind(0)]
    added = zip(series, odds, phases, terms_rad, lens.order.unbind(0), strict=True)
    return [
        p._replace(series=shape, odd=odd, phase=phase, phase_terms=rad, order=order)
        for p, (shape, odd, phase, rad, order) in zip(plain, added, strict=True)
    ]


class RayRecord(NamedTuple):
    """The inputs of the adjoint: the last fate, rays on each surface and their fates."""

    fate: Tensor
    states: list[State]
    fates: list[Tensor]


class Result(NamedTuple):
    """The result of a trace."""

    end: State
    path: Tensor | None
    record: RayRecord


def run(settings: TraceSettings, lens: Sequence[Numbers], rays: State, fate: Tensor) -> Result:
    """Trace rays; positions relative to the vertex of the first surface.

    Args:
        settings: What is static.
        lens: The surfaces.
        rays: At any z.
        fate: int8, 0 where a ray lives.
    """
    state = rest(rays, fate, adaptive=settings.adaptive)
    # counted in the type of the rays: loops over bytes do not vectorise
    code, fate = fate, fate.to(state.x.dtype)
    path: Tensor | None = torch.zeros_like(state.x) if settings.path else None
    states: list[State] = []
    fates: list[Tensor] = []
    shapes = zip(settings.aspheric, settings.grooves, strict=True)
    for p, shape in zip(lens, shapes, strict=True):
        state, way, now = cross(p, state, fate, shape, adaptive=settings.adaptive)
        code, fate = code if now is fate else now.to(torch.int8), now
        path = None if path is None else path + p.before * way
        if path is not None and p.phase is not None:
            path = path + p.order * phase_value(p.phase, p.phase_terms, state.x, state.y).value
        states.append(state)
        fates.append(code)
        state = state._replace(z=state.z - p.gap)
    state, way = to_plane(state)
    path = None if path is None else path + lens[-1].after * way
    return Result(state, path, RayRecord(code, states, fates))


def rest(state: State, fate: Tensor, *, adaptive: bool, n: float = 1.0) -> State:
    """Move lost rays to the axis, at the vertex (or their gradients to zero, with `n` = 0)."""
    if adaptive and not bool(fate.any()):
        return state
    alive = fate == 0
    places = zip(state, (0.0, 0.0, 0.0, 0.0, 0.0, n), strict=True)
    return State(*(torch.where(alive, value, at) for value, at in places))


def cross(
    p: Numbers, rays: State, fate: Tensor, shape: tuple[bool, Groove | None], *, adaptive: bool
) -> tuple[State, Tensor, Tensor]:
    """Trace rays onto a surface and refract them.

    Args:
        p: The surface.
        rays: At any z.
        fate: 0 where a ray lives, as floats.
        shape: Whether the surface is aspheric, and its grooves.
        adaptive: See `TraceSettings`.

    Returns:
        Rays, way and fate (as floats).
    """
    at, lead = to_plane(rays)
    aspheric, groove = shape
    met = None if groove is None else meet_grooves(p, at, groove, adaptive=adaptive)
    if met is not None:
        hit = met.hit
    else:
        hit = meet_asphere(p, at, adaptive=adaptive) if aspheric else meet_conic(p, at)
    bent, square = _bend(p, at, hit)
    way = lead + hit.way
    transmits, onward = Bound(square, TINY), Bound(bent.n, MIN_COSINE)
    bounds = [*hit.exists, transmits, onward, *([hit.converged] if hit.converged else [])]
    losses = _GrooveLosses()
    if groove is not None and met is not None and met.wall is not None:
        losses = _GrooveLosses(met.wall, meets_again(p, met, bent, groove, adaptive=adaptive))
    inside = adaptive and bool(hit.rho.amax() <= p.reach.amin()) and not losses.any()
    if inside and all(bound.all() for bound in bounds):
        return rest(bent, fate, adaptive=True), way, fate
    fate = torch.where(fate == 0, _judge(p, hit, (transmits, onward), losses), fate)
    return rest(bent, fate, adaptive=adaptive), way, fate


def _bend(p: Numbers, at: State, hit: Meeting) -> tuple[State, Tensor]:
    """Refract rays where they met a surface; return them and the square of N.d' (> 0 if any)."""
    # N.d and the length of N give the refracted direction ratio d + bend N (Snell)
    along_x, along_y, lift = at.l * p.ratio, at.m * p.ratio, at.n * p.ratio
    if p.phase is None:
        square = torch.addcmul(hit.length2 * p.rest2, hit.facing2, p.ratio2)
        facing = hit.facing * p.ratio
    else:
        phase = phase_value(p.phase, p.phase_terms, hit.x, hit.y)
        push = p.order / p.after
        along_x, along_y = along_x + push * phase.x, along_y + push * phase.y
        turned = push * hit.lean * torch.addcmul(hit.x * phase.x, hit.y, phase.y)
        facing = hit.facing * p.ratio - turned
        rest2 = 1 - torch.addcmul(along_x * along_x, along_y, along_y) - lift * lift
        square = torch.addcmul(hit.length2 * rest2, facing, facing)
    root = torch.sqrt(square.clamp_min(TINY))
    bend = (root - facing) / hit.length2
    turn = bend * hit.lean
    n = lift + bend if hit.normal_z is None else torch.addcmul(lift, bend, hit.normal_z)
    bent = State(
        x=hit.x,
        y=hit.y,
        z=hit.z,
        l=torch.addcmul(along_x, turn, hit.x, value=-1),
        m=torch.addcmul(along_y, turn, hit.y, value=-1),
        n=n,
    )
    return bent, square


class _GrooveLosses(NamedTuple):
    """The rays that a groove took: at its wall, or by being met again; None for none."""

    wall: Tensor | None = None
    second_hit: Tensor | None = None

    def any(self) -> bool:
        """Return whether it took one."""
        return any(mask is not None and bool(mask.any()) for mask in self)


def _judge(p: Numbers, hit: Meeting, bends: tuple[Bound, Bound], losses: _GrooveLosses) -> Tensor:
    """Return the first thing that is wrong with each ray, in the order of the light, as floats.

    Args:
        p: The surface.
        hit: Where they met it.
        bends: That a ray is refracted, and that it goes on.
        losses: To grooves.
    """
    transmits, onward = bends
    new = torch.zeros_like(hit.x)
    if losses.second_hit is not None:
        new = torch.where(losses.second_hit, SECOND_HIT, new)
    new = torch.where(onward.value > onward.least, new, MISSED)
    new = torch.where(transmits.value > transmits.least, new, TOTAL_REFLECTION)
    if losses.wall is not None:
        new = torch.where(losses.wall, GROOVE_WALL, new)
    new = torch.where(hit.rho <= p.reach, new, VIGNETTED)
    if hit.converged is not None:
        new = torch.where(hit.converged.value > hit.converged.least, new, NOT_CONVERGED)
    for bound in hit.exists:
        new = torch.where(bound.value > bound.least, new, MISSED)
    return new
