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

from camkit.models_def.optics.tracing.profile import TINY, profile

MISSED: Final = 1
TOTAL_REFLECTION: Final = 2
VIGNETTED: Final = 3
NOT_CONVERGED: Final = 4

MIN_COSINE: Final = 1e-6
MIN_SLOPE: Final = 1e-9
MAX_NEWTON_STEPS: Final = 10
FIXED_NEWTON_STEPS: Final = 3
# beyond this a power series means nothing, and r^16 overflows in float32
MAX_RHO_MM2: Final = 1e6
# |gap| to stop at, and to accept, in mm: far below a wavelength; float32 rounds sags at 1e-6
NEWTON_STOP_MM: Final = {torch.float32: 2e-6, torch.float64: 1e-12}
NEWTON_TOLERANCE_MM: Final = {torch.float32: 5e-5, torch.float64: 1e-7}


class State(NamedTuple):
    """Rays at a surface: position, direction."""

    x: Tensor
    y: Tensor
    z: Tensor
    l: Tensor  # noqa: E741
    m: Tensor
    n: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class TraceSettings:
    """What is static about a trace.

    Attributes:
        aspheric: Which surfaces have a polynomial part.
        path: Whether the optical path is summed.
        adaptive: Whether Newton steps end when every ray has converged.
    """

    aspheric: tuple[bool, ...]
    path: bool
    adaptive: bool = True


class Numbers(NamedTuple):
    """The numbers of one surface, each broadcasting against the rays."""

    c: Tensor
    k: Tensor
    ck: Tensor  # c k
    kc: Tensor  # (1 + k) c
    opening: Tensor  # (1 + k) c^2
    pinch: Tensor  # k c^2
    terms: tuple[Tensor, ...]
    slopes: tuple[Tensor, ...]
    reach: Tensor  # largest rho
    gap: Tensor  # to the next vertex, mm
    before: Tensor  # refractive indices
    after: Tensor
    ratio: Tensor  # before / after
    ratio2: Tensor
    rest2: Tensor  # 1 - ratio^2


class LensTensors(NamedTuple):
    """The tensors of a lens: first dimension surface (see `trace.SurfaceTensors`)."""

    curvature: Tensor
    conic: Tensor
    even_asphere: Tensor
    thickness: Tensor
    semi_diameter: Tensor
    indices: Tensor


def numbers(lens: LensTensors) -> list[Numbers]:
    """Give the numbers of every surface, computed for all surfaces at once."""
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
    return [
        Numbers(*head, tuple(a), tuple(b), *tail)  # type: ignore[call-arg]
        for head, a, b, tail in zip(heads, terms, bends, tails, strict=True)
    ]


class Kept(NamedTuple):
    """What the adjoint needs of a trace: the last fate, rays on each surface and their fates."""

    fate: Tensor
    seen: list[State]
    fates: list[Tensor]


class Result(NamedTuple):
    """What a trace gives."""

    end: State
    path: Tensor | None
    kept: Kept


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
    seen: list[State] = []
    fates: list[Tensor] = []
    for p, aspheric in zip(lens, settings.aspheric, strict=True):
        state, way, now = cross(p, state, fate, aspheric=aspheric, adaptive=settings.adaptive)
        code, fate = code if now is fate else now.to(torch.int8), now
        path = None if path is None else path + p.before * way
        seen.append(state)
        fates.append(code)
        state = state._replace(z=state.z - p.gap)
    state, way = to_plane(state)
    path = None if path is None else path + lens[-1].after * way
    return Result(state, path, Kept(code, seen, fates))


def rest(state: State, fate: Tensor, *, adaptive: bool, n: float = 1.0) -> State:
    """Put lost rays on the axis, at the vertex (or their gradients to zero, with `n` = 0)."""
    if adaptive and not bool(fate.any()):
        return state
    alive = fate == 0
    places = zip(state, (0.0, 0.0, 0.0, 0.0, 0.0, n), strict=True)
    return State(*(torch.where(alive, value, at) for value, at in places))


def to_plane(state: State) -> tuple[State, Tensor]:
    """Carry rays to the plane z = 0; give them and the way."""
    back = state.z / state.n
    x = torch.addcmul(state.x, back, state.l, value=-1)
    y = torch.addcmul(state.y, back, state.m, value=-1)
    return state._replace(x=x, y=y, z=torch.zeros_like(x)), -back


class Bound(NamedTuple):
    """A condition on rays: value > least."""

    value: Tensor
    least: float

    def all(self) -> bool:
        """Tell whether every ray meets it (NaN does not); far quicker than a mask."""
        return bool(self.value.amin() > self.least)


