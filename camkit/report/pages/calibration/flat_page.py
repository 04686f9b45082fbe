"""The page of a lens's vignetting: the profile, the display, and what both leave."""

from typing import Final

import numpy as np

from camkit.calibration.flat.illumination_fit import FlatFacts
from camkit.report.figure import BLUE, Figure, chart, hide_ticks, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html

_MOST_PICTURES: Final = 8


def flat_html(facts: FlatFacts) -> str:
    """Return the page."""
    separation = "Lens and display were told apart." if facts.separated else "NOT told apart:"
    profile = [
        (f"{height:.3f}", f"{light:.4f}")
        for height, light in zip(facts.heights_mm, facts.relative_illumination, strict=True)
    ]
    poses = [
        (name, f"{pose.shift_px[0]:g}, {pose.shift_px[1]:g}", f"{np.degrees(pose.turn_rad):g}")
        for name, pose in zip(facts.files, facts.poses, strict=True)
    ]
    numbers = (
        f"What is photographed is uneven by {facts.display:.1%}; lens and display leave "
        f"{facts.rest:.3%} (RMS). Optical centre ({facts.centre_px[0]:.1f}, "
        f"{facts.centre_px[1]:.1f}) px, {'found' if facts.centre_found else 'taken'}."
    )
    caption = "Over the distance from the optical centre."
    maps = (
        "Above: what is photographed, as each picture sees it, 1 at its brightest. Below: what "
        "lens and display leave."
    )
    light = (
        sentences(separation, *facts.notes),
        Table(header=("height, mm", "relative illumination"), rows=profile),
        Picture(caption, to_png(draw_profile(facts))),
    )
    pictures = (
        numbers,
        Table(header=("picture", "shift, px", "turn, degrees"), rows=poses),
        Picture(maps, to_png(draw_maps(facts))),
    )
    sections = [Section("Relative illumination", light), Section("Pictures", pictures)]
    return to_html(Page(title="Vignetting of a lens", sections=sections))


@chart
def draw_profile(facts: FlatFacts) -> Figure:
    """Draw relative illumination over the height."""
    figure = new_figure(6.0, 3.4)
    panel = figure.subplots()
    light, style = facts.relative_illumination, "o-" if facts.separated else "o--"
    panel.plot(facts.heights_mm, light, style, color=BLUE)
    panel.set(
        ylim=(0, 1.05 * max(1.0, float(light.max()))),
        xlabel="height on the sensor, mm",
        ylabel="relative illumination",
    )
    return figure


@chart
def draw_maps(facts: FlatFacts) -> Figure:
    """Draw display and residual of up to eight pictures."""
    count = min(len(facts.files), _MOST_PICTURES)
    figure = new_figure(max(3.6, 1.9 * count + 0.8), 3.4)
    panels = figure.subplots(2, count, squeeze=False)
    rest = 100 * facts.rest_maps[:count]
    most = max(float(np.quantile(np.abs(rest), 0.995)), 0.01)
    low = float(facts.display_maps[:count].min())
    for number in range(count):
        display, residual = panels[:, number]
        above = display.imshow(facts.display_maps[number], cmap="viridis", vmin=low, vmax=1)
        below = residual.imshow(rest[number], cmap="RdBu_r", vmin=-most, vmax=most)
        display.set_title(facts.files[number][:20])
        hide_ticks(display)
        hide_ticks(residual)
    for image, row, label in ((above, 0, "display"), (below, 1, "left, %")):
        figure.colorbar(image, ax=panels[row, :].tolist(), fraction=0.05, label=label)
    return figure
