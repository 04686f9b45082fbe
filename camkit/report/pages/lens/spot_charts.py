"""The chart of a lens's spots, alone or below those of another lens."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import torch

from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import spot_diagram
from camkit.models_def.optics.spot import Spots
from camkit.report.figure import MARKS, Figure, Panel, chart, new_figure, wave_color
from camkit.report.pages.lens.left_out import say_left_out
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

COLUMNS: Final = 5
_MOST_DOTS: Final = 600
_DRAWN_SAMPLING: Final = "hexapolar:10"


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherLens:
    """A lens whose spots are drawn above those of the page.

    Attributes:
        name: Beside its spots.
        facts: Of it.
    """

    name: str
    facts: LensFacts


@chart
def draw_spots(facts: LensFacts, name: str = "", other: OtherLens | None = None) -> Figure:
    """Draw the spots about the chief ray of the reference wavelength, with the Airy circle.

    All have one scale. Beside another lens each lens has a row, of at most `COLUMNS` fields.

    Args:
        facts: Of the lens.
        name: Beside its spots where another lens has some.
        other: Drawn above it.
    """
    numbers = facts.lit_fields()
    if other is None:
        rows = [("", facts, part) for part in _parts(numbers)] or [("", facts, numbers)]
    else:
        lenses = (other.name, other.facts), (name, facts)
        rows = [(name, lens, lens.drawn_fields(COLUMNS)) for name, lens in lenses]
    columns = max(1, *(len(fields) for *_, fields in rows))
    reach_um = 1.1 * max(1e-3, *(_reach_um(lens, fields) for _, lens, fields in rows))
    figure = new_figure(max(2.6 * columns, 5.2), 3.0 * len(rows) + 0.5)
    for row, (label, lens, fields) in enumerate(rows):
        spots = _drawn_spots(lens)
        for column, i in enumerate(fields):
            panel = figure.add_subplot(len(rows), columns, row * columns + column + 1)
            _draw_spot(panel, lens, spots, i, reach_um)
            panel.label_outer(remove_inner_ticks=True)
            if label and not column:
                panel.set_ylabel(label)
    if figure.axes:
        handles, labels = figure.axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=6)
    say_left_out(figure, facts, "µm" if numbers else "")
    return figure


def _parts(numbers: Sequence[int]) -> list[Sequence[int]]:
    return [numbers[i : i + COLUMNS] for i in range(0, len(numbers), COLUMNS)]


def _reach_um(facts: LensFacts, numbers: Sequence[int]) -> float:
    """Return the half-width that holds the spots of the fields and the Airy disc."""
    airy = torch.where(torch.isfinite(facts.airy_mm), facts.airy_mm, 0.0)
    largest = torch.nan_to_num(facts.max_mm[list(numbers)]).flatten()
    return float(torch.cat([largest, 1.5 * airy]).max()) * UM_PER_MM


def _drawn_spots(facts: LensFacts) -> Spots:
    """Return the spots that are drawn: those of the numbers, or fewer rays to their rim."""
    if len(facts.pupil.samples.x) <= _MOST_DOTS:
        return facts.spots
    pupil = Pupil(definition=facts.pupil.definition, sampling=_DRAWN_SAMPLING)
    return spot_diagram(facts.lens, facts.slopes, facts.wavelengths_um, pupil)


def _draw_spot(panel: Panel, facts: LensFacts, spots: Spots, field: int, reach_um: float) -> None:
    from matplotlib.patches import Circle

    angle = to_degrees(facts.lens.field_angles_rad[field])
    for j, wave in enumerate(facts.lens.wavelengths_um):
        alive = spots.weight[field, j] > 0
        x = spots.x_mm[field, j][alive] * UM_PER_MM
        y = (spots.y_mm[field, j][alive] - spots.chief_y_mm[field]) * UM_PER_MM
        mark = MARKS[j % len(MARKS)]
        panel.plot(
            x.detach(),
            y.detach(),
            mark,
            markersize=3 if len(x) < 400 else 1.8,
            markeredgewidth=0.6,
            markerfacecolor="none",
            color=wave_color(wave),
            label=f"{wave:.4g} µm",
        )
    nearest = facts.nearest_wavelength
    radius = float(facts.airy_mm[nearest]) * UM_PER_MM
    if math.isfinite(radius):
        circle = Circle(
            (0, 0), radius, fill=False, color="black", linewidth=0.8, label="Airy disc", zorder=3
        )
        panel.add_patch(circle)
    rms = float(facts.rms_mm[field, nearest]) * UM_PER_MM
    text = "no light" if math.isnan(rms) else f"RMS {rms:.4g} µm"
    if not math.isnan(rms) and len(facts.wavelengths_um) > 1:
        text += f", all {float(facts.rms_all_mm[field]) * UM_PER_MM:.4g}"
    panel.set(
        title=f"{angle:.4g}°   {text}",
        xlim=(-reach_um, reach_um),
        ylim=(-reach_um, reach_um),
        aspect="equal",
    )