class Meeting(NamedTuple):
    """Rays on a surface, before refraction.

    The normal is N = (-lean x, -lean y, up), up = 1 if None; `length2` = N.N, `facing` = N.d,
    `facing2` its square. There is an intersection where all of `exists` holds, and it was found
    where `found` does.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    rho: Tensor
    way: Tensor
    lean: Tensor
    up: Tensor | None
    length2: Tensor
    facing: Tensor
    facing2: Tensor
    exists: list[Bound]
    found: Bound | None


def cross(
    p: Numbers, rays: State, fate: Tensor, *, aspheric: bool, adaptive: bool
) -> tuple[State, Tensor, Tensor]:
    """Carry rays onto a surface and refract them; give rays, way and fate (as floats)."""
    at, lead = to_plane(rays)
    hit = _meet_asphere(p, at, adaptive=adaptive) if aspheric else _meet_conic(p, at)
    # N.d and the length of N give the refracted direction ratio d + bend N (Snell)
    square = torch.addcmul(hit.length2 * p.rest2, hit.facing2, p.ratio2)
    root = torch.sqrt(square.clamp_min(TINY))
    bend = (root - hit.facing * p.ratio) / hit.length2
    turn = bend * hit.lean
    lift = at.n * p.ratio
    n = lift + bend if hit.up is None else torch.addcmul(lift, bend, hit.up)
    bent = State(
        x=hit.x,
        y=hit.y,
        z=hit.z,
        l=torch.addcmul(at.l * p.ratio, turn, hit.x, value=-1),
        m=torch.addcmul(at.m * p.ratio, turn, hit.y, value=-1),
        n=n,
    )
    way = lead + hit.way
    transmits, onward = Bound(square, TINY), Bound(n, MIN_COSINE)
    bounds = [*hit.exists, transmits, onward, *([hit.found] if hit.found else [])]
    inside = adaptive and bool(hit.rho.amax() <= p.reach.amin())
    if inside and all(bound.all() for bound in bounds):
        return rest(bent, fate, adaptive=True), way, fate
    fate = torch.where(fate == 0, _judge(p, hit, transmits, onward), fate)
    return rest(bent, fate, adaptive=adaptive), way, fate


def _judge(p: Numbers, hit: Meeting, transmits: Bound, onward: Bound) -> Tensor:
    """Give the first thing that is wrong with each ray, in the order of the light, as floats."""
    new = (~(onward.value > onward.least)).to(hit.x.dtype) * MISSED
    new = torch.where(transmits.value > transmits.least, new, TOTAL_REFLECTION)
    new = torch.where(hit.rho <= p.reach, new, VIGNETTED)
    if hit.found is not None:
        new = torch.where(hit.found.value > hit.found.least, new, NOT_CONVERGED)
    for bound in hit.exists:
        new = torch.where(bound.value > bound.least, new, MISSED)
    return new


def _meet_conic(p: Numbers, at: State) -> Meeting:
    way, exists, root, square = _conic_way(p, at)
    x, y = torch.addcmul(at.x, way, at.l), torch.addcmul(at.y, way, at.m)
    z = way * at.n
    rho = torch.addcmul(x * x, y, y)
    up = 1 - z * p.kc
    return Meeting(
        x=x,
        y=y,
        z=z,
        rho=rho,
        way=way,
        lean=p.c,
        up=up,
        length2=1 - rho * p.pinch,
        facing=root,
        facing2=square,
        exists=[*exists, Bound(up, MIN_SLOPE)],
        found=None,
    )


def _conic_way(p: Numbers, at: State) -> tuple[Tensor, list[Bound], Tensor, Tensor]:
    """Give the way to the conic, what must hold, N.d and its square.

    The way is the root of a s^2 - 2 b s + g next to the vertex. With the normal
    (-c x, -c y, 1 - (1 + k) c z) the discriminant is the square of N.d.
    """
    a = at.n * at.n * p.ck + p.c
    b = at.n - torch.addcmul(at.x * at.l, at.y, at.m) * p.c
    g = torch.addcmul(at.x * at.x, at.y, at.y) * p.c
    square = torch.addcmul(b * b, a, g, value=-1)
    root = torch.sqrt(square.clamp_min(TINY))
    sum_ = b + root
    return g / sum_, [Bound(square, TINY), Bound(sum_, MIN_SLOPE)], root, square


def _meet_asphere(p: Numbers, at: State, *, adaptive: bool) -> Meeting:
    """Newton's method from the conic (Sun 2021, eq. (6.6)); from the plane where it is missed."""
    way, usable, _, _ = _conic_way(p, at)
    if not (adaptive and all(bound.all() for bound in usable)):
        for bound in usable:
            way = torch.where(bound.value > bound.least, way, 0.0)
    stop_mm = NEWTON_STOP_MM[way.dtype]
    steps = MAX_NEWTON_STEPS if adaptive else FIXED_NEWTON_STEPS
    for step in range(steps + 1):
        x, y = torch.addcmul(at.x, way, at.l), torch.addcmul(at.y, way, at.m)
        z = way * at.n
        rho = torch.addcmul(x * x, y, y)
        near = rho.clamp_max(MAX_RHO_MM2)
        square = 1 - near * p.opening
        height, lean = profile(p.c, square.clamp_min(TINY).sqrt(), p.terms, p.slopes, near)
        gap = height - z
        facing = at.n - torch.addcmul(x * at.l, y, at.m) * lean
        if step == steps or (adaptive and bool(gap.abs().amax() <= stop_mm)):
            break
        if not (adaptive and bool(facing.amin() > MIN_COSINE)):
            facing = torch.where(facing.abs() > MIN_COSINE, facing, 1.0)
        way = torch.nan_to_num(way + gap / facing, nan=0.0, posinf=0.0, neginf=0.0)
    length2 = 1 + lean * lean * rho
    facing2 = facing * facing
    cosine2 = facing2 / length2
    inside = MAX_RHO_MM2 - rho
    exists = [Bound(square, TINY), Bound(inside, 0), Bound(facing, 0), Bound(cosine2, TINY)]
    return Meeting(
        x=x,
        y=y,
        z=z,
        rho=rho,
        way=way,
        lean=lean,
        up=None,
        length2=length2,
        facing=facing,
        facing2=facing2,
        exists=exists,
        found=Bound(-gap.abs(), -NEWTON_TOLERANCE_MM[way.dtype]),
    )
