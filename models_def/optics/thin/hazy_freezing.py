"""A thin plate frozen into core kernels about its peaks, and a haze in cells.

    angles -> peaks -> rays of every wavelength about them -> core (pixels) + haze (cells)

Chief rays take the place of peaks where a lens has none (`middle`).

The core is what falls near the peak, faded out by a raised cosine, so that the haze is smooth and
lies in cells without loss. Light is counted as it arrives on the sensor: what enters from a solid
angle, through walls and off the frame, over the area that its peaks cover.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.haze import MOST_CELLS, Haze
from camkit.models_def.optics.distortion import refuse_other_lens
from camkit.models_def.optics.freeze import Facts, Tell, rounded_facts
from camkit.models_def.optics.frozen import corner_height_mm, rounded, wavelength_bands
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.middle import MOST_RAD, Middle, corner_angle_rad, find_middles
from camkit.models_def.optics.thin.peak import LandedLight, land_light
from camkit.progress import counted
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.units import to_mm

Array = NDArray[np.float64]

CORE_PX: Final = 64
FADE_PX: Final = 40
"""From here on the core fades out, to nothing at its rim."""
LEAST_FIELDS: Final = 3
"""Between which light is spread by slopes."""
RAYS: Final = 20_000
COPY_RAYS: Final = 8000
"""Of a fabricated copy: one draw of errors, not what a bundle holds."""
ENERGY: Final = 0.995
LEAST_HAZE: Final = 1e-6
"""Of the light: less beside a core is none."""
SAME_PEAKS_PX: Final = 4.0
"""Peaks are found to a pixel or so and fitted to within one or two; those of other plates lie tens
of pixels off."""
_ANGLES: Final = 120
_RINGS: Final = 24
_TERMS: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class HazyGrid:
    """The sampling of a lens.

    Attributes:
        fields: Places from the axis to the corner.
        wavelengths: Evenly spaced over the response of the sensor.
        core_px: Reach of the core kernels.
        cell_px: Side of a cell of the haze.
        rays: In half the stop, for each of some thirty wavelengths that are traced.
    """

    fields: int = 13
    wavelengths: int = 5
    core_px: int = CORE_PX
    cell_px: int = 16
    rays: int = RAYS

    def __post_init__(self) -> None:
        if self.fields < LEAST_FIELDS:
            raise ContractError(
                f"a haze is frozen at {LEAST_FIELDS} fields at least; got {self.fields}"
            )


FINE: Final = HazyGrid()
"""For a bundle."""


def freeze_hazy(
    lens: Lens,
    sensor: ColorSensor,
    grid: HazyGrid = FINE,
    *,
    middle: Middle | None = None,
    tell: Tell = lambda _: None,
) -> tuple[FrozenOptics, Facts]:
    """Freeze a lens that makes peaks and haze.

    Args:
        lens: With its grooves as they are.
        sensor: Size, pitch and response.
        grid: How finely.
        middle: What light is gathered about; None to choose, see `find_middles`.
        tell: Takes a line for every field.

    Returns:
        Core and haze, and what they hold: `core_share` is the least share in the core of the light
        that arrives of a field and wavelength, `haze_kept` the least share in the cells of the haze
        that lands within the corner's radius.

    Raises:
        ContractError: If neither a peak nor a chief ray reaches the corner, or the haze is wider
            than a file holds.
    """
    fields, wavelengths, core_px = grid.fields, grid.wavelengths, grid.core_px
    cell_px, rays = grid.cell_px, grid.rays
    pitch_um = sensor.pixel_pitch_um
    corner_px = corner_height_mm(sensor) / to_mm(pitch_um)
    middles = find_middles(lens, corner_px, pitch_um, rays, middle)
    angles = np.linspace(0.0, middles.corner_rad, fields)
    heights = middles.heights_px(lens, angles, pitch_um, rays)
    response_um, _ = sensor.response_arrays()
    waves_um = np.linspace(response_um[0], response_um[-1], wavelengths)
    fine_um, bands = wavelength_bands(waves_um)
    light = arriving(angles, heights)
    reach = MOST_CELLS // 2
    core = np.zeros((fields, wavelengths, 2 * core_px + 1, 2 * core_px + 1))
    haze = np.zeros((fields, wavelengths, MOST_CELLS, MOST_CELLS))
    haze_light = np.zeros((fields, wavelengths))
    places = list(enumerate(zip(angles, heights, strict=True)))
    for field, (angle, height) in counted(places, "tracing", "fields"):
        for fine, of_sample in zip(fine_um, bands.numpy().T, strict=True):
            landings = land_light(lens, float(angle), float(fine), pitch_um, rays)
            parts = _split(landings, float(height), corner_px, core_px, cell_px)
            for sample in np.flatnonzero(of_sample):
                core[field, sample] += of_sample[sample] * parts.core
                haze[field, sample] += of_sample[sample] * parts.haze
                haze_light[field, sample] += of_sample[sample] * parts.inner_haze
        tell(f"field {field + 1} of {fields}: {middles.middle} at {height:.0f} px")
    cells = _side_holding(haze, haze_light, ENERGY)
    cut = slice(reach - cells // 2, reach + cells // 2 + 1)
    haze = haze[..., cut, cut]
    core *= light[:, None, None, None]
    haze *= light[:, None, None, None]
    share = core.sum(axis=(-2, -1))
    most = float((share + haze.sum(axis=(-2, -1))).max())
    field_mm = heights * to_mm(pitch_um)
    illumination = flat_light(lens, heights, pitch_um, rays=rays, corner_rad=middles.corner_rad)
    psf = FrozenPsf(
        kernels=rounded((core / share[..., None, None])[:, None].astype(np.float32)),
        field_heights_mm=field_mm,
        depths_mm=np.array([lens.object_distance_mm]),
        wavelengths_um=waves_um,
        pixel_pitch_um=pitch_um,
        distortion=_distortion(lens, angles, field_mm, len(sensor.channels)),
        relative_illumination=illumination,
    )
    haze_file = Haze(
        kernels=rounded((haze / most)[:, None].astype(np.float32)),
        core_share=(share / most)[:, None],
        field_heights_mm=field_mm,
        depths_mm=psf.depths_mm,
        wavelengths_um=waves_um,
        cell_px=cell_px,
        pixel_pitch_um=pitch_um,
    )
    near = share / (share + haze.sum(axis=(-2, -1)))
    facts: Facts = {
        "about": middles.middle,
        "fields": fields,
        "wavelengths": wavelengths,
        "core_px": core_px,
        "cell_px": cell_px,
        "cells": cells,
        "core_share": float(near.min()),
        "haze_kept": float(_energy(haze / light[:, None, None, None], haze_light).min()),
        "corner_illumination": float(illumination[-1]),
    }
    return FrozenOptics(psf=psf, haze=haze_file), rounded_facts(facts)


def arriving(angles_rad: Array, heights_px: Array) -> Array:
    """Return the light that enters for the area that its peaks cover, 1 on the axis.

    A scene of even radiance sends cos(a) sin(a) da through a flat stop, and its peaks cover h dh.

    Args:
        angles_rad: (field,), increasing from 0.
        heights_px: (field,), increasing from 0.
    """
    slope = np.gradient(heights_px, angles_rad, edge_order=2)
    sides = np.ones_like(heights_px)
    sides[1:] = np.sin(angles_rad[1:]) * np.cos(angles_rad[1:]) / (heights_px[1:] * slope[1:])
    sides[0] = 1 / slope[0] ** 2
    return np.asarray(sides / sides[0])


def peaks_off_px(lens: Lens, psf: FrozenPsf, *, rays: int = RAYS) -> float:
    """Return the largest distance of a lens's peaks (or chief rays) from those of a PSF.

    Args:
        lens: The lens.
        psf: Core kernels of `freeze_hazy`, whose distortion tells the angles of their fields.
        rays: In half the stop.
    """
    distortion, efl_mm = psf.distortion, paraxial_data(lens).efl_mm
    dense_mm = np.linspace(0.0, 2 * distortion.radius_mm, 4001)
    powers = np.stack([(dense_mm / distortion.radius_mm) ** (2 * k + 1) for k in range(_TERMS)])
    landed_mm = distortion.radius_mm * (distortion.coefficients[0] @ powers)
    rising = slice(0, int(np.argmax(landed_mm)) + 1)
    ideal_mm = np.interp(psf.field_heights_mm, landed_mm[rising], dense_mm[rising])
    pitch_um = psf.pixel_pitch_um
    frozen_px = psf.field_heights_mm[1:] / to_mm(pitch_um)
    middles = find_middles(lens, float(frozen_px[-1]), pitch_um, rays)
    traced_px = middles.heights_px(lens, np.arctan(ideal_mm[1:] / efl_mm), pitch_um, rays)
    return float(np.abs(traced_px - frozen_px).max())


def check_peaks(lens: Lens, psf: FrozenPsf, path: Path) -> None:
    """Refuse core kernels that were frozen from another lens with a haze.

    Raises:
        ContractError: If their peaks lie elsewhere.
    """
    refuse_other_lens(lens, path, peaks_off_px(lens, psf), SAME_PEAKS_PX)


def flat_light(
    lens: Lens,
    heights_px: Array,
    pitch_um: float,
    *,
    rays: int,
    corner_rad: float | None = None,
) -> Array:
    """Return the illumination by an even scene, haze and walls counted, 1 on the axis.

    Args:
        lens: The lens.
        heights_px: (field,), from the axis to the corner.
        pitch_um: Of the pixels.
        rays: In half the stop, of all angles together.
        corner_rad: Field angle of the last height; None for that whose peak lies there.

    Raises:
        ContractError: If that is wanted, and there is none.
    """
    corner = float(heights_px[-1])
    if corner_rad is None:
        corner_rad = corner_angle_rad(lens, corner, pitch_um, rays)
    last = min(1.1 * corner_rad, MOST_RAD)
    step = last / _ANGLES
    edges = np.linspace(0.0, corner, _RINGS + 1)
    light = np.zeros(_RINGS)
    for angle in (np.arange(_ANGLES) + 0.5) * step:
        landings = land_light(
            lens, float(angle), lens.reference_wavelength_um, pitch_um, max(rays // 20, 500)
        )
        radius = np.hypot(landings.x_px, landings.y_px)
        weight = landings.share * math.sin(angle) * math.cos(angle)
        light += np.histogram(radius, bins=edges, weights=weight)[0]
    middles = (edges[1:] + edges[:-1]) / 2
    dense = light / (edges[1:] ** 2 - edges[:-1] ** 2)
    # even powers: the light is smooth and even about the axis
    powers = np.stack([(middles / corner) ** (2 * k) for k in range(_TERMS)], axis=1)
    weights = np.sqrt(middles)
    found_terms, *_ = np.linalg.lstsq(powers * weights[:, None], dense * weights, rcond=None)
    at = np.stack([(heights_px / corner) ** (2 * k) for k in range(_TERMS)], axis=1) @ found_terms
    return np.asarray(np.maximum(at / at[0], 1e-3))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Parts:
    """A field in one wavelength: core, haze, and the haze that lands within the corner."""

    core: Array
    haze: Array
    inner_haze: float


def _split(
    light: LandedLight, height_px: float, corner_px: float, core_px: int, cell_px: int
) -> _Parts:
    x, y = light.x_px, light.y_px - height_px
    distance = np.hypot(x, y)
    faded = (distance - FADE_PX * core_px / CORE_PX) / (core_px * (1 - FADE_PX / CORE_PX))
    near = light.share * (0.5 + 0.5 * np.cos(np.pi * np.clip(faded, 0, 1)))
    far = light.share - near
    core = _cell_light(np.rint(x), np.rint(y), near, 2 * core_px + 1)
    haze = np.zeros((MOST_CELLS, MOST_CELLS))
    # the mean over points of a cell: a triangle two cells wide
    left, top = np.floor(x / cell_px), np.floor(y / cell_px)
    for right, column_share in ((0, 1 - (x / cell_px - left)), (1, x / cell_px - left)):
        for row_step, row_share in ((0, 1 - (y / cell_px - top)), (1, y / cell_px - top)):
            haze += _cell_light(
                left + right, top + row_step, far * column_share * row_share, MOST_CELLS
            )
    inside = np.hypot(light.x_px, light.y_px) <= corner_px
    return _Parts(
        core=(core + core[:, ::-1]) / 2,
        haze=(haze + haze[:, ::-1]) / 2,
        inner_haze=float(far[inside].sum()),
    )


def _cell_light(x: Array, y: Array, share: Array, side: int) -> Array:
    """Sum shares on a grid whose middle is 0; what falls beside it is left out."""
    half = side // 2
    inside = (np.abs(x) <= half) & (np.abs(y) <= half) & (share > 0)
    place = (y[inside] + half) * side + x[inside] + half
    sums = np.bincount(place.astype(np.intp), share[inside], minlength=side * side)
    return np.asarray(sums.reshape(side, side))


def _side_holding(haze: Array, light: Array, energy: float) -> int:
    """Return the least odd side in cells that holds the haze which can reach the frame."""
    most = int(haze.shape[-1])
    for side in range(1, most, 2):
        cut = slice(most // 2 - side // 2, most // 2 + side // 2 + 1)
        if (_energy(haze[..., cut, cut], light) >= energy).all():
            return side
    if (_energy(haze, light) < energy).any():
        raise ContractError(
            f"cells of {most} x {most} hold {_energy(haze, light).min():.4f} of the haze, wanted "
            f"{energy}; use larger cells"
        )
    return most


def _energy(haze: Array, light: Array) -> Array:
    """Return the share that is held of what is wanted; of next to nothing all is."""
    cell_sums = haze.sum(axis=(-2, -1))
    there = light > LEAST_HAZE
    share = np.divide(cell_sums, light, out=np.ones_like(cell_sums), where=there)
    return np.asarray(np.minimum(share, 1.0))


def _distortion(lens: Lens, angles_rad: Array, field_mm: Array, channels: int) -> RadialDistortion:
    """Fit where peaks lie to odd powers of the ideal height: no more of them than there are peaks.

    More would lie where they please between the fields.
    """
    radius_mm = float(field_mm[-1])
    ideal = paraxial_data(lens).efl_mm * np.tan(angles_rad) / radius_mm
    terms = min(_TERMS, len(ideal) - 1)
    powers = np.stack([ideal ** (2 * k + 1) for k in range(terms)], axis=1)
    coefficients = np.zeros(_TERMS)
    coefficients[:terms], *_ = np.linalg.lstsq(powers[1:], field_mm[1:] / radius_mm, rcond=None)
    return RadialDistortion(coefficients=np.tile(coefficients, (channels, 1)), radius_mm=radius_mm)
