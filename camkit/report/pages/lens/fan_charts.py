"""Ray fans and OPD fans: a column for each field, tangential above sagittal."""

import torch
from torch import Tensor

from camkit.report.figure import Figure, Panel, chart, new_figure, wave_color
from camkit.report.pages.lens.left_out import say_left_out
from camkit.report.pages.lens.lens_facts import LensFacts
from camkit.units import UM_PER_MM, to_degrees

_ROWS = ("tangential", "sagittal")
_OPD_FRACTION = 1.1


@chart
def draw_ray_fans(facts: LensFacts) -> Figure:
    """Draw where rays land from the chief ray, against their height in the pupil."""
    fans = facts.fans
    assert fans is not None
    values = (fans.tangential_mm * UM_PER_MM, fans.sagittal_mm * UM_PER_MM)
    return _draw(facts, values, "µm")


@chart
def draw_opd_fans(facts: LensFacts) -> Figure:
    """Draw optical path differences in waves, against the height in the pupil."""
    fans = facts.fans
    assert fans is not None
    waves = facts.wavelengths_um[:, None]
    return _draw(facts, (fans.tangential_opd_um / waves, fans.sagittal_opd_um / waves), "waves")


def _draw(facts: LensFacts, values: tuple[Tensor, Tensor], unit: str) -> Figure:
    numbers = facts.drawn_fields()
    figure = new_figure(max(2.4 * len(numbers) + 0.4, 5.2), 5.2)
    if numbers:
        panels = figure.subplots(len(_ROWS), len(numbers), sharex=True, sharey=True, squeeze=False)
        for row, name in enumerate(_ROWS):
            for column, field in enumerate(numbers):
                _draw_fan(panels[row][column], facts, values[row][field])
            panels[row][0].set_ylabel(f"{name}, {unit}")
        for column, field in enumerate(numbers):
            angle = to_degrees(facts.lens.field_angles_rad[field])
            panels[0][column].set_title(f"{angle:.4g}°")
        drawn_values = torch.cat([value[numbers] for value in values]).abs()
        reach = float(torch.nan_to_num(drawn_values).max()) * _OPD_FRACTION
        panels[0][0].set(xlim=(-1, 1), xticks=(-1, 0, 1), ylim=(-reach, reach) if reach else None)
        handles, labels = panels[0][0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=6)
    say_left_out(figure, facts, "height in the pupil" if numbers else "")
    return figure


def _draw_fan(panel: Panel, facts: LensFacts, values: Tensor) -> None:
    assert facts.fans is not None
    for j, wave in enumerate(facts.lens.wavelengths_um):
        label = f"{wave:.4g} µm"
        panel.plot(facts.fans.pupil, values[j], color=wave_color(wave), label=label)
    panel.axhline(0, color="black", linewidth=0.6)
    panel.axvline(0, color="black", linewidth=0.6)
    if not bool(torch.isfinite(values).any()):
        panel.text(0, 0, "no light", ha="center", va="bottom", fontsize=8)
