"""Light along the streaks, and how much of it lies farther out than a distance."""

import math
from typing import TYPE_CHECKING, Final

import torch
from torch import Tensor

from camkit.models_def.optics.diffraction.shares import CORE_PX, HALF_WIDTH_PX
from camkit.report.figure import GRID_COLOR, channel_color, new_figure
from camkit.report.plate.facts import PlateFacts
from camkit.report.plate.psf_chart import shown_reach_px

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_STREAKS: Final = 4
_FLOOR: Final = 1e-7


def draw_cuts(facts: PlateFacts) -> "Figure":
    """Draw the light along every streak of up to four, and the light beyond a distance."""
    streaks = facts.streaks[:_MOST_STREAKS]
    angles = sorted(streak.angle_deg for streak in streaks) or [0.0]
    figure = new_figure(3.3 * (len(angles) + 1), 3.3)
    *cuts, beyond = figure.subplots(1, len(angles) + 1, squeeze=False)[0]
    reach = shown_reach_px(facts)
    for panel, angle in zip(cuts, angles, strict=True):
        for number, channel in enumerate(facts.channels):
            color = channel_color(channel, number)
            for psf, style in ((facts.psf, "-"), (facts.bare, ":")):
                light = along(psf[number], angle)[: reach + 1].clamp_min(_FLOOR)
                panel.semilogy(light.numpy(), style, color=color, linewidth=1, label=channel)
        panel.set_title(f"along the line at {angle:.1f}°", fontsize=9)
        panel.set_xlabel("pixels from the middle", fontsize=8)
        panel.set_ylim(_FLOOR, 1)
    cuts[0].set_ylabel("share of the light a pixel of length", fontsize=8)
    for number, channel in enumerate(facts.channels):
        color = channel_color(channel, number)
        for psf, style, name in ((facts.psf, "-", channel), (facts.bare, ":", f"{channel}, bare")):
            light = farther(psf[number]).clamp_min(_FLOOR)
            beyond.semilogy(light.numpy(), style, color=color, linewidth=1, label=name)
    beyond.axvline(CORE_PX, color="black", linewidth=0.6)
    beyond.set_title("light farther out", fontsize=9)
    beyond.set_xlabel("pixels from the middle", fontsize=8)
    beyond.set_ylim(1e-4, 1)
    beyond.legend(fontsize=6.5, frameon=False)
    for panel in (*cuts, beyond):
        panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
        panel.tick_params(labelsize=7)
    return figure


def along(psf: Tensor, angle_deg: float) -> Tensor:
    """Return the light (distance,) of both arms of a line, within HALF_WIDTH_PX of it.

    Pixels are looked at four by four times, so that a slanted line is as smooth as an upright one.

    Args:
        psf: (side, side).
        angle_deg: Of the line, from +x (right) towards +y (down).
    """
    half, fine = psf.shape[-1] // 2, 4
    t = (torch.arange((2 * half + 1) * fine, dtype=torch.float64) + 0.5) / fine - half - 0.5
    count = round(2 * HALF_WIDTH_PX * fine)
    s = (torch.arange(count, dtype=torch.float64) + 0.5) / fine - HALF_WIDTH_PX
    angle = math.radians(angle_deg)
    x = math.cos(angle) * t[:, None] - math.sin(angle) * s[None, :]
    y = math.sin(angle) * t[:, None] + math.cos(angle) * s[None, :]
    at = torch.stack([x, y], dim=-1)[None] / (half + 0.5)
    seen = torch.nn.functional.grid_sample(
        psf.double()[None, None], at, mode="bilinear", align_corners=False
    )
    both = seen[0, 0].sum(1).reshape(2 * half + 1, fine).sum(1) / fine**2
    arms = both[half:] + both[: half + 1].flip(0)
    return torch.cat([both[half : half + 1], arms[1:]])


def farther(psf: Tensor) -> Tensor:
    """Return the share (distance,) of the light beyond each whole distance from the middle."""
    half = psf.shape[-1] // 2
    place = torch.arange(psf.shape[-1], dtype=torch.float64) - half
    at = (place[:, None] ** 2 + place[None, :] ** 2).sqrt().ceil().long().clamp(max=half + 1)
    rings = torch.zeros(half + 2, dtype=psf.dtype).scatter_add(0, at.flatten(), psf.flatten())
    return 1 - rings.cumsum(0)[: half + 1]
