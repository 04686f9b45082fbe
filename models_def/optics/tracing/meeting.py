"""Intersection of rays with a surface: the conic in closed form, the asphere by Newton's method.

Positions are relative to the vertex of the surface. Nothing here branches on a ray, so that
`torch.compile` can fuse a whole lens into one loop; only the number of Newton steps follows the
data, and only where it may.
"""

from typing import Final, NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.phase_polynomial import PhaseForm
from camkit.models_def.optics.tracing.profile import TINY, profile
from camkit.models_def.optics.tracing.series import Series, series_part

MIN_COSINE: Final = 1e-6
MIN_SLOPE: Final = 1e-9
MAX_NEWTON_STEPS: Final = 10
FIXED_NEWTON_STEPS: Final = 3
# beyond this a power series means nothing, and r^16 overflows in float32
MAX_RHO_MM2: Final = {torch.float32: 1e6, torch.float64: 1e12}
# |gap| to stop at, and to accept, in mm: far below a wavelength; float32 rounds sags at 1e-6
NEWTON_STOP_MM: Final = {torch.float32: 2e-6, torch.float64: 1e-12}
NEWTON_TOLERANCE_MM: Final = {torch.float32: 5e-5, torch.float64: 1e-7}


_NO_ORDER: Final = torch.zeros(())


class State(NamedTuple):
    """Rays at a surface: position, direction."""

    x: Tensor
    y: Tensor
    z: Tensor
    l: Tensor  # noqa: E741
    m: Tensor
    n: Tensor


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
    series: Series | None = None  # of a polynomial part that is no plain even one
    odd: tuple[Tensor, ...] = ()
    phase: PhaseForm | None = None
    phase_terms: tuple[Tensor, ...] = ()
    order: Tensor = _NO_ORDER  # mm of path per radian of phase


def to_plane(state: State) -> tuple[State, Tensor]:
    """Trace rays to the plane z = 0; return them and the way."""
    back = state.z / state.n
    x = torch.addcmul(state.x, back, state.l, value=-1)
    y = torch.addcmul(state.y, back, state.m, value=-1)
    return state._replace(x=x, y=y, z=torch.zeros_like(x)), -back


class Bound(NamedTuple):
    """A condition on rays: value > least."""

    value: Tensor
    least: float

    def all(self) -> bool:
        """Return whether every ray meets it (NaN does not); far quicker than a mask."""
        return bool(self.value.amin() > self.least)


class Meeting(NamedTuple):
    """Rays on a surface, before refraction.

    The normal is N = (-lean x, -lean y, normal_z), where None is 1; `length2` = N.N, `facing` N.d,
    `facing2` its square. There is an intersection where all of `exists` holds, and it was found
    where `converged` does.
    """

    x: Tensor
    y: Tensor
    z: Tensor
    rho: Tensor
    way: Tensor
    lean: Tensor
    normal_z: Tensor | None
    length2: Tensor
    facing: Tensor
    facing2: Tensor
    exists: list[Bound]
    converged: Bound | None


def meet_conic(p: Numbers, at: State) -> Meeting:
    """Return the points at which rays meet a surface without a polynomial part."""
    way, exists, root, square = _conic_way(p, at)
    x, y = torch.addcmul(at.x, way, at.l), torch.addcmul(at.y, way, at.m)
    z = way * at.n
    rho = torch.addcmul(x * x, y, y)
    normal_z = 1 - z * p.kc
    return Meeting(
        x=x,
        y=y,
        z=z,
        rho=rho,
        way=way,
        lean=p.c,
        normal_z=normal_z,
        length2=1 - rho * p.pinch,
        facing=root,
        facing2=square,
        exists=[*exists, Bound(normal_z, MIN_SLOPE)],
        converged=None,
    )


def _conic_way(p: Numbers, at: State) -> tuple[Tensor, list[Bound], Tensor, Tensor]:
    """Return the way to the conic, what must hold, N.d and its square.

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


class Heights(NamedTuple):
    """A profile at rho = r^2: height h, q = 2 dh/d rho, S^2 of the conic (it ends at 0)."""

    height: Tensor
    lean: Tensor
    square: Tensor


def heights(p: Numbers, rho: Tensor) -> Heights:
    """Return the profile of a surface; finite everywhere."""
    near = rho.clamp_max(MAX_RHO_MM2[rho.dtype])
    square = 1 - near * p.opening
    root = square.clamp_min(TINY).sqrt()
    if p.series is None:
        height, lean = profile(p.c, root, p.terms, p.slopes, near)
        return Heights(height, lean, square)
    height, lean = profile(p.c, root, (), (), near)
    part = series_part(p.series, p.terms, p.odd, (p.opening, 1 / root), near)
    return Heights(height + part.height, lean + part.lean, square)


def meet_asphere(p: Numbers, at: State, *, adaptive: bool, drop: Tensor | None = None) -> Meeting:
    """Return the points at which rays meet a surface, by Newton's method.

    It starts from the conic (Sun 2021, eq. (6.6)), from the plane where that is missed.

    Args:
        p: The surface.
        at: The rays.
        adaptive: Whether steps end when every ray has converged.
        drop: The surface is z = h - drop, and Newton starts from the plane; None for z = h.
    """
    way = torch.zeros_like(at.x) if drop is not None else _conic_start(p, at, adaptive=adaptive)
    stop_mm = NEWTON_STOP_MM[way.dtype]
    steps = MAX_NEWTON_STEPS if adaptive else FIXED_NEWTON_STEPS
    for step in range(steps + 1):
        x, y = torch.addcmul(at.x, way, at.l), torch.addcmul(at.y, way, at.m)
        z = way * at.n
        rho = torch.addcmul(x * x, y, y)
        height, lean, square = heights(p, rho)
        gap = height - z if drop is None else height - drop - z
        facing = at.n - torch.addcmul(x * at.l, y, at.m) * lean
        if step == steps or (adaptive and bool(gap.abs().amax() <= stop_mm)):
            break
        if not (adaptive and bool(facing.amin() > MIN_COSINE)):
            facing = torch.where(facing.abs() > MIN_COSINE, facing, 1.0)
        way = torch.nan_to_num(way + gap / facing, nan=0.0, posinf=0.0, neginf=0.0)
    length2 = 1 + lean * lean * rho
    facing2 = facing * facing
    cosine2 = facing2 / length2
    inside = MAX_RHO_MM2[rho.dtype] - rho
    exists = [Bound(square, TINY), Bound(inside, 0), Bound(facing, 0), Bound(cosine2, TINY)]
    return Meeting(
        x=x,
        y=y,
        z=z,
        rho=rho,
        way=way,
        lean=lean,
        normal_z=None,
        length2=length2,
        facing=facing,
        facing2=facing2,
        exists=exists,
        converged=Bound(-gap.abs(), -NEWTON_TOLERANCE_MM[way.dtype]),
    )


def _conic_start(p: Numbers, at: State, *, adaptive: bool) -> Tensor:
    way, usable, _, _ = _conic_way(p, at)
    if not (adaptive and all(bound.all() for bound in usable)):
        for bound in usable:
            way = torch.where(bound.value > bound.least, way, 0.0)
    return way
