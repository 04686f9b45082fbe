"""Wave PSFs on sensor pixels: what `psf.splat` is for rays, for the waves of `wave_psf`.

    few rays -> polynomials over half the pupil -> many waves -> U on fine points -> |U|^2 -> pixels

The pupil is its own mirror image at x = 0, so a pair of rays makes a cosine in x, and the sum is a
real matrix product per field and wavelength. |U|^2 holds no frequency above the cutoff (extent of
the pupil over wavelength); on points half a period of it apart, the product with the tent of
`psf.spread_tents` integrates it exactly, as a matrix product on either side. Phases are float64,
sums float32. Gradients flow from the kernels to directions, paths and amplitudes.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import torch
from torch import Tensor
from torch.nn.functional import pad
from torch.utils.checkpoint import checkpoint

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.pupil_fit import (
    FitGrid,
    fit_matrix,
    half_quadrature,
    slope_matrices,
    value_matrix,
)
from camkit.models_def.optics.analysis.wave_psf import reach_rings
from camkit.models_def.optics.psf import TracedPsf
from camkit.models_def.optics.trace import Rays
from camkit.units import UM_PER_MM

_SPARE_PX: Final = 2
_SIDES: Final = (1.0, 0.8, 0.6, 0.45, 0.35, 0.25)
"""Shares of a window that are tried in turn."""
_SLACK: Final = 1.02
_CHUNK_RAYS: Final = 2048
_FIT_ERROR_WAVES: Final = 0.001
_NEAR_RIM: Final = -0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class CoarsePupil:
    """A wavefront at the few rays of a fit, half a pupil; (field, wavelength, ray) unless said.

    Attributes:
        grid: The rays.
        l: Direction cosine in x from the reference sphere towards its centre.
        m: The same in y.
        opd_um: Optical path difference.
        area: Energy per area of the pupil's unit disc.
        margins: (rim, field, wavelength, ray), square of the height over that of the rim, less 1;
            light passes below 0.
        miss_mm: Distance from the centre at which rays land.
        wavelengths_um: (wavelength,).
    """

    grid: FitGrid
    l: Tensor  # noqa: E741
    m: Tensor
    opd_um: Tensor
    area: Tensor
    margins: Tensor
    miss_mm: Tensor
    wavelengths_um: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Waves:
    """The plane waves of one field and wavelength, half a pupil; (ray,) each.

    Attributes:
        l: Direction cosine in x.
        m: Direction cosine in y.
        opd_um: Optical path difference.
        amplitude: Share of each in the sum, see `wavefront.Wavefront`.
        flux: Energy of each.
        wavelength_um: Of the light.
    """

    l: Tensor  # noqa: E741
    m: Tensor
    opd_um: Tensor
    amplitude: Tensor
    flux: Tensor
    wavelength_um: float


def rim_margins(surface_rays: list[Rays], semi_diameter_mm: Tensor) -> Tensor:
    """Return the margins (rim, ...) of rays on surfaces; of those alone that have a rim.

    Args:
        surface_rays: On every surface.
        semi_diameter_mm: (surface, ...), inf for none.
    """
    margins = [
        (rays.x**2 + rays.y**2) / semi**2 - 1
        for rays, semi in zip(surface_rays, semi_diameter_mm, strict=True)
        if bool(torch.isfinite(semi).all())
    ]
    none = surface_rays[0].x.new_zeros((0, *surface_rays[0].x.shape))
    return torch.stack(margins) if margins else none


def is_smooth(coarse: CoarsePupil) -> bool:
    """Return whether the paths are polynomials to a thousandth of a wave."""
    _, terms = _slopes_and_terms(coarse.grid)
    with torch.no_grad():
        fitted = coarse.opd_um @ fit_matrix(coarse.grid).T @ terms.T
        error = torch.abs(fitted - coarse.opd_um).amax((0, 2)) / coarse.wavelengths_um
    return bool((error < _FIT_ERROR_WAVES).all())


def _slopes_and_terms(grid: FitGrid) -> tuple[tuple[Tensor, Tensor], Tensor]:
    return slope_matrices(grid), value_matrix(grid.rings, grid.arms, grid.degree)


def waves_of(coarse: CoarsePupil, i: int, j: int, size_px: int, pitch_um: float) -> Waves:
    """Interpolate the waves of field i and wavelength j, fine enough for a window of pixels.

    Raises:
        ContractError: If it would need too many rays: see `wave_psf.reach_rings`.
    """
    grid, wave_um = coarse.grid, float(coarse.wavelengths_um[j])
    x = half_quadrature(grid.rings, grid.arms).x
    l, m, area = coarse.l[i, j], coarse.m[i, j], coarse.area[i, j]  # noqa: E741
    fit, ((along_x, along_y), _) = fit_matrix(grid), _slopes_and_terms(grid)
    ratio_terms, m_terms = fit @ (l / x), fit @ m
    l_x, l_y = l / x + x * (along_x @ ratio_terms), x * (along_y @ ratio_terms)
    solid = torch.abs(l_x * (along_y @ m_terms) - l_y * (along_x @ m_terms))
    rims = [r for r in coarse.margins[:, i, j] if float(r.detach().max()) > _NEAR_RIM]
    slopes = [sum((s @ (fit @ r)) ** 2 for s in (along_x, along_y)) for r in rims]
    columns = [l / x, m, coarse.opd_um[i, j], area, torch.sqrt(area * solid), *rims, *slopes]
    rings, arms = quadrature_for(coarse, i, j, size_px, pitch_um)
    fine = half_quadrature(rings, arms)
    assert fine.weight is not None
    ratio, m, opd, area, amplitude, *edges = (
        value_matrix(rings, arms, grid.degree) @ (fit @ torch.stack(columns, dim=-1))
    ).unbind(-1)
    share = math.pi * fine.weight
    cell = torch.sqrt(share)
    for margin, slope in zip(edges[: len(rims)], edges[len(rims) :], strict=True):
        # a point at a rim counts by how much of its cell lies within
        distance = margin / torch.sqrt(slope.clamp_min(1e-12))
        share = share * (0.5 - distance / cell).clamp(0, 1)
    return Waves(
        l=ratio * fine.x,
        m=m,
        opd_um=opd,
        amplitude=share * amplitude.clamp_min(0),
        flux=share * area.clamp_min(0),
        wavelength_um=wave_um,
    )


def quadrature_for(
    coarse: CoarsePupil, i: int, j: int, size_px: int, pitch_um: float
) -> tuple[int, int]:
    """Return the rings and arms that field i and wavelength j need for a window of pixels."""
    window_mm = (size_px / 2 + _SPARE_PX) * pitch_um / UM_PER_MM
    reach_mm = math.sqrt(2) * window_mm + float(coarse.miss_mm[i, j].max())
    m = coarse.m[i, j].detach()
    aperture = max(float(coarse.l[i, j].detach().abs().max()), float(m.max() - m.min()) / 2)
    # in steps, so that matrices serve several fields and wavelengths
    return reach_rings(reach_mm, float(coarse.wavelengths_um[j]), aperture, steps=True)


def wave_side_px(coarse: CoarsePupil, i: int, j: int, size_px: int, pitch_um: float) -> int:
    """Return the odd side of the window that waves can be summed in, at most `size_px`.

    A window may be too wide for the rays that its edge needs where its light is not: beyond the
    side there is next to none. 0 if the blur itself, the rays of field i and wavelength j, is.
    """
    least = 2 * float(coarse.miss_mm[i, j].max()) * UM_PER_MM / pitch_um
    for share in _SIDES:
        side = int(size_px * share) // 2 * 2 + 1
        if side < least:
            break
        try:
            quadrature_for(coarse, i, j, side, pitch_um)
        except ContractError:
            continue
        return side
    return 0


def summed_light(
    coarse: CoarsePupil, size_px: int, pitch_um: float, mask: Tensor | None = None
) -> Tensor:
    """Return the light (field, wavelength, size, size) in the tents of pixels, of 1 that passes.

    With gradients the sums are computed again on the way back, so that memory does not grow with
    fields and wavelengths.

    Args:
        coarse: Its reference sphere is centred on the window.
        size_px: Odd kernel side.
        pitch_um: Sensor pitch.
        mask: (field, wavelength), what to sum, 0 else; all by default.

    Raises:
        ContractError: If the side is even, a field gets no light, or its blur is too wide.
    """
    if size_px < 1 or size_px % 2 == 0:
        raise ContractError(f"kernel side must be odd; got {size_px}")
    fields, wavelengths = coarse.opd_um.shape[:2]

    def light(i: int, j: int) -> Tensor:
        side = wave_side_px(coarse, i, j, size_px, pitch_um) or size_px
        inner = pixel_light(waves_of(coarse, i, j, side, pitch_um), side, pitch_um)
        return pad(inner, 4 * ((size_px - side) // 2,))

    def light_or_dark(i: int, j: int) -> Tensor:
        if mask is not None and not bool(mask[i, j]):
            return coarse.opd_um.new_zeros(size_px, size_px)
        if not torch.is_grad_enabled():
            return light(i, j)
        checkpointed: Tensor = checkpoint(light, i, j, use_reentrant=False)
        return checkpointed

    rows = [torch.stack([light_or_dark(i, j) for j in range(wavelengths)]) for i in range(fields)]
    return torch.stack(rows)


def pixel_light(waves: Waves, size_px: int, pitch_um: float) -> Tensor:
    """Return the light (size, size) float64 of waves in the tents of pixels, of 1 that passes.

    Raises:
        ContractError: If there is no light.
    """
    alive = waves.amplitude.detach() > 0
    if not bool(alive.any()):
        raise ContractError("no light reaches a kernel; check stop, semi-diameters and focus")
    l, m = waves.l[alive], waves.m[alive]  # noqa: E741
    extent = max(2 * float(l.detach().max()), float(m.detach().max() - m.detach().min()))
    steps = max(1, math.ceil(_SLACK * 2 * extent * pitch_um / waves.wavelength_um))
    place_um = _places(size_px, steps) * pitch_um
    half_um = place_um[len(place_um) // 2 :]
    rows, columns = 2 * len(place_um), len(half_um)
    field = torch.zeros(rows, columns)
    alive_rays = (l, m, waves.opd_um[alive], waves.amplitude[alive])
    parts = (torch.split(values, _CHUNK_RAYS) for values in alive_rays)
    for l_part, m_part, opd_part, amplitude in zip(*parts, strict=True):
        down = _angle((m_part * place_um[:, None] - opd_part) / waves.wavelength_um)
        across = _angle(l_part[:, None] * half_um / waves.wavelength_um)
        phasors = torch.cat([torch.cos(down), torch.sin(down)]) * amplitude.to(torch.float32)
        field = field + phasors @ torch.cos(across)
    real, imaginary = field.to(torch.float64).chunk(2)
    quarter = 4 * (real**2 + imaginary**2)
    light = torch.cat([quarter[:, 1:].flip(-1), quarter], dim=-1)
    tents = _tents(size_px, steps)
    # Parseval: the integral of |U|^2 is wavelength^2 times the energy of all rays
    energy = 2 * waves.flux.sum() * (waves.wavelength_um / pitch_um) ** 2
    return (tents @ light @ tents.T).clamp_min(0) / energy


def _angle(turns: Tensor) -> Tensor:
    """Return angles in -pi..pi as float32, from turns whose whole part float32 would not hold."""
    return (2 * math.pi * (turns - turns.detach().round())).to(torch.float32)


def _places(size_px: int, steps: int) -> Tensor:
    """Return where the light is summed, in pixels from the middle of the window."""
    reach = steps * (size_px // 2 + _SPARE_PX)
    return torch.arange(-reach, reach + 1, dtype=torch.float64) / steps


@lru_cache(maxsize=32)
def _tents(size_px: int, steps: int) -> Tensor:
    """Return weights (size, point) that integrate light over tents one pixel to either side.

    A tent has the spectrum sinc^2; the weights are those of its part below the frequency that the
    points can hold, where all light lies.
    """
    reach = steps * (size_px // 2 + _SPARE_PX)
    distance = np.arange(reach + steps * (size_px // 2) + 1) / steps
    nodes, weights = np.polynomial.legendre.leggauss(distance.size + 32)
    cycles = (nodes + 1) * steps / 4
    spectrum = np.sinc(cycles) ** 2 * weights * steps / 4
    tent = 2 * np.cos(2 * np.pi * distance[:, None] * cycles) @ spectrum / steps
    pixel = steps * (np.arange(size_px) - size_px // 2)
    point = np.arange(-reach, reach + 1)
    return torch.from_numpy(tent[np.abs(point - pixel[:, None])])


def normalised(light: Tensor) -> TracedPsf:
    """Return kernels that sum to 1, and their shares of the light; 0 where there is none."""
    inside = light.sum((-2, -1))
    scale = torch.where(inside > 0, inside, 1.0)
    return TracedPsf(kernels=light / scale[..., None, None], energy_kept=inside)
