"""Third-order sums by surface as bars."""

from typing import TYPE_CHECKING, Final

from camkit.models_def.optics.analysis.seidel import Seidel
from camkit.report.figure import GRID_COLOR, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES: Final = (
    "I spherical",
    "II coma",
    "III astigmatism",
    "IV Petzval",
    "V distortion",
    "C_L axial colour",
    "C_T lateral colour",
)
_COLORS: Final = ("#c8452f", "#b8860b", "#2e8b57", "#1f6fb4", "#8855aa", "#777777", "#bbbbbb")


def draw_seidel(sums: Seidel) -> "Figure":
    """Draw a group of bars per surface, and one for the sum."""
    columns = [*sums.surfaces_mm.T, sums.axial_colour_mm, sums.lateral_colour_mm]
    count = len(sums.surfaces_mm)
    figure = new_figure(9.5, 3.9)
    panel = figure.add_subplot()
    width = 0.8 / len(columns)
    for number, (name, color, values) in enumerate(zip(NAMES, _COLORS, columns, strict=True)):
        heights = [*values.tolist(), float(values.sum())]
        # the sum stands apart
        places = [*range(count), count + 0.5]
        shifted = [place + (number - (len(columns) - 1) / 2) * width for place in places]
        panel.bar(shifted, heights, width=width, color=color, label=name)
    panel.axhline(0, color="black", linewidth=0.8)
    panel.set_xticks([*range(count), count + 0.5], [*map(str, range(count)), "sum"])
    panel.set_xlabel("surface")
    panel.set_ylabel("mm")
    panel.grid(visible=True, axis="y", color=GRID_COLOR, linewidth=0.5)
    panel.set_axisbelow(True)
    panel.legend(fontsize=7.5, loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    return figure
