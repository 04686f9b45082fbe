"""A lens and its network judged on fresh pictures, with kernels of many rays; edges recovered."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from camkit.colorimetry import decode_srgb
from camkit.models_def.design.loop import DesignLoop, DesignParts, DesignSchedule
from camkit.models_def.design.sensor import capture
from camkit.models_def.training.similarity import ssim
from tools.tables.lenses.slanted_edge import Across, EdgeContrast, edge_contrast, slanted_edge

_EDGE_PX = 192
_EDGE_SEED = 960_000


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignScore:
    """What a recovery reaches, of sRGB values.

    Attributes:
        db: (depth, field) PSNR, the mean over patches.
        ssim: (depth, field), the same.
    """

    db: tuple[tuple[float, ...], ...]
    ssim: tuple[tuple[float, ...], ...]


class Captures(nn.Module):
    """In the place of a network: shows what the sensor recorded."""

    def forward(self, planes: Tensor) -> Tensor:
        """Return the capture (b, 3, p, p) among the planes of a front."""
        return planes[:, :3]


def score_parts(
    parts: DesignParts, schedule: DesignSchedule, patches_per_field: int = 8
) -> DesignScore:
    """Judge a design as it is, on patches of its source; equal windows give equal patches."""
    loop = DesignLoop(parts, replace(schedule, valid_patches=1))
    fields = len(parts.lens.problem.slopes)
    psnr: list[list[Tensor]] = [[] for _ in range(fields)]
    alike: list[list[Tensor]] = [[] for _ in range(fields)]
    for field, pictures, sharp in loop.field_pictures(patches_per_field):
        shown = pictures[:, 0].clamp(0, 1)
        error = (shown - sharp).square().mean((1, 2, 3)).clamp_min(1e-10)
        psnr[field].append(-10 * torch.log10(error))
        alike[field].append(ssim(shown, sharp.expand_as(shown)))

    def table(found: list[list[Tensor]]) -> tuple[tuple[float, ...], ...]:
        means = [torch.stack(of_field).double().mean(0) for of_field in found]
        return tuple(tuple(row) for row in torch.stack(means, dim=1).tolist())

    return DesignScore(db=table(psnr), ssim=table(alike))


def edge_contrasts(parts: DesignParts, across: Across, pairs: int = 2) -> EdgeContrast:
    """Return the contrast (depth, field, frequency) of green edges after recovery.

    Args:
        parts: The design as it is.
        across: Of the edge.
        pairs: Draws of the noise, each with its negative, over which recovered edges are averaged:
            what is linear in the noise cancels.
    """
    draws = 2 * pairs
    margin = parts.front.margin_px
    inner = _EDGE_PX + 2 * margin
    kernel_px = parts.lens.pixels.kernel_px
    edge = slanted_edge(inner + kernel_px - 1, across).float()
    generator = torch.Generator().manual_seed(_EDGE_SEED)
    half = torch.randn(pairs, 3, inner, inner, generator=generator)
    normal = torch.cat([half, -half])
    with torch.no_grad():
        kernels = parts.lens()[0].float()
        found = []
        for of_depth in kernels:
            known = of_depth if parts.front.depth_known else kernels.mean(0)
            for made, told in zip(of_depth, known, strict=True):
                spread = made.expand(draws, -1, -1, -1)
                recorded = capture(edge.expand(draws, -1, -1, -1), spread, parts.recorder, normal)
                planes = parts.front.planes(recorded, told.expand_as(spread))
                shown = planes[:, -3:] if parts.network is None else parts.network(planes)
                green = decode_srgb(shown[:, 1].numpy())
                found.append(torch.from_numpy(green).mean(0))
    cut = (edge.shape[-1] - _EDGE_PX) // 2
    sharp = edge[1, cut : cut + _EDGE_PX, cut : cut + _EDGE_PX]
    pictures = torch.stack(found).reshape(*kernels.shape[:2], _EDGE_PX, _EDGE_PX)
    return edge_contrast(pictures, sharp, across)
