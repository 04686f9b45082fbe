"""The PSF over the camera's colours, logarithmic, beside that of the bare lens."""

from typing import TYPE_CHECKING, Final

import torch
from torch import Tensor

from camkit.report.figure import new_figure
from camkit.report.plate.facts import PlateFacts

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DECADES: Final = (-7.0, -2.0)
"""Of light per pixel over all light; the middle is brighter than the scale."""
_LEAST_PX: Final = 40
_BEYOND: Final = 1.35


def draw_psf(facts: PlateFacts) -> "Figure":
    """Draw the PSFs: a row with the plate, a row without."""
    count = len(facts.channels)
    figure = new_figure(3.1 * count + 0.9, 6.1)
    axes = figure.subplots(2, count, squeeze=False, sharex=True, sharey=True)
    reach = shown_reach_px(facts)
    shown = None
    for row, psf, name in zip(axes, (facts.psf, facts.bare), ("plate", "bare lens"), strict=True):
        for panel, one, channel in zip(row, psf, facts.channels, strict=True):
            shown = panel.imshow(
                log_light(one, reach).numpy(),
                cmap="magma",
                vmin=DECADES[0],
                vmax=DECADES[1],
                extent=(-reach - 0.5, reach + 0.5, reach + 0.5, -reach - 0.5),
                interpolation="nearest",
            )
            panel.set_title(f"{name}, {channel}", fontsize=9)
            panel.tick_params(labelsize=7)
    figure.supylabel("pixels, down", fontsize=8)
    figure.supxlabel("pixels, right", fontsize=8)
    if shown is not None:
        bar = figure.colorbar(shown, ax=axes, shrink=0.7)
        bar.set_label("log10 of the share of the light in a pixel", fontsize=8)
    return figure


def shown_reach_px(facts: PlateFacts) -> int:
    """Return how far from the middle is drawn: somewhat beyond the longest streak."""
    half = facts.psf.shape[-1] // 2
    longest = max((streak.reach_px for streak in facts.streaks), default=0.0)
    return min(half, max(_LEAST_PX, round(_BEYOND * longest)))


def log_light(psf: Tensor, reach_px: int) -> Tensor:
    """Return log10 of the middle of a PSF (side, side)."""
    half = psf.shape[-1] // 2
    inner = slice(half - reach_px, half + reach_px + 1)
    return torch.log10(psf[inner, inner].clamp_min(1e-12))
