"""Rays through grooves: against a slow march through the relief, and closed forms."""

import math

import numpy as np
import pytest
import torch

from camkit.models_def.optics.grooves import Grooves, wall_radii_mm
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.reverse import reverse
from camkit.models_def.optics.trace import (
    Fate,
    Rays,
    SurfaceTensors,
    refract,
    surface_tensors,
    trace,
    without_walls,
)

DEPTH_MM = 0.1
RIM_MM = 8.0
MARCH_MM = 2e-4
INDEX = 1.5


def _surface(sign: int, **grooves: object) -> Surface:
    return Surface(
        curvature_per_mm=sign / 30,
        even_asphere=(0.0, sign * -5e-5),
        thickness_mm=5.0,
        semi_diameter_mm=RIM_MM,
        grooves=Grooves(depth_um=1000 * DEPTH_MM, **grooves),  # type: ignore[arg-type]
    )


def _tensors(sign: int, *, entering: bool, **grooves: object) -> SurfaceTensors:
    """Give one grooved surface into or out of a solid of index 1.5."""
    groove, glass = _surface(sign, **grooves), "model:1.5,1000"
    plane = Surface(curvature_per_mm=0.0, thickness_mm=5.0, glass=glass)
    surfaces = (
        (Surface(**{**_fields(groove), "glass": glass}), plane) if entering else (plane, groove)
    )
    lens = Lens(
        name="t",
        surfaces=surfaces,
        stop=0,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=10.0,
    )
    tensors = surface_tensors(lens, torch.tensor(0.5876, dtype=torch.float64))
    at = 0 if entering else 1
    cut = slice(at, at + 1)
    return SurfaceTensors(
        curvature_per_mm=tensors.curvature_per_mm[cut],
        conic=tensors.conic[cut],
        even_asphere=tensors.even_asphere[cut],
        thickness_mm=tensors.thickness_mm[cut],
        semi_diameter_mm=tensors.semi_diameter_mm[cut],
        index=torch.tensor([1.0, INDEX] if entering else [INDEX, 1.0], dtype=torch.float64),
        aspheric=(True,),
        grooves=tensors.grooves[cut],
    )


def _fields(surface: Surface) -> dict[str, object]:
    return {name: getattr(surface, name) for name in surface.__dataclass_fields__}


