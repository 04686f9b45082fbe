"""A lens and its network judged on fresh pictures, with kernels of many rays."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor, nn

from camkit.models_def.design.loop import DesignLoop, DesignParts, DesignSchedule
from camkit.models_def.design.optics import LensModule
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.training.pictures import SceneSource

DENSE_RAYS = 4000


@dataclass(frozen=True, slots=True, kw_only=True)
class DesignScore:
    """What a recovery reaches.

    Attributes:
        psnr_db: Mean over all patches.
        by_field_db: Mean over the patches of every field.
    """

    psnr_db: float
    by_field_db: tuple[float, ...]


def at_lens(parts: DesignParts, scaled: Tensor, *, rays: int | None = None) -> DesignParts:
    """Give the parts with the lens at (variable,) scaled numbers, not whitened."""
    problem = parts.lens.problem
    if rays is not None:
        problem = replace(problem, samples=half_disc(rays))
    lens = LensModule(problem, parts.lens.pixels, scaled.detach(), whiten=False)
    return replace(parts, lens=lens)


def score_design(
    parts: DesignParts,
    schedule: DesignSchedule,
    scaled: Tensor,
    *,
    source: SceneSource,
    network: nn.Module | None = None,
    patches_per_field: int = 8,
) -> DesignScore:
    """Judge a lens on the same fresh patches as every other lens.

    Args:
        parts: The design; its own lens and network are not used.
        schedule: Patch size.
        scaled: (variable,), the lens.
        source: Of fresh pictures.
        network: What recovers; None for the front alone.
        patches_per_field: Patches at every field.
    """
    dense = replace(at_lens(parts, scaled, rays=DENSE_RAYS), network=network, source=source)
    fields = len(parts.lens.problem.slopes)
    loop = DesignLoop(dense, replace(schedule, valid_patches=1))
    found = loop.field_psnr_db(patches_per_field)
    by_field = tuple(float(torch.tensor(v).mean()) for v in found)
    return DesignScore(psnr_db=sum(by_field) / fields, by_field_db=by_field)
