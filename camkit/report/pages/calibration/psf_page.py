"""The page of a measured PSF: its kernels, its light by radius, the target blurred by it anew."""

from typing import Final

import numpy as np

from camkit.calibration.measured import ColourFacts, MeasuredPsf
from camkit.calibration.peak import PEAK_PX, light_within
from camkit.report.figure import CHANNEL_COLORS, Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

_COLORS: Final = {
    name: CHANNEL_COLORS[channel] for name, channel in (("blue", "B"), ("green", "G"), ("red", "R"))
}
_DECADES: Final = 6
_HEADER: Final = (
    *("colour", "within 3 px", "within 10 px", "error", "from green, px", "residual, %"),
)
_KERNELS: Final = "Kernels, as far as they reach; logarithm of the light, 0 at the peak."
_REBLURRED: Final = (
    "Above: the target as it was seen, and by the PSF (line); 1 where it is bright. Below: what "
    "is left."
)


def psf_html(measurement: MeasuredPsf) -> str:
    """Return the page."""
    (field,) = measurement.fields
    summary = (
        f"The light lies at ({measurement.centre_px[0]:.2f}, {measurement.centre_px[1]:.2f}) px, "
        f"{field.height_mm:.3f} mm from the middle of the sensor. Of its green light "
        f"{field.peak_share:.4f} +- {field.peak_share_error:.4f} lie within {PEAK_PX:g} px of the "
        "peak."
    )
    light = (
        sentences(summary, *measurement.notes),
        Table(header=_HEADER, rows=[_row(colour) for colour in measurement.colours]),
        Picture(_KERNELS, to_png(draw_kernels(measurement))),
        Picture("Share of the light within a radius.", to_png(draw_shares(measurement))),
    )
    sections = [Section("Light", light)]
    if any(colour.reblurred for colour in measurement.colours):
        picture = Picture(_REBLURRED, to_png(draw_reblurred(measurement)))
        sections.append(Section("The target, blurred anew", (picture,)))
    return to_html(Page(title="A point spread function", sections=sections))


@chart
def draw_kernels(measurement: MeasuredPsf) -> Figure:
    """Draw the kernels on a logarithmic scale."""
    figure = new_figure(8.0, 3.0)
    panels = figure.subplots(1, len(measurement.colours))
    half = measurement.side_px // 2
    look = {"cmap": "magma", "vmin": -_DECADES, "vmax": 0, "extent": (-half, half, half, -half)}
    for panel, colour, kernel in zip(
        panels, measurement.colours, measurement.psf.kernels[0, 0], strict=True
    ):
        image = panel.imshow(np.log10(np.maximum(kernel / kernel.max(), 10.0**-_DECADES)), **look)
        panel.set(title=colour.colour, xlabel="px")
    figure.colorbar(image, ax=list(panels), fraction=0.02)
    return figure


@chart
def draw_shares(measurement: MeasuredPsf) -> Figure:
    """Draw how much light lies within a radius."""
    figure = new_figure(6.0, 3.2)
    panel = figure.subplots()
    for colour, kernel in zip(measurement.colours, measurement.psf.kernels[0, 0], strict=True):
        inside, name = light_within(kernel), colour.colour
        panel.semilogx(np.arange(inside.size) + 0.5, inside, color=_COLORS[name], label=name)
    panel.axvline(PEAK_PX, color="black", linewidth=0.6, linestyle=":")
    panel.set(ylim=(0, 1.02), xlabel="radius, px", ylabel="share of the light")
    panel.legend()
    return figure


@chart
def draw_reblurred(measurement: MeasuredPsf) -> Figure:
    """Draw disc or edge as seen and as blurred by the PSF, and the residual."""
    figure = new_figure(7.0, 5.0)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for colour in measurement.colours:
        target = colour.reblurred
        if target is None:
            continue
        color = _COLORS[colour.colour]
        above.plot(target.distance_px, target.captured, ".", color=color)
        above.plot(
            target.distance_px, target.predicted, color=color, linewidth=0.8, label=colour.colour
        )
        rest = 100 * (target.captured - target.predicted)
        below.plot(target.distance_px, rest, ".-", color=color, linewidth=0.5)
    above.set_ylabel("light")
    above.legend()
    below.axhline(0, color="black", linewidth=0.6)
    below.set(ylabel="left, %", xlabel="distance, px")
    return figure


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
