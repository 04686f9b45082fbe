"""Charts of a plate: its PSF beside that of the bare lens, light along the streaks, the relief."""

import math
from typing import Final

import torch
from torch import Tensor

from camkit.models_def.optics.diffraction.shares import CORE_PX, HALF_WIDTH_PX
from camkit.report.figure import BLUE, Figure, channel_color, chart, new_figure
from camkit.report.pages.plate.plate_facts import PlateFacts
from camkit.units import UM_PER_MM

DECADES: Final = (-7.0, -2.0)
"""Of light per pixel over all light; the middle is brighter than the scale."""
_LEAST_PX: Final = 40
_MARGIN: Final = 1.35
_MOST_STREAKS: Final = 4
_FLOOR: Final = 1e-7
_MOST_SAMPLES: Final = 600
"""Cells along a side of the whole relief; every so many are drawn."""
_MIDDLE: Final = 120


@chart
def draw_psf(facts: PlateFacts) -> Figure:
    """Draw the PSFs over the camera's colours, logarithmic: with the plate, and below without."""
    count = len(facts.channels)
    figure = new_figure(3.1 * count + 0.9, 6.1)
    axes = figure.subplots(2, count, squeeze=False, sharex=True, sharey=True)
    reach = shown_reach_px(facts)
    edge = reach + 0.5
    for row, psf, name in zip(axes, (facts.psf, facts.bare), ("plate", "bare lens"), strict=True):
        for panel, one, channel in zip(row, psf, facts.channels, strict=True):
            picture = panel.imshow(
                log_light(one, reach).numpy(),
                cmap="magma",
                vmin=DECADES[0],
                vmax=DECADES[1],
                extent=(-edge, edge, edge, -edge),
                interpolation="nearest",
            )
            panel.set_title(f"{name}, {channel}")
    figure.supylabel("pixels, down")
    figure.supxlabel("pixels, right")
    what = "log10 of the share of the light in a pixel"
    figure.colorbar(picture, ax=axes, shrink=0.7, label=what)
    return figure


def shown_reach_px(facts: PlateFacts) -> int:
    """Return how far from the middle is drawn: somewhat beyond the longest streak."""
    half = facts.psf.shape[-1] // 2
    longest = max((streak.reach_px for streak in facts.streaks), default=0.0)
    return min(half, max(_LEAST_PX, round(_MARGIN * longest)))


def log_light(psf: Tensor, reach_px: int) -> Tensor:
    """Return log10 of the middle of a PSF (side, side)."""
    half = psf.shape[-1] // 2
    inner = slice(half - reach_px, half + reach_px + 1)
    return torch.log10(psf[inner, inner].clamp_min(1e-12))


@chart
def draw_cuts(facts: PlateFacts) -> Figure:
    """Draw the light along every streak of up to four, and the light beyond a distance."""
    streaks = facts.streaks[:_MOST_STREAKS]
    angles = sorted(streak.angle_deg for streak in streaks) or [0.0]
    figure = new_figure(3.3 * (len(angles) + 1), 3.3)
    *cuts, outer = figure.subplots(1, len(angles) + 1, squeeze=False)[0]
    reach = shown_reach_px(facts)
    for number, channel in enumerate(facts.channels):
        color = channel_color(channel, number)
        for psf, style, name in ((facts.psf, "-", channel), (facts.bare, ":", f"{channel}, bare")):
            for panel, angle in zip(cuts, angles, strict=True):
                light = light_along(psf[number], angle)[: reach + 1].clamp_min(_FLOOR)
                panel.semilogy(light.numpy(), style, color=color)
            light = farther(psf[number]).clamp_min(_FLOOR)
            outer.semilogy(light.numpy(), style, color=color, label=name)
    for panel, angle in zip(cuts, angles, strict=True):
        panel.set(title=f"along the line at {angle:.1f}°", ylim=(_FLOOR, 1))
    cuts[0].set_ylabel("share of the light a pixel of length")
    outer.axvline(CORE_PX, color="black", linewidth=0.6)
    outer.set(title="light farther out", ylim=(1e-4, 1))
    outer.legend()
    for panel in (*cuts, outer):
        panel.set_xlabel("pixels from the middle")
    return figure


def light_along(psf: Tensor, angle_deg: float) -> Tensor:
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
    samples = torch.nn.functional.grid_sample(
        psf.double()[None, None], at, mode="bilinear", align_corners=False
    )
    both = samples[0, 0].sum(1).reshape(2 * half + 1, fine).sum(1) / fine**2
    arms = both[half:] + both[: half + 1].flip(0)
    return torch.cat([both[half : half + 1], arms[1:]])


def farther(psf: Tensor) -> Tensor:
    """Return the share (distance,) of the light beyond each whole distance from the middle."""
    half = psf.shape[-1] // 2
    place = torch.arange(psf.shape[-1], dtype=torch.float64) - half
    at = (place[:, None] ** 2 + place[None, :] ** 2).sqrt().ceil().long().clamp(max=half + 1)
    rings = torch.zeros(half + 2, dtype=psf.dtype).scatter_add(0, at.flatten(), psf.flatten())
    return 1 - rings.cumsum(0)[: half + 1]


@chart
def draw_heights(facts: PlateFacts) -> Figure:
    """Draw the relief as it is made: whole, its middle, and how many cells have which height."""
    height_um = facts.plate.made_um.numpy()
    cells, cell_mm = height_um.shape[0], facts.plate.cell_um / UM_PER_MM
    figure = new_figure(11.5, 3.6)
    whole, middle, counts = figure.subplots(1, 3)
    step, width = max(1, cells // _MOST_SAMPLES), min(_MIDDLE, cells)
    inner = slice((cells - width) // 2, (cells - width) // 2 + width)
    low, high = float(height_um.min()), float(height_um.max())
    for panel, part, count in (
        (whole, height_um[::step, ::step], cells),
        (middle, height_um[inner, inner], width),
    ):
        half_mm = count * cell_mm / 2
        extent = (-half_mm, half_mm, half_mm, -half_mm)
        picture = panel.imshow(part, "viridis", vmin=low, vmax=high, extent=extent)
    whole.set_title("whole, mm" + (f" (one cell of {step})" if step > 1 else ""))
    middle.set_title(f"the middle {width} cells, mm")
    figure.colorbar(picture, ax=[whole, middle], shrink=0.8, label="height, µm")
    counts.hist(height_um.ravel(), bins=64, color=BLUE)
    counts.set_title("cells by height, µm")
    return figure
