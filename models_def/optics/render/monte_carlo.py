"""A textured plane through a lens, by rays from the pixels: Monte-Carlo reverse ray tracing.

A pass sends `spp` rays from every pixel and colour: stratified sub-pixel shifts, points of the stop
and wavelengths. Several passes are averaged. The gradient of a loss on the averaged picture is
taken pass by pass and row by row, each traced again when its gradient is due, so memory is that of
one chunk of rays whatever the picture, the samples and the passes. That the picture is the clean
mean while gradients are averaged over passes is what the thesis describes.

Normalisation:

- `kept`: the light of the pixel over the light of a scene of radiance 1 on the axis (reference
  wavelength): vignetting and the fall-off towards the corner stay in;
- `divided`: the mean of the texture over the light that arrives: an even scene stays even. A pixel
  that no ray reaches is 0.

The gradient moves rays; it does not see rays enter or leave through the edge of the stop beyond
what paraxial optics says of it (see `beam`).

References: Sun 2021, section 6.2.1 (optics simulation).
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, Final, Literal, cast, get_args

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import ChannelResponse
from camkit.models_def.optics.render.beam import (
    BeamTable,
    Labels,
    find_beams,
    labels_of_type,
    light_at,
    light_of,
    rays_from,
    stop_labels,
)
from camkit.models_def.optics.render.lens_view import Optics
from camkit.models_def.optics.render.strata import draw_wavelengths, pixel_numbers, to_disc
from camkit.models_def.optics.render.texture import Texture, look_up
from camkit.models_def.optics.render.window import Window
from camkit.models_def.optics.reverse import trace_to_scene
from camkit.models_def.optics.trace import SurfaceTensors

Illumination = Literal["kept", "divided"]
ILLUMINATIONS: Final[tuple[Illumination, ...]] = get_args(Illumination)
_LEAST_LIGHT: Final = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Sampling:
    """The number and the choice of rays.

    Attributes:
        spp: Rays per pixel and colour in a pass.
        passes: How many are averaged.
        seed: Of all draws; the same seed gives the same bits, whatever `chunk_rays`.
        stratified: Or plain random numbers.
        fresh_gradient: Whether gradients draw passes of their own. Then their noise is
            independent of the picture's, and the gradient of a squared loss is unbiased;
            otherwise it is exactly the gradient of the loss that was computed.
        illumination: See the module.
        chunk_rays: About how many rays are in memory at a time, at least a row of pixels.
        dtype: Of the rays.
    """

    spp: int = 64
    passes: int = 10
    seed: int = 0
    stratified: bool = True
    fresh_gradient: bool = False
    illumination: Illumination = "divided"
    chunk_rays: int = 2**17
    dtype: torch.dtype = torch.float32

    def __post_init__(self) -> None:
        if min(self.spp, self.passes, self.chunk_rays) < 1 or self.seed < 0:
            raise ContractError(
                f"spp, passes and chunk_rays must be >= 1 and the seed >= 0; got {self.spp}, "
                f"{self.passes}, {self.chunk_rays}, {self.seed}"
            )
        if self.illumination not in ILLUMINATIONS:
            raise ContractError(
                f"illumination is one of {', '.join(ILLUMINATIONS)}; got {self.illumination!r}"
            )


@dataclass(frozen=True, slots=True)
class _Job:
    """The inputs of a pass that are no tensors with a gradient."""

    texture: Texture
    optics: Optics
    window: Window
    sampling: Sampling
    beams: BeamTable
    lens: SurfaceTensors

    def chunks(self) -> Iterator[range]:
        """Yield the rows of each chunk."""
        row_rays = 3 * self.window.width_px * self.sampling.spp
        rows = max(1, self.sampling.chunk_rays // row_rays)
        for first in range(0, self.window.height_px, rows):
            yield range(first, min(first + rows, self.window.height_px))


def render(
    texture: Texture,
    optics: Optics,
    response: ChannelResponse,
    window: Window,
    sampling: Sampling | None = None,
) -> Tensor:
    """Render a texture through a lens.

    Args:
        texture: On the plane at the object distance; gradients flow to its values.
        optics: The lens; gradients flow to whatever its tensors are made of.
        response: Which wavelengths a colour sees.
        window: The pixels.
        sampling: How many rays; thesis values by default.

    Returns:
        (3, h, w), linear, in the type and the unit of the texture.
    """
    settings = sampling or Sampling()
    labels = stop_labels(optics)
    waves = torch.from_numpy(response.wavelengths_um[[0, len(response.wavelengths_um) // 2, -1]])
    beams = find_beams(optics, labels, window.radius_mm, waves)
    light = light_at(optics, labels, beams, torch.zeros(1))[0]
    tensors = optics.stopped(_wavelengths(response, settings)).converted(settings.dtype)
    job = _Job(texture, optics, window, settings, beams, tensors)
    numbers = (texture.values, labels.a, labels.b, light, *_fields(tensors))
    picture = _MeanOfPasses.apply(job, *numbers)  # type: ignore[no-untyped-call]
    return cast("Tensor", picture)


def _wavelengths(response: ChannelResponse, sampling: Sampling) -> Tensor:
    """Draw (pass, 3, spp), those of fresh gradients behind those of the picture."""
    passes = sampling.passes * (2 if sampling.fresh_gradient else 1)
    waves_um = [
        draw_wavelengths(
            np.random.default_rng((sampling.seed, number, 0)),
            response,
            sampling.spp,
            stratified=sampling.stratified,
        )
        for number in range(passes)
    ]
    return torch.from_numpy(np.stack(waves_um))


def _fields(tensors: SurfaceTensors) -> tuple[Tensor, ...]:
    """Return the numbers of a lens that broadcast against rays."""
    return tuple(getattr(tensors, name) for name in _names(tensors))


def _names(tensors: SurfaceTensors) -> list[str]:
    return [f.name for f in fields(tensors) if isinstance(getattr(tensors, f.name), Tensor)]


def _lens(values: list[Tensor], number: int, whole: SurfaceTensors) -> SurfaceTensors:
    """Return the lens at the wavelengths of a pass: the inverse of `_fields`."""
    numbers: dict[str, Any] = dict(zip(_names(whole), values, strict=True))
    for name in {"index", "order_mm"} & numbers.keys():
        numbers[name] = numbers[name][:, number]
    return replace(whole, **numbers)


class _MeanOfPasses(torch.autograd.Function):
    """The mean of all passes; its gradient traces each chunk of each pass again."""

    @staticmethod
    def forward(ctx: Any, job: _Job, *numbers: Tensor) -> Tensor:
        """Average the passes, without a graph."""
        ctx.job = job
        ctx.save_for_backward(*numbers)
        passes = job.sampling.passes
        window, values = job.window, numbers[0]
        total = torch.zeros(
            3, window.height_px, window.width_px, dtype=values.dtype, device=values.device
        )
        for number in range(passes):
            for rows in job.chunks():
                total[:, rows.start : rows.stop] += _rows(job, number, rows, numbers)
        return total / passes

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, slope: Tensor) -> tuple[Tensor | None, ...]:
        """Sum the gradients over passes and chunks."""
        job, needs_slopes = ctx.job, ctx.needs_input_grad[1:]
        leaves = [
            number.detach().requires_grad_(needs_slope)
            for number, needs_slope in zip(ctx.saved_tensors, needs_slopes, strict=True)
        ]
        free_leaves = [leaf for leaf in leaves if leaf.requires_grad]
        sums = [torch.zeros_like(leaf) for leaf in free_leaves]
        passes = job.sampling.passes
        first = passes if job.sampling.fresh_gradient else 0
        for number in range(first, first + passes):
            for rows in job.chunks():
                with torch.enable_grad():
                    part = _rows(job, number, rows, tuple(leaves))
                share = slope[:, rows.start : rows.stop] / passes
                slopes = torch.autograd.grad(part, free_leaves, share, allow_unused=True)
                sums = [
                    total if one is None else total + one
                    for total, one in zip(sums, slopes, strict=True)
                ]
        results = iter(sums)
        return (None, *(next(results) if leaf.requires_grad else None for leaf in leaves))


def _rows(job: _Job, number: int, rows: range, numbers: tuple[Tensor, ...]) -> Tensor:
    """Render some rows in one pass: (3, rows, w)."""
    values, a, b, light, *lens_numbers = numbers
    sampling, window = job.sampling, job.window
    labels = Labels(a=a, b=b, radius_mm=job.optics.stop_radius_mm)
    lens = _lens(lens_numbers, number, job.lens)
    place, label, radius = _draw(job, number, rows)
    start = rays_from(labels_of_type(labels, sampling.dtype), *place, *label)
    end = trace_to_scene(lens, start, job.optics.object_distance_mm)
    weight = light_of(start, end)
    texture = replace(job.texture, values=values)
    radiance = look_up(texture, end.x.transpose(0, 1), end.y.transpose(0, 1)).transpose(0, 1)
    arrived = (weight * radiance).mean(-1)
    if sampling.illumination == "divided":
        picture = arrived / weight.mean(-1).clamp_min(_LEAST_LIGHT)
    else:
        picture = arrived * radius**2 * (labels.area / light).to(arrived.dtype)
    return picture.to(values.dtype).T.reshape(3, len(rows), window.width_px)


def _draw(
    job: _Job, number: int, rows: range
) -> tuple[tuple[Tensor, Tensor], tuple[Tensor, Tensor], Tensor]:
    """Draw sensor points and labels (pixels, 3, spp), and the radius (pixels, 1) of the discs."""
    sampling, window = job.sampling, job.window
    width = window.width_px
    numbers = [
        pixel_numbers(
            np.random.default_rng((sampling.seed, number, row + 1)),
            3 * width,
            sampling.spp,
            stratified=sampling.stratified,
        )
        for row in rows
    ]
    u = torch.from_numpy(np.concatenate(numbers)).reshape(-1, 3, sampling.spp, 4)
    ys, xs = window.centres_mm()
    y = ys[rows.start : rows.stop, None].expand(-1, width).reshape(-1, 1, 1)
    x = xs.expand(len(rows), -1).reshape(-1, 1, 1)
    height = torch.hypot(x, y)
    middle, radius = (v.reshape(-1, 1, 1) for v in job.beams.at(height.flatten().numpy()))
    out_x, out_y = (v / height.clamp_min(1e-12) for v in (x, y))
    disc_x, disc_y = to_disc(u[..., 2], u[..., 3])
    pitch_mm, dtype = window.pitch_mm, sampling.dtype
    shift_x, shift_y = (u[..., 0] - 0.5) * pitch_mm, (u[..., 1] - 0.5) * pitch_mm
    place = (x.to(dtype) + shift_x.to(dtype), y.to(dtype) + shift_y.to(dtype))
    label_x = (middle * out_x + radius * disc_x).to(dtype)
    label_y = (middle * out_y + radius * disc_y).to(dtype)
    return place, (label_x, label_y), radius[..., 0]
