"""The peak of a field as a sum of waves: does what the rays say of it hold?

Every ray of a lattice over the stop is a plane wave of its own phase (the optical path) and
direction, as in `analysis.wave_psf`; here there is no reference sphere, since most of the light
goes nowhere near the peak:

    U(x, y) = sum_j a_j exp(2 pi i / wavelength (path_j + l_j (x - x_j) + m_j (y - y_j)))

A ray counts where it lands close enough to the window that its phase turns by less than half a
wave to its neighbour in the lattice; others only add a pattern finer than the lattice can say.
"""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.start import launch, path_before
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilSamples, pupil_rays
from camkit.models_def.optics.trace import Rays, SurfaceTensors, surface_tensors, trace
from camkit.units import to_mm

LATTICE_MM: Final = 0.03
REACH_MM: Final = 0.25
# step of the points on the sensor, at most, and least points in a radius
_GRID_MM: Final = 0.0008
_POINTS: Final = 10
_PROBE_MM: Final = 1e-4
_MAX_SIDE: Final = 4000
_CHUNK_RAYS: Final = 16_384


@dataclass(frozen=True, slots=True, kw_only=True)
class _Waves:
    """Plane waves at the sensor: (wave,) each; the mirror image at x = 0 is left out."""

    x: Tensor
    y: Tensor
    l: Tensor  # noqa: E741
    m: Tensor
    path: Tensor
    amplitude: Tensor
    energy: float


def wave_shares(
    lens: Lens,
    field_angle_rad: float,
    wavelength_um: float,
    height_mm: float,
    radii_mm: tuple[float, ...],
    *,
    lattice_mm: float = LATTICE_MM,
) -> tuple[float, ...]:
    """Return the shares of the light within distances of a place on the meridian.

    Args:
        lens: Of a distant scene.
        field_angle_rad: Of the light.
        wavelength_um: Of the light.
        height_mm: Of the place, from the axis.
        radii_mm: The distances.
        lattice_mm: Step of the rays over the stop.

    Returns:
        Shares of all light that enters the stop.

    Raises:
        ContractError: If the scene is near, or the stop too wide for the lattice.
    """
    if not math.isinf(lens.object_distance_mm):
        raise ContractError("waves are summed for a distant scene; set object_distance_mm = inf")
    with torch.no_grad():
        reach_mm = max(radii_mm)
        waves = _waves(lens, field_angle_rad, wavelength_um, height_mm, reach_mm, lattice_mm)
        count = math.ceil(reach_mm / min(_GRID_MM, min(radii_mm) / _POINTS))
        step = reach_mm / count
        x = (torch.arange(count, dtype=torch.float64) + 0.5) * step
        y = torch.cat([-x.flip(0), x])
        light = _light(waves, 2 * math.pi / to_mm(wavelength_um), x, y + height_mm)
        distance_mm = torch.hypot(x, y[:, None])
        # both halves; Parseval: the integral of |U|^2 is wavelength^2 times the energy of all rays
        scale = 2 * step**2 / (to_mm(wavelength_um) ** 2 * waves.energy)
        # points at the edge of a disc count by how much of their cell lies within
        parts = (((radius - distance_mm) / step + 0.5).clamp(0, 1) for radius in radii_mm)
        return tuple(float((light * part).sum()) * scale for part in parts)


def _light(waves: _Waves, number: float, x: Tensor, y: Tensor) -> Tensor:
    """Return |U|^2 (y, x); a ray and its mirror image together make a cosine in x."""
    field = torch.zeros(len(y), len(x), dtype=torch.complex128)
    for part in torch.split(torch.arange(len(waves.x)), _CHUNK_RAYS):
        l, m = waves.l[part], waves.m[part]  # noqa: E741
        phase = waves.path[part] - l * waves.x[part] - m * waves.y[part]
        down = number * (phase + y[:, None] * m)
        rows = torch.polar(torch.ones_like(down), down) * waves.amplitude[part]
        # the mirrored ray has another phase of the two: exp(i a) + exp(-i a)
        across = 2 * torch.cos(number * l[:, None] * x)
        field += rows @ across.to(torch.complex128)
    return field.real**2 + field.imag**2