def _rays(count: int, *, steep: float, seed: int) -> Rays:
    rng = np.random.default_rng(seed)
    radius, angle = RIM_MM * 0.98 * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    lean, turn = steep * np.sqrt(rng.random(count)), 2 * np.pi * rng.random(count)
    l, m = lean * np.cos(turn), lean * np.sin(turn)  # noqa: E741

    def tensor(values: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(values)

    return Rays(
        x=tensor(radius * np.cos(angle)),
        y=tensor(radius * np.sin(angle)),
        z=torch.zeros(count, dtype=torch.float64),
        l=tensor(l),
        m=tensor(m),
        n=tensor(np.sqrt(1 - l**2 - m**2)),
        fate=torch.zeros(count, dtype=torch.int8),
    )


def _height(sign: int, radius: np.ndarray) -> np.ndarray:
    c = 1 / 30
    return np.asarray(
        sign * (c * radius**2 / (1 + np.sqrt(1 - c**2 * radius**2)) - 5e-5 * radius**4)
    )


def _march(sign: int, place: np.ndarray, direction: np.ndarray) -> tuple[int, np.ndarray]:
    """Walk through the relief until the medium changes.

    Returns 0 (left the relief), 1 (met a profile) or 2 (met a wall), and the place.
    """
    end = DEPTH_MM if sign > 0 else 0.0
    way = np.arange(1, 4 + (end - place[2]) / direction[2] / MARCH_MM) * MARCH_MM
    points = place[:, None] + way * direction[:, None]
    height = _height(sign, np.hypot(points[0], points[1]))
    ring = np.trunc(height / DEPTH_MM)
    behind = points[2] > height - ring * DEPTH_MM
    change = np.flatnonzero(behind[1:] != behind[:-1])
    if not len(change):
        return 0, points[:, -1]
    at = change[0] + 1
    return (2 if ring[at] != ring[at - 1] else 1), points[:, at]


def _slow_fate(sign: int, rays: Rays, i: int, indices: tuple[float, float]) -> Fate:
    """Give the fate of a ray by walking."""
    direction = np.array([float(rays.l[i]), float(rays.m[i]), float(rays.n[i])])
    place = np.array([float(rays.x[i]), float(rays.y[i]), 0.0])
    front = -0.02 if sign > 0 else -DEPTH_MM - 0.02
    place = place + direction * (front / direction[2])
    kind, hit = _march(sign, place, direction)
    if kind == 2:
        return Fate.GROOVE_WALL
    radius = float(np.hypot(hit[0], hit[1]))
    step = 1e-6
    slope = float(_height(sign, np.array([radius + step]))[0])
    slope = (slope - float(_height(sign, np.array([radius - step]))[0])) / (2 * step)
    normal = np.array([-slope * hit[0] / radius, -slope * hit[1] / radius, 1.0])
    normal /= np.linalg.norm(normal)
    ratio, facing = indices[0] / indices[1], float(direction @ normal)
    square = 1 - ratio**2 * (1 - facing**2)
    if square < 0:
        return Fate.TOTAL_REFLECTION
    bent = ratio * direction + (math.sqrt(square) - ratio * facing) * normal
    kind, _ = _march(sign, hit, bent)
    return Fate.SECOND_HIT if kind else Fate.VALID


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("entering", [True, False])
def test_fates_are_those_of_a_walk_through_the_relief(sign: int, entering: bool) -> None:
    """Of 1,500 rays, those near an edge by less than the walk's step may differ."""
    tensors = _tensors(sign, entering=entering)
    rays = _rays(1500, steep=0.5, seed=3)
    met = refract(tensors, rays, 0)
    indices = (float(tensors.index[0]), float(tensors.index[1]))
    slow = [_slow_fate(sign, rays, i, indices) for i in range(1500)]
    same = [int(met.fate[i]) == slow[i] for i in range(1500)]
    assert np.mean(same) > 0.99
    counted = {fate: slow.count(fate) for fate in (Fate.GROOVE_WALL, Fate.SECOND_HIT)}
    assert sum(counted.values()) > 20, counted


@pytest.mark.parametrize("sign", [1, -1])
def test_living_rays_lie_on_the_ring_that_is_there(sign: int) -> None:
    met = refract(_tensors(sign, entering=True), _rays(4000, steep=0.4, seed=1), 0)
    radius = torch.hypot(met.x, met.y)[met.valid].numpy()
    height = _height(sign, radius)
    cut = height - DEPTH_MM * np.trunc(height / DEPTH_MM)
    assert met.valid.float().mean() > 0.9
    assert np.allclose(met.z[met.valid].numpy(), cut, atol=1e-10)


def test_single_precision_gives_the_same_fates_but_at_edges() -> None:
    tensors, rays = _tensors(-1, entering=False), _rays(4000, steep=0.4, seed=8)
    single = Rays(
        **{n: getattr(rays, n).float() for n in ("x", "y", "z", "l", "m", "n")}, fate=rays.fate
    )
    found, wanted = refract(tensors.converted(torch.float32), single, 0), refract(tensors, rays, 0)
    assert (found.fate == wanted.fate).float().mean() > 0.998
    both = found.valid & wanted.valid & ((found.z - wanted.z).abs() < 1e-2)
    assert torch.allclose(found.z[both].double(), wanted.z[both], atol=1e-5)


def test_ideal_grooves_lose_no_ray_and_bend_by_the_slope_of_the_profile() -> None:
    tensors = without_walls(_tensors(1, entering=True))
    rays = _rays(2000, steep=0.4, seed=2)
    met = refract(tensors, rays, 0)
    assert bool(met.valid.all())
    ring = torch.trunc(
        torch.from_numpy(_height(1, np.hypot(rays.x.numpy(), rays.y.numpy()))) / DEPTH_MM
    )
    radius = np.hypot(met.x.numpy(), met.y.numpy())
    assert np.allclose(met.z.numpy(), _height(1, radius) - DEPTH_MM * ring.numpy(), atol=1e-10)
    step = 1e-5
    slope = (_height(1, radius + step) - _height(1, radius - step)) / (2 * step)
    normal = np.stack([-slope * met.x.numpy() / radius, -slope * met.y.numpy() / radius])
    normal = np.concatenate([normal, np.ones((1, len(radius)))])
    before = np.stack([rays.l.numpy(), rays.m.numpy(), rays.n.numpy()])
    after = np.stack([met.l.numpy(), met.m.numpy(), met.n.numpy()])
    # Snell: n d x N is the same on both sides
    left, right = np.cross(before.T, normal.T), INDEX * np.cross(after.T, normal.T)
    assert np.allclose(left, right, atol=1e-7)


def test_grooves_deeper_than_the_profile_change_nothing() -> None:
    """A groove of 100 mm never begins anew."""
    deep = Surface(**{**_fields(_surface(1)), "grooves": Grooves(depth_um=1e5)})
    plain = Surface(**{**_fields(deep), "grooves": None})
    found = []
    for surface in (deep, plain):
        lens = Lens(
            name="t",
            surfaces=(surface,),
            stop=0,
            aperture_kind="entrance_pupil_diameter_mm",
            aperture_value=10.0,
        )
        tensors = surface_tensors(lens, torch.tensor(0.5876, dtype=torch.float64))
        found.append(trace(tensors, _rays(500, steep=0.3, seed=5), path=True))
    for name in ("x", "y", "l", "m", "n", "path_mm", "fate"):
        assert torch.allclose(getattr(found[0], name), getattr(found[1], name), atol=1e-11), name


@pytest.mark.parametrize(("sign", "entering"), [(1, True), (-1, True), (1, False), (-1, False)])
def test_the_tool_takes_its_fillets_from_parallel_light(sign: int, entering: bool) -> None:
    """Annuli of the width R (1 + sin a), at the end of a ring where the relief lies deepest."""
    radius_mm = 0.03
    count = 200_000
    radius = RIM_MM * torch.sqrt((torch.arange(count, dtype=torch.float64) + 0.5) / count)
    blank = torch.zeros_like(radius)
    rays = Rays(
        x=radius, y=blank, z=blank, l=blank, m=blank, n=blank + 1, fate=blank.to(torch.int8)
    )
    sharp = refract(_tensors(sign, entering=entering), rays, 0)
    round_ = refract(_tensors(sign, entering=entering, tool_radius_um=30.0), rays, 0)
    assert bool((sharp.fate != Fate.GROOVE_WALL).all())
    walls = wall_radii_mm(_surface(sign).profile, Grooves(depth_um=1000 * DEPTH_MM)).numpy()
    slope = np.abs(_height(1, walls + 1e-6) - _height(1, walls - 1e-6)) / 2e-6
    width = radius_mm * (1 + slope / np.sqrt(1 + slope**2))
    # the inner ring ends at full depth, the outer one begins at the vertex plane
    inner = (sign > 0) == entering
    area = walls**2 - (walls - width) ** 2 if inner else (walls + width) ** 2 - walls**2
    # the ring at the rim ends without a wall, but its last part may lie deep as well
    last = float(walls[-1]) + 0.2 if inner else RIM_MM
    here = radius < last
    lost = float(((round_.fate == Fate.GROOVE_WALL) & here).double().mean()) * RIM_MM**2
    assert lost == pytest.approx(area.sum(), rel=0.03)


def test_walls_stand_where_the_height_is_a_multiple_of_the_depth() -> None:
    walls = wall_radii_mm(_surface(-1).profile, Grooves(depth_um=1000 * DEPTH_MM)).numpy()
    height = _height(-1, walls) / DEPTH_MM
    assert np.allclose(height, -np.arange(1, len(walls) + 1), atol=1e-9)
    assert len(walls) == int(abs(_height(-1, np.array([RIM_MM]))[0]) / DEPTH_MM)


@pytest.mark.parametrize("walls", [True, False])
def test_gradients_are_those_of_differences(walls: bool) -> None:
    tensors = _tensors(1, entering=True, walls=walls)
    rays = _rays(300, steep=0.3, seed=4)

    def landed(bend: torch.Tensor) -> torch.Tensor:
        terms = tensors.even_asphere + torch.stack([torch.zeros_like(bend), bend])[None]
        moved = SurfaceTensors(
            **{
                **{n: getattr(tensors, n) for n in tensors.__dataclass_fields__},
                "even_asphere": terms,
            }
        )
        at = trace(moved, rays, path=True)
        assert at.path_mm is not None
        return torch.where(at.valid, at.x + 2 * at.y + at.path_mm, 0.0)

    bend = torch.zeros((), dtype=torch.float64, requires_grad=True)
    (slope,) = torch.autograd.grad(landed(bend).sum(), bend)
    step = 1e-9
    with torch.no_grad():
        high, low = (landed(torch.tensor(s, dtype=torch.float64)) for s in (step, -step))
    change = (high - low) / (2 * step)
    # rays that change their ring within the step have no derivative
    smooth = change.abs() < 1e6
    assert smooth.float().mean() > 0.98
    assert float(slope) == pytest.approx(float(change[smooth].sum()), rel=1e-3)


def test_a_reversed_surface_takes_back_the_rays_that_it_let_through() -> None:
    tensors = _tensors(-1, entering=True)
    rays = _rays(2000, steep=0.4, seed=6)
    met = refract(tensors, rays, 0)
    alive = met.valid
    back = Rays(
        x=met.x,
        y=met.y,
        z=-met.z,
        l=-met.l,
        m=-met.m,
        n=met.n,
        fate=met.fate,
    )
    again = refract(reverse(tensors), back, 0)
    assert (again.fate[alive] == Fate.VALID).float().mean() > 0.999
    good = alive & again.valid
    assert torch.allclose(again.z[good], -met.z[good], atol=1e-9)
    assert torch.allclose(-again.l[good], rays.l[good], atol=1e-9)
