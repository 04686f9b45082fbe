"""The page of a measured PSF: its kernels, its light by radius, the target blurred by it anew."""

from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibration.measured import ColourFacts, MeasuredPsf
from camkit.calibration.peak import PEAK_PX, light_within
from camkit.report.calibration.page import Section, Table, sentences, to_html
from camkit.report.figure import CHANNEL_COLORS, GRID_COLOR, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLORS: Final = {
    name: CHANNEL_COLORS[channel] for name, channel in (("blue", "B"), ("green", "G"), ("red", "R"))
}
_DECADES: Final = 6


def psf_html(found: MeasuredPsf) -> str:
    """Return the page."""
    (field,) = found.fields
    told = (
        f"The light lies at ({found.centre_px[0]:.2f}, {found.centre_px[1]:.2f}) px, "
        f"{field.height_mm:.3f} mm from the middle of the sensor. Of its green light "
        f"{field.peak_share:.4f} +- {field.peak_share_error:.4f} lie within {PEAK_PX:g} px of the "
        "peak."
    )
    header = ("colour", "within 3 px", "within 10 px", "error", "from green, px", "residual, %")
    sections = [
        Section(
            title="Light",
            paragraph=sentences(told, *found.notes),
            table=Table(header=header, rows=tuple(_row(colour) for colour in found.colours)),
            pictures={
                "Kernels, as far as they reach; logarithm of the light, 0 at the peak.": to_png(
                    draw_kernels(found)
                ),
                "Share of the light within a radius.": to_png(draw_shares(found)),
            },
        )
    ]
    if any(colour.reblurred for colour in found.colours):
        sections.append(
            Section(
                title="The target, blurred anew",
                pictures={
                    "Above: the target as it was seen, and by the PSF (line); 1 where it is "
                    "bright. Below: what is left.": to_png(draw_reblurred(found))
                },
            )
        )
    return to_html("A point spread function", sections)


def draw_kernels(found: MeasuredPsf) -> "Figure":
    """Draw the kernels on a logarithmic scale."""
    figure = new_figure(8.0, 3.0)
    panels = figure.subplots(1, len(found.colours))
    half = found.side_px // 2
    image = None
    for panel, colour, kernel in zip(panels, found.colours, found.psf.kernels[0, 0], strict=True):
        light = np.log10(np.maximum(kernel / kernel.max(), 10.0**-_DECADES))
        image = panel.imshow(
            light, cmap="magma", vmin=-_DECADES, vmax=0, extent=(-half, half, half, -half)
        )
        panel.set_title(colour.colour, fontsize=8)
        panel.set_xlabel("px", fontsize=8)
        panel.tick_params(labelsize=7)
    if image is not None:
        bar = figure.colorbar(image, ax=list(panels), fraction=0.02)
        bar.ax.tick_params(labelsize=7)
    return figure


def draw_shares(found: MeasuredPsf) -> "Figure":
    """Draw how much light lies within a radius."""
    figure = new_figure(6.0, 3.2)
    panel = figure.subplots()
    for colour, kernel in zip(found.colours, found.psf.kernels[0, 0], strict=True):
        inside = light_within(kernel)
        panel.semilogx(
            np.arange(inside.size) + 0.5, inside, color=_COLORS[colour.colour], label=colour.colour
        )
    panel.axvline(PEAK_PX, color="black", linewidth=0.6, linestyle=":")
    panel.set_ylim(0, 1.02)
    panel.set_xlabel("radius, px", fontsize=8)
    panel.set_ylabel("share of the light", fontsize=8)
    panel.legend(fontsize=7, frameon=False)
    _plain(panel)
    return figure


def draw_reblurred(found: MeasuredPsf) -> "Figure":
    """Draw disc or edge as seen and as blurred by the PSF, and the residual."""
    figure = new_figure(7.0, 5.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for colour in found.colours:
        target = colour.reblurred
        if target is None:
            continue
        color = _COLORS[colour.colour]
        above.plot(target.distance_px, target.seen, ".", color=color, markersize=3)
        above.plot(target.distance_px, target.told, color=color, linewidth=0.8, label=colour.colour)
        rest = 100 * (target.seen - target.told)
        below.plot(target.distance_px, rest, ".-", color=color, markersize=3, linewidth=0.5)
    above.set_ylabel("light", fontsize=8)
    above.legend(fontsize=7, frameon=False)
    below.axhline(0, color="black", linewidth=0.6)
    below.set_ylabel("left, %", fontsize=8)
    below.set_xlabel("distance, px", fontsize=8)
    for panel in (above, below):
        _plain(panel)
    return figure


def _plain(panel: "Axes") -> None:
    panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    panel.tick_params(labelsize=7)


def _row(colour: ColourFacts) -> tuple[str, ...]:
    x, y = colour.offset_px
    rest = "-" if colour.reblurred is None else f"{100 * colour.reblurred.rest:.2f}"
    return (
        colour.colour,
        f"{colour.core_share:.4f}",
        f"{colour.peak_share:.4f}",
        f"{colour.peak_share_error:.1g}",
        f"{x:+.3f}, {y:+.3f}",
        rest,
    )
