"""A textured plane through a lens, by convolution with a map of PSFs.

The texture is warped to the pixels (`alignment`), cut into blocks with smooth weights, and each
block is spread with the kernels of its place: one per colour, linear between the fields and, in
diopters, between the depths of the map. Light beyond the window of a kernel is lost.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.analysis.psf_model import PsfRegime, sensor_model
from camkit.models_def.optics.kernel_bank import ChannelResponse, colour_kernels
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.beam import find_beams, light_at, stop_labels
from camkit.models_def.optics.render.lens_view import lens_optics
from camkit.models_def.optics.render.monte_carlo import Illumination
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.texture_alignment import (
    Alignment,
    align_reference,
    averaged,
    finer,
)
from camkit.models_def.optics.render.window import Window
from camkit.models_def.sensors.forward import BLOCK_STEP_PX, block_centres_px, scatter
from camkit.models_def.sensors.turned_kernels import turned_at
from camkit.runtime.bank.psf import wavelength_weights


@dataclass(frozen=True, slots=True, kw_only=True)
class PsfMap:
    """PSFs over depths, fields and colours.

    Attributes:
        kernels: (depth, field, 3, k, k) float32, k odd; each sums to 1. As they fall on the
            sensor for points along +y, centred on the reference chief ray. May carry gradients.
        depths_mm: (depth,) object distances, increasing.
        field_heights_mm: (field,) on the sensor, increasing from 0.
        illumination: (depth, field), of an even scene; 1 on the axis.
        pitch_um: Of the samples of the kernels: the pixel pitch over the oversampling.
    """

    kernels: Tensor
    depths_mm: NDArray[np.float64]
    field_heights_mm: NDArray[np.float64]
    illumination: NDArray[np.float64]
    pitch_um: float

    def __post_init__(self) -> None:
        shape = (len(self.depths_mm), len(self.field_heights_mm))
        if self.kernels.ndim != 5 or tuple(self.kernels.shape[:3]) != (*shape, 3):
            raise ContractError(
                f"a map of {shape[0]} depths and {shape[1]} fields needs kernels "
                f"({shape[0]}, {shape[1]}, 3, k, k); got {tuple(self.kernels.shape)}"
            )
        if self.illumination.shape != shape:
            raise ContractError(f"illumination must be {shape}; got {self.illumination.shape}")
        if (np.diff(self.depths_mm) <= 0).any() or self.depths_mm[0] <= 0:
            raise ContractError(f"depths must increase from above 0; got {self.depths_mm}")


@dataclass(frozen=True, slots=True, kw_only=True)
class MapGrid:
    """The places and the density of the PSFs of a map.

    Attributes:
        depths_mm: Object distances, increasing.
        field_heights_mm: On the sensor, increasing from 0.
        wavelengths_um: Between which PSFs are taken as linear.
        kernel_px: Odd side, in samples of `pitch_um`.
        pitch_um: Of the samples.
        rays: In half the pupil.
    """

    depths_mm: NDArray[np.float64]
    field_heights_mm: NDArray[np.float64]
    wavelengths_um: NDArray[np.float64]
    kernel_px: int
    pitch_um: float
    rays: int = 4096


def trace_map(lens: Lens, response: ChannelResponse, grid: MapGrid) -> PsfMap:
    """Trace a map, the sensor unmoved between depths, without gradient.

    By waves if the rule of `psf_model` finds them at one of the depths.
    """
    weights = wavelength_weights(grid.wavelengths_um, response.wavelengths_um, response.response)
    coarse = replace(response, wavelengths_um=grid.wavelengths_um, response=weights)
    kernels, light = [], []
    corner_mm = float(grid.field_heights_mm[-1])
    lenses = [with_object_distance(lens, float(depth_mm)) for depth_mm in grid.depths_mm]
    models = [sensor_model(one, corner_mm, grid.wavelengths_um, weights) for one in lenses]
    regime: PsfRegime = "waves" if any(m.regime == "waves" for m in models) else "rays"
    for lens_at in lenses:
        traced, _ = colour_kernels(
            lens_at,
            coarse,
            grid.field_heights_mm,
            size_px=grid.kernel_px,
            pitch_um=grid.pitch_um,
            rays=grid.rays,
            regime=regime,
        )
        kernels.append(torch.from_numpy(traced))
        light.append(_illumination(lens_at, grid))
    return PsfMap(
        kernels=torch.stack(kernels),
        depths_mm=grid.depths_mm,
        field_heights_mm=grid.field_heights_mm,
        illumination=np.stack(light),
        pitch_um=grid.pitch_um,
    )


def _illumination(lens: Lens, grid: MapGrid) -> NDArray[np.float64]:
    optics = lens_optics(lens)
    labels = stop_labels(optics)
    heights = torch.from_numpy(np.concatenate([[0.0], grid.field_heights_mm]))
    waves = torch.tensor([optics.reference_wavelength_um], dtype=torch.float64)
    beams = find_beams(optics, labels, max(float(heights[-1]), 1e-3), waves)
    light = light_at(optics, labels, beams, heights)
    return (light[1:] / light[0]).numpy()


def map_at(psf_map: PsfMap, depth_mm: float) -> PsfMap:
    """Return the map of one depth: linear in diopters, the nearest beyond the map."""
    diopters = 1 / psf_map.depths_mm[::-1]
    place = float(np.interp(1 / depth_mm, diopters, np.arange(len(diopters))[::-1]))
    low = min(int(place), max(0, len(diopters) - 2))
    high, share = min(low + 1, len(diopters) - 1), place - low
    light = (1 - share) * psf_map.illumination[low] + share * psf_map.illumination[high]
    return replace(
        psf_map,
        kernels=((1 - share) * psf_map.kernels[low] + share * psf_map.kernels[high])[None],
        depths_mm=np.array([depth_mm]),
        illumination=light[None],
    )


def render_by_map(
    texture: Texture,
    alignment: Alignment,
    psf_map: PsfMap,
    window: Window,
    *,
    illumination: Illumination = "divided",
    step_px: int = BLOCK_STEP_PX,
) -> Tensor:
    """Render a texture with a map of one depth.

    Gradients flow to the texture and to the kernels.

    Args:
        texture: On the plane of that depth.
        alignment: Of the lens at that depth.
        psf_map: With one depth (`map_at`). Its pitch divides that of the window; more than one
            sample to a pixel is slower and nearer to the truth.
        window: The pixels.
        illumination: See `monte_carlo`.
        step_px: Distance of block centres in pixels of the window.

    Returns:
        (3, h, w) float32.

    Raises:
        ContractError: If the map has several depths or its pitch does not fit.
    """
    if len(psf_map.depths_mm) != 1:
        raise ContractError("render one depth at a time; take it out by map_at")
    factor = round(window.pitch_um / psf_map.pitch_um)
    if abs(factor * psf_map.pitch_um - window.pitch_um) > 1e-6 * window.pitch_um:
        raise ContractError(
            f"the map's pitch of {psf_map.pitch_um} um does not divide the window's "
            f"{window.pitch_um} um"
        )
    margin = psf_map.kernels.shape[-1] // 2
    fine = finer(window, factor, margin)
    sharp = align_reference(texture, alignment, fine)
    kernels = _block_kernels(psf_map, fine, step_px * factor)
    picture = averaged(scatter(sharp, kernels, step_px=step_px * factor), factor)
    if illumination == "kept":
        ys, xs = window.centres_mm()
        height = torch.hypot(xs, ys[:, None]).numpy()
        light = np.interp(height, psf_map.field_heights_mm, psf_map.illumination[0])
        picture = picture * torch.from_numpy(light).to(picture.dtype)
    return picture


def _block_kernels(psf_map: PsfMap, fine: Window, step_px: int) -> Tensor:
    """Return kernels (rows, columns, 3, k, k) of the blocks of a window with its margin."""
    ys, xs = (
        block_centres_px(length, 0, step_px=step_px) * fine.pitch_mm + start_mm
        for length, start_mm in ((fine.height_px, fine.top_mm), (fine.width_px, fine.left_mm))
    )
    y, x = (v.flatten() for v in torch.meshgrid(ys, xs, indexing="ij"))
    heights = torch.from_numpy(psf_map.field_heights_mm)
    turned = turned_at(psf_map.kernels[0], heights, x, y)
    return turned.reshape(len(ys), len(xs), *turned.shape[1:])
