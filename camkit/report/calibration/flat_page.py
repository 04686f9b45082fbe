"""The page of a lens's vignetting: the profile, the display, and what both leave."""

from typing import TYPE_CHECKING, Final

import numpy as np

from camkit.calibration.flat.illumination_fit import FlatFacts
from camkit.report.calibration.page import Section, Table, sentences, to_html
from camkit.report.figure import GRID_COLOR, new_figure, to_png

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_PICTURES: Final = 8


def flat_html(facts: FlatFacts) -> str:
    """Return the page."""
    told = "Lens and display were told apart." if facts.separated else "NOT told apart:"
    words = sentences(told, *facts.notes)
    rows = tuple(
        (name, f"{pose.shift_px[0]:g}, {pose.shift_px[1]:g}", f"{np.degrees(pose.turn_rad):g}")
        for name, pose in zip(facts.files, facts.poses, strict=True)
    )
    profile = Table(
        header=("height, mm", "relative illumination"),
        rows=tuple(
            (f"{height:.3f}", f"{light:.4f}")
            for height, light in zip(facts.heights_mm, facts.relative_illumination, strict=True)
        ),
    )
    numbers = (
        f"What is photographed is uneven by {facts.display:.1%}; lens and display leave "
        f"{facts.rest:.3%} (RMS). Optical centre ({facts.centre_px[0]:.1f}, "
        f"{facts.centre_px[1]:.1f}) px, {'found' if facts.centre_found else 'taken'}."
    )
    return to_html(
        "Vignetting of a lens",
        [
            Section(
                title="Relative illumination",
                paragraph=words,
                table=profile,
                pictures={
                    "Over the distance from the optical centre.": to_png(draw_profile(facts))
                },
            ),
            Section(
                title="Pictures",
                paragraph=numbers,
                table=Table(header=("picture", "shift, px", "turn, degrees"), rows=rows),
                pictures={
                    "Above: what is photographed, as each picture sees it, 1 at its brightest. "
                    "Below: what lens and display leave.": to_png(draw_maps(facts))
                },
            ),
        ],
    )


def draw_profile(facts: FlatFacts) -> "Figure":
    """Draw relative illumination over the height."""
    figure = new_figure(6.0, 3.4)
    panel = figure.subplots()
    style = "-" if facts.separated else "--"
    panel.plot(
        facts.heights_mm,
        facts.relative_illumination,
        style,
        marker="o",
        markersize=3,
        color="#1f6fb4",
        linewidth=1.2,
    )
    panel.set_ylim(0, 1.05 * max(1.0, float(facts.relative_illumination.max())))
    panel.set_xlabel("height on the sensor, mm", fontsize=8)
    panel.set_ylabel("relative illumination", fontsize=8)
    panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    panel.tick_params(labelsize=7)
    return figure


def draw_maps(facts: FlatFacts) -> "Figure":
    """Draw display and residual of up to eight pictures."""
    shown = min(len(facts.files), _MOST_PICTURES)
    figure = new_figure(max(3.6, 1.9 * shown + 0.8), 3.4)
    panels = figure.subplots(2, shown, squeeze=False)
    rest = 100 * facts.rest_maps[:shown]
    most = max(float(np.quantile(np.abs(rest), 0.995)), 0.01)
    low = float(facts.display_maps[:shown].min())
    for number in range(shown):
        above = panels[0, number].imshow(
            facts.display_maps[number], cmap="viridis", vmin=low, vmax=1
        )
        below = panels[1, number].imshow(rest[number], cmap="RdBu_r", vmin=-most, vmax=most)
        panels[0, number].set_title(facts.files[number][:20], fontsize=7)
        for panel in panels[:, number]:
            panel.set_xticks([])
            panel.set_yticks([])
    for image, row, label in ((above, 0, "display"), (below, 1, "left, %")):
        bar = figure.colorbar(image, ax=panels[row, :].tolist(), fraction=0.05)
        bar.set_label(label, fontsize=7)
        bar.ax.tick_params(labelsize=6)
    return figure
