"""A lens and its network judged on fresh pictures, with kernels of many rays."""

from dataclasses import replace

import torch
from torch import Tensor, nn

from camkit.models_def.design.loop import DesignLoop, DesignParts, DesignSchedule
from camkit.models_def.training.similarity import ssim
from tools.tables.journal import Entry


class Captures(nn.Module):
    """In the place of a network: shows what the sensor recorded."""

    def forward(self, planes: Tensor) -> Tensor:
        """Return the capture (b, 3, p, p) among the planes of a front."""
        return planes[:, :3]


def score_parts(parts: DesignParts, schedule: DesignSchedule, patches_per_field: int = 8) -> Entry:
    """Judge a design as it is, on patches of its source; equal windows give equal patches.

    Returns:
        `db` and `ssim` of sRGB values, (depth, field), means over patches.
    """
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

    return {"db": table(psnr), "ssim": table(alike)}