def _waves(
    lens: Lens,
    angle_rad: float,
    wavelength_um: float,
    height_mm: float,
    radius_mm: float,
    lattice_mm: float,
) -> _Waves:
    tensors = surface_tensors(lens, torch.tensor(wavelength_um, dtype=torch.float64))
    slope = torch.tensor([math.tan(angle_rad)], dtype=torch.float64)
    samples, cell_mm2 = _lattice(lens, lattice_mm)
    rays, weight = pupil_rays(lens, tensors, samples, slope)
    landings = trace(tensors, rays, path=True)
    distance_mm = torch.hypot(landings.x, landings.y - height_mm)
    near = landings.valid & (weight > 0) & (distance_mm < radius_mm + REACH_MM)
    rays, landings, distance_mm = _cut(rays, near), _cut(landings, near), distance_mm[near]
    turn = _turns(tensors, rays, landings, slope)
    density = torch.abs(turn[0] * turn[3] - turn[1] * turn[2])
    stretch = torch.sqrt(sum((part**2 for part in turn), torch.zeros_like(density)))
    number = 2 * math.pi / to_mm(wavelength_um)
    tame = number * (distance_mm + radius_mm) * stretch * lattice_mm < math.pi
    if landings.path_mm is None:
        raise ContractError("the tracer gave no optical path")
    # path from the object's wave through the first vertex
    path = landings.path_mm + path_before(rays, slope, math.inf, tensors.index[0])
    flux = weight[near] * cell_mm2
    return _Waves(
        x=landings.x,
        y=landings.y,
        l=landings.l,
        m=landings.m,
        path=path,
        amplitude=torch.where(tame, flux * torch.sqrt(density), 0.0),
        energy=2 * float(weight.sum()) * cell_mm2,
    )


def _lattice(lens: Lens, step_mm: float) -> tuple[PupilSamples, float]:
    """Return square cells of the half stop x > 0 as points of the unit disc, and a cell's area."""
    radius_mm = lens.aperture_value
    if lens.aperture_kind != "stop_semi_diameter_mm":
        raise ContractError("waves need a stop of a stated size: stop_semi_diameter_mm")
    count = math.ceil(radius_mm / step_mm)
    if count > _MAX_SIDE:
        raise ContractError(
            f"a stop of {2 * radius_mm:g} mm is too wide for waves every {step_mm:g} mm"
        )
    side = (torch.arange(count, dtype=torch.float64) + 0.5) / count
    y, x = torch.meshgrid(torch.cat([-side.flip(0), side]), side, indexing="ij")
    inside = x**2 + y**2 < 1
    return PupilSamples(x=x[inside], y=y[inside]), (radius_mm / count) ** 2


def _cut(rays: Rays, mask: Tensor) -> Rays:
    shape = mask.shape
    parts = {
        name: getattr(rays, name).expand(shape)[mask]
        for name in ("x", "y", "z", "l", "m", "n", "fate")
    }
    path = None if rays.path_mm is None else rays.path_mm.expand(shape)[mask]
    return Rays(**parts, path_mm=path)


def _turns(tensors: SurfaceTensors, rays: Rays, landings: Rays, slope: Tensor) -> list[Tensor]:
    """Return dl/dx, dm/dx, dl/dy, dm/dy by a ray close by.

    Of the rays to both sides that one counts which turns less: the other lies beyond a wall.
    """
    turns: list[Tensor] = []
    for dx, dy in ((_PROBE_MM, 0.0), (0.0, _PROBE_MM)):
        pairs = []
        for sign in (1, -1):
            there = trace(tensors, launch(rays.x + sign * dx, rays.y + sign * dy, slope, math.inf))
            turn = [(a - b) / (sign * _PROBE_MM) for a, b in _directions(there, landings)]
            size = torch.where(there.valid, turn[0] ** 2 + turn[1] ** 2, math.inf)
            pairs.append((turn, size))
        (one, size), (other, other_size) = pairs
        first, infinite = size <= other_size, torch.isinf(size) & torch.isinf(other_size)
        for a, b in zip(one, other, strict=True):
            turns.append(torch.where(infinite, 0.0, torch.where(first, a, b)))
    return turns


def _directions(a: Rays, b: Rays) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor]]:
    return (a.l, b.l), (a.m, b.m)
