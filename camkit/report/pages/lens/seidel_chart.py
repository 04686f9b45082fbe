"""Third-order sums by surface as bars."""

from typing import Final

from camkit.report.figure import Figure, chart, new_figure
from camkit.report.pages.lens.lens_facts import LensFacts

_COLORS: Final = {
    "I spherical": "#c8452f",
    "II coma": "#b8860b",
    "III astigmatism": "#2e8b57",
    "IV Petzval": "#1f6fb4",
    "V distortion": "#8855aa",
    "C_L axial colour": "#777777",
    "C_T lateral colour": "#bbbbbb",
}


@chart
def draw_seidel(facts: LensFacts) -> Figure:
    """Draw a group of bars per surface, and one for the sum, of a lens that has sums."""
    sums = facts.seidel
    assert sums is not None
    columns = [*sums.surfaces_mm.T, sums.axial_colour_mm, sums.lateral_colour_mm]
    count = len(sums.surfaces_mm)
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    width = 0.8 / len(columns)
    places = [*range(count), count + 0.5]  # the sum stands apart
    bars = zip(_COLORS.items(), columns, strict=True)
    for number, ((name, color), values) in enumerate(bars):
        heights = [*values.tolist(), float(values.sum())]
        shifted = [place + (number - (len(columns) - 1) / 2) * width for place in places]
        panel.bar(shifted, heights, width=width, color=color, label=name)
    panel.axhline(0, color="black", linewidth=0.8)
    panel.set_xticks(places, [*map(str, range(count)), "sum"])
    panel.grid(visible=False, axis="x")
    panel.set_xlabel("surface")
    panel.set_ylabel("mm")
    panel.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
