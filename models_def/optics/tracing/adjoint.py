"""The gradients of a trace by its adjoint, surface by surface from the last to the first.

At the intersection the implicit function theorem holds: for a hit P = P0 + s d on the surface
z = h(rho; p) with normal N = (-q x, -q y, 1), N.dP = h_p dp, hence
ds = (h_p dp - N.(dP0 + s dd)) / N.d. So the gradient needs only where a ray met the surface, not
how it was found: no graph of Newton steps, six numbers per ray and surface. P0 is the previous
hit, which makes s the length of the whole way and the optical path a sum of n s.

Refraction is d' = ratio d + bend N, bend = (T - ratio D) / N.N, with D = N.d and T = N.d'
(ratio = n / n', T^2 = (1 - ratio^2) N.N + ratio^2 D^2).
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.gradient_parts import (
    Gather,
    GradientNeeds,
    Gradients,
    Slopes,
)
from camkit.models_def.optics.tracing.kernel import RayRecord, TraceSettings, rest
from camkit.models_def.optics.tracing.meeting import Numbers, State
from camkit.models_def.optics.tracing.phase_polynomial import (
    PhaseForm,
    phase_terms,
    phase_turn,
    phase_value,
)
from camkit.models_def.optics.tracing.profile import TINY, polynomial
from camkit.models_def.optics.tracing.series import (
    Series,
    opening_slopes,
    series_part,
    term_slopes,
)

_WILD: Final = {torch.float32: 1e15, torch.float64: 1e100}
"""The largest derivative by a place or direction that is still followed."""


class _Shape(NamedTuple):
    """A surface where rays meet it: rho, root S, 1 / S, q = 2 dh/d rho, N.N."""

    rho: Tensor
    root: Tensor
    inverse: Tensor
    lean: Tensor
    length2: Tensor


class _Bent(NamedTuple):
    """The adjoint of refraction: of the hit (x, y, z), q, d (through N.d), and the ratio."""

    x: Tensor
    y: Tensor
    z: Tensor
    lean: Tensor
    facing: Tensor
    slope_facing: Tensor
    ratio: Tensor | None


def pull_back(
    settings: TraceSettings,
    needs: GradientNeeds,
    lens: Sequence[Numbers],
    launched: State,
    record: RayRecord,
    slopes: Slopes,
    gather: Gather,
) -> Gradients:
    """Return the gradients of a trace.

    Args:
        settings: As the trace had it.
        needs: What to compute.
        lens: As the trace had it.
        launched: As the trace had them (lost ones at rest).
        record: Of the trace.
        slopes: Of the loss by what the trace gave.
        gather: Sums a per-ray derivative to the shape of the number it belongs to.
    """
    zero = torch.zeros_like(lens[-1].after)
    total = Gradients(launched, [], [], [], [], [zero], [], [])
    g = rest(slopes.end, record.fate, adaptive=settings.adaptive, n=0.0)
    path = None if slopes.path is None else torch.where(record.fate == 0, slopes.path, 0.0)
    g = _leave_plane(needs, lens[-1], record.states[-1], g, path, total, gather)
    for i in reversed(range(len(lens))):
        p, hit, extra = lens[i], record.states[i], slopes.states[i]
        if extra is not None:
            extra = rest(extra, record.fates[i], adaptive=settings.adaptive, n=0.0)
            g = State(*(a + b for a, b in zip(g, extra, strict=True)))
        incoming = launched
        if i:
            last = record.states[i - 1]
            incoming = last._replace(z=last.z - lens[i - 1].gap)
        shape = _shape(p, hit, aspheric=settings.aspheric[i])
        if p.phase is None:
            bent = _refraction(p, shape, incoming, hit, g, with_ratio=needs.index)
            if needs.phase:
                total.phase.append([torch.zeros_like(v) for v in p.phase_terms])
        else:
            rays = (shape, incoming, hit)
            bent, g = _phase_refraction(p, p.phase, needs, rays, g, path, total, gather)
        way = (hit.z - incoming.z) / incoming.n
        push = torch.addcmul(bent.x * incoming.l, bent.y, incoming.m)
        push = torch.addcmul(push, bent.z, incoming.n)
        push = push if path is None else push + path * p.before
        push = push / bent.facing
        shape, bent, push, g = _tamed(shape, bent, push, g)
        aspheric = settings.aspheric[i]
        _collect(p, needs, shape, bent, push, total, gather, aspheric=aspheric)
        if needs.index:
            _collect_index(p, bent, None if path is None else path * way, total, gather)
        if i or needs.rays:
            g = _incoming_slopes(p, g, shape, bent, push, way, hit)
        if i and needs.thickness:
            total.thickness.append(gather(-g.z, lens[i - 1].gap))
    return Gradients(
        g if needs.rays else None,
        total.curvature[::-1],
        total.conic[::-1],
        total.even_asphere[::-1],
        total.thickness[::-1],
        total.indices[::-1],
        total.odd_asphere[::-1],
        total.phase[::-1],
    )


def _tamed(
    shape: _Shape, bent: _Bent, push: Tensor, g: State
) -> tuple[_Shape, _Bent, Tensor, State]:
    """Drop rays whose derivatives exceed the range of their numbers.

    A lens far from any that forms an image can multiply a derivative by 1e9 at every surface; in
    single precision it becomes infinite, and infinity minus infinity is no number.
    """
    cube = shape.inverse * shape.inverse * shape.inverse
    size = (push.abs() + (bent.lean * cube).abs()) * (1 + shape.rho)
    size = size + bent.x.abs() + bent.y.abs() + bent.z.abs() + bent.slope_facing.abs()
    size = size if bent.ratio is None else size + bent.ratio.abs()
    calm = size < _WILD[push.dtype]  # false for what is no number
    if not torch.compiler.is_compiling() and bool(calm.all()):
        return shape, bent, push, g

    def tame(value: Tensor, instead: float = 0.0) -> Tensor:
        return torch.where(calm, value, instead)

    return (
        _Shape(
            rho=tame(shape.rho),
            root=tame(shape.root, 1.0),
            inverse=tame(shape.inverse, 1.0),
            lean=tame(shape.lean),
            length2=tame(shape.length2, 1.0),
        ),
        _Bent(
            x=tame(bent.x),
            y=tame(bent.y),
            z=tame(bent.z),
            lean=tame(bent.lean),
            facing=bent.facing,
            slope_facing=tame(bent.slope_facing),
            ratio=None if bent.ratio is None else tame(bent.ratio),
        ),
        tame(push),
        State(*(tame(part) for part in g)),
    )


def _leave_plane(
    needs: GradientNeeds,
    p: Numbers,
    hit: State,
    g: State,
    path: Tensor | None,
    total: Gradients,
    gather: Gather,
) -> State:
    back = (hit.z - p.gap) / hit.n
    slope = torch.addcmul(g.x * hit.l, g.y, hit.m)
    if path is not None:
        slope = slope + path * p.after
        if needs.index:
            total.indices[0] = total.indices[0] - gather(path * back, p.after)
    slope = slope / hit.n
    if needs.thickness:
        total.thickness.append(gather(slope, p.gap))
    return State(
        x=g.x,
        y=g.y,
        z=-slope,
        l=torch.addcmul(g.l, back, g.x, value=-1),
        m=torch.addcmul(g.m, back, g.y, value=-1),
        n=torch.addcmul(g.n, back, slope),
    )


def _shape(p: Numbers, hit: State, *, aspheric: bool) -> _Shape:
    rho = torch.addcmul(hit.x * hit.x, hit.y, hit.y)
    root = (1 - rho * p.opening).clamp_min(TINY).sqrt() if aspheric else 1 - hit.z * p.kc
    inverse = torch.reciprocal(root)
    lean = inverse * p.c
    if p.series is not None:
        lean = lean + series_part(p.series, p.terms, p.odd, (p.opening, inverse), rho).lean
    elif aspheric and p.slopes:
        lean = lean + polynomial(p.slopes, rho)
    return _Shape(rho, root, inverse, lean, 1 + lean * lean * rho)


def _refraction(
    p: Numbers, shape: _Shape, incoming: State, hit: State, g: State, *, with_ratio: bool
) -> _Bent:
    lean, length2 = shape.lean, shape.length2
    facing = incoming.n - torch.addcmul(hit.x * incoming.l, hit.y, incoming.m) * lean
    leaving = hit.n - torch.addcmul(hit.x * hit.l, hit.y, hit.m) * lean
    bend = (leaving - facing * p.ratio) / length2
    pull = (g.n - torch.addcmul(g.l * hit.x, g.m, hit.y) * lean) / length2
    slope_facing = -bend * pull * length2 * p.ratio / leaving
    slope_length2 = pull * (p.rest2 / leaving - 2 * bend)
    shear = slope_length2 * lean
    # slopes by the first two parts of the normal (-q x, -q y, 1)
    normal_x = torch.addcmul(bend * g.l, slope_facing, incoming.l)
    normal_x = torch.addcmul(normal_x, shear, hit.x, value=-1)
    normal_y = torch.addcmul(bend * g.m, slope_facing, incoming.m)
    normal_y = torch.addcmul(normal_y, shear, hit.y, value=-1)
    slope_lean = -torch.addcmul(normal_x * hit.x, normal_y, hit.y)
    twist = slope_lean * _lean_slope(p, shape) * 2
    ratio = None
    if with_ratio:
        projection = torch.addcmul(g.l * incoming.l, g.m, incoming.m)
        projection = torch.addcmul(projection, g.n, incoming.n)
        ratio = projection - pull * (facing + (length2 - facing * facing) * p.ratio / leaving)
    return _Bent(
        x=g.x + twist * hit.x - lean * normal_x,
        y=g.y + twist * hit.y - lean * normal_y,
        z=g.z,
        lean=slope_lean,
        facing=facing,
        slope_facing=slope_facing,
        ratio=ratio,
    )


def _phase_refraction(
    p: Numbers,
    form: PhaseForm,
    needs: GradientNeeds,
    rays: tuple[_Shape, State, State],
    g: State,
    path: Tensor | None,
    total: Gradients,
    gather: Gather,
) -> tuple[_Bent, State]:
    """Return the adjoint of refraction at a surface with a phase, and the slopes by w (`phase`).

    With pull P = g.N / N.N and the direction d' behind: by w it is W = g - P (N.N / T) d', by N it
    is bend g - P bend (N.N / T) w + P ((1 - w.w) / T - 2 bend) N.
    """
    shape, incoming, hit = rays
    lean, length2 = shape.lean, shape.length2
    phase = phase_value(form, p.phase_terms, hit.x, hit.y)
    turn = phase_turn(form, p.phase_terms, hit.x, hit.y)
    push = p.order / p.after
    wx = torch.addcmul(incoming.l * p.ratio, push, phase.x)
    wy = torch.addcmul(incoming.m * p.ratio, push, phase.y)
    wz = incoming.n * p.ratio
    facing = incoming.n - torch.addcmul(hit.x * incoming.l, hit.y, incoming.m) * lean
    leaving = hit.n - torch.addcmul(hit.x * hit.l, hit.y, hit.m) * lean
    bend = (leaving - wz + torch.addcmul(hit.x * wx, hit.y, wy) * lean) / length2
    pull = (g.n - torch.addcmul(g.l * hit.x, g.m, hit.y) * lean) / length2
    share = pull * length2 / leaving
    by_w = State(g.x, g.y, g.z, g.l - share * hit.l, g.m - share * hit.m, g.n - share * hit.n)
    rest2 = 1 - wx * wx - wy * wy - wz * wz
    shear = pull * (rest2 / leaving - 2 * bend) * lean
    normal_x = bend * (g.l - share * wx) - shear * hit.x
    normal_y = bend * (g.m - share * wy) - shear * hit.y
    slope_lean = -torch.addcmul(normal_x * hit.x, normal_y, hit.y)
    twist = slope_lean * _lean_slope(p, shape) * 2
    by_x, by_y = push * by_w.l, push * by_w.m  # by the slopes of the phase
    x = g.x + twist * hit.x - lean * normal_x + by_x * turn.xx + by_y * turn.xy
    y = g.y + twist * hit.y - lean * normal_y + by_x * turn.xy + by_y * turn.yy
    if path is not None:
        x, y = x + path * p.order * phase.x, y + path * p.order * phase.y
    ratio = None
    if needs.index:
        ratio = by_w.l * incoming.l + by_w.m * incoming.m + by_w.n * incoming.n
        strength = gather(by_x * phase.x + by_y * phase.y, p.after) / p.after
        total.indices[-1] = total.indices[-1] - strength
    if needs.phase:
        _collect_phase(p, form, hit, (by_x, by_y, path), total, gather)
    bent = _Bent(
        x=x,
        y=y,
        z=g.z,
        lean=slope_lean,
        facing=facing,
        slope_facing=torch.zeros_like(facing),
        ratio=ratio,
    )
    return bent, by_w


def _collect_phase(
    p: Numbers,
    form: PhaseForm,
    hit: State,
    slopes: tuple[Tensor, Tensor, Tensor | None],
    total: Gradients,
    gather: Gather,
) -> None:
    """Add the slopes by the coefficients of a phase, from those by its gradient and the path."""
    by_x, by_y, path = slopes
    sums = []
    for row, term in zip(phase_terms(form, hit.x, hit.y), p.phase_terms, strict=False):
        slope = by_x * row.x + by_y * row.y
        slope = slope if path is None else slope + path * p.order * row.value
        sums.append(gather(slope, term))
    sums += [torch.zeros_like(v) for v in p.phase_terms[len(sums) :]]
    total.phase.append(sums)


def _lean_slope(p: Numbers, shape: _Shape) -> Tensor:
    """Return dq / d rho."""
    cube = shape.inverse * shape.inverse * shape.inverse
    slope = cube * (p.opening * p.c / 2)
    if p.series is not None:
        conic = (p.opening, shape.inverse)
        twist = series_part(p.series, p.terms, p.odd, conic, shape.rho, twist=True).twist
        return slope if twist is None else slope + twist
    bends = [a * j for j, a in enumerate(p.slopes)][1:]
    return slope + polynomial(bends, shape.rho) if bends else slope


def _incoming_slopes(
    p: Numbers,
    g: State,
    shape: _Shape,
    bent: _Bent,
    push: Tensor,
    way: Tensor,
    hit: State,
) -> State:
    tilt = push * shape.lean
    x, y, z = bent.x + tilt * hit.x, bent.y + tilt * hit.y, bent.z - push
    swing = bent.slope_facing * shape.lean
    l = torch.addcmul(g.l * p.ratio, way, x)  # noqa: E741
    m = torch.addcmul(g.m * p.ratio, way, y)
    n = torch.addcmul(g.n * p.ratio, way, z)
    return State(
        x=x,
        y=y,
        z=z,
        l=torch.addcmul(l, swing, hit.x, value=-1),
        m=torch.addcmul(m, swing, hit.y, value=-1),
        n=n + bent.slope_facing,
    )


def _collect(
    p: Numbers,
    needs: GradientNeeds,
    shape: _Shape,
    bent: _Bent,
    push: Tensor,
    total: Gradients,
    gather: Gather,
    *,
    aspheric: bool,
) -> None:
    """Add the slopes by curvature, conic and polynomial: push h_p + slope_lean q_p."""
    inverse, rho = shape.inverse, shape.rho
    if needs.curvature or needs.conic:
        cube = bent.lean * inverse * inverse * inverse
        share = push * inverse / (1 + shape.root)
        more = _opening_slope(p, shape, bent, push)
        if needs.curvature:
            slope = torch.addcmul(cube, share, rho)
            slope = slope if more is None else slope + more * (2 * p.kc)
            total.curvature.append(gather(slope, p.c))
        if needs.conic:
            slope = (cube + share * rho / (1 + shape.root)) * rho * (p.c * p.c * p.c / 2)
            slope = slope if more is None else slope + more * (p.c * p.c)
            total.conic.append(gather(slope, p.k))
    if p.series is not None:
        _collect_series(p, p.series, needs, shape, bent, push, total, gather)
        return
    if needs.odd_asphere:
        total.odd_asphere.append([torch.zeros_like(v) for v in p.odd])
    if needs.even_asphere:
        row: list[Tensor] = []
        power = torch.ones_like(rho)
        for j, term in enumerate(p.terms, start=1):
            if aspheric:
                slope = power * torch.add(push * rho, bent.lean, alpha=2 * j)
                power = power * rho
            row.append(gather(slope, term) if aspheric else torch.zeros_like(term))
        total.even_asphere.append(row)


def _opening_slope(p: Numbers, shape: _Shape, bent: _Bent, push: Tensor) -> Tensor | None:
    """Return the slope by (1 + k) c^2 through a polynomial part that is divided by the root."""
    if p.series is None or not p.series.over_root:
        return None
    by_opening = opening_slopes(p.series, p.terms, (p.opening, shape.inverse), shape.rho)
    return push * by_opening.height + bent.lean * by_opening.lean


def _collect_series(
    p: Numbers,
    series: Series,
    needs: GradientNeeds,
    shape: _Shape,
    bent: _Bent,
    push: Tensor,
    total: Gradients,
    gather: Gather,
) -> None:
    count, conic = (len(p.terms), len(p.odd)), (p.opening, shape.inverse)
    even, odd = term_slopes(series, count, conic, shape.rho)
    both = (
        (needs.even_asphere, even, p.terms, total.even_asphere),
        (needs.odd_asphere, odd, p.odd, total.odd_asphere),
    )
    for flag, rows, terms, lists in both:
        if flag:
            slopes = [push * row.height + bent.lean * row.lean for row in rows]
            summed = [gather(s, v) for s, v in zip(slopes, terms, strict=False)]
            lists.append([*summed, *(torch.zeros_like(v) for v in terms[len(rows) :])])


def _collect_index(
    p: Numbers, bent: _Bent, longer: Tensor | None, total: Gradients, gather: Gather
) -> None:
    """Add the slopes by the indices on both sides: through their ratio and the path."""
    if bent.ratio is None:
        return
    slope = gather(bent.ratio, p.ratio) / p.after
    total.indices[-1] = total.indices[-1] - slope * p.ratio
    total.indices.append(slope if longer is None else slope + gather(longer, p.before))
