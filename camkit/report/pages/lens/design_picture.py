"""A moment of a joint design: the lens, its PSFs, and what becomes of a few patches."""

from pathlib import Path
from typing import Final

import numpy as np
from torch import Tensor

from camkit.models_def.design.run import DesignView
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.report.figure import Figure, Panel, chart, hide_ticks, new_figure, to_png
from camkit.report.pages.lens.layout import draw_layout_on
from camkit.report.pages.lens.lens_facts import analyse

_PSFS: Final = 5
_TITLES: Final = ("capture", "recovered", "sharp")


def draw_design(view: DesignView, path: Path) -> None:
    """Draw a moment of a design as PNG.

    Args:
        view: What there is to look at.
        path: The picture.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(to_png(_draw_view(view)))


@chart
def _draw_view(view: DesignView) -> Figure:
    rows = len(view.patches[0])
    figure = new_figure(10, 3.2 + 1.6 + 1.9 * len(_TITLES))
    grid = figure.add_gridspec(2 + len(_TITLES), 1, height_ratios=[3.2, 1.6, *[1.9] * len(_TITLES)])
    draw_layout_on(figure.add_subplot(grid[0]), analyse(view.lens, Pupil(), image=False))
    fields = view.kernels.shape[1]
    fields_shown = sorted({round(i * (fields - 1) / (_PSFS - 1)) for i in range(_PSFS)})
    cells = grid[1].subgridspec(1, len(fields_shown))
    for column, number in enumerate(fields_shown):
        panel = figure.add_subplot(cells[column])
        _show(panel, view.kernels[0, number] ** 0.5, scale=True)
        panel.set_title(f"PSF, field {number + 1} of {fields}")
    for line, (title, patches) in enumerate(zip(_TITLES, view.patches, strict=True)):
        cells = grid[2 + line].subgridspec(1, rows)
        for column in range(rows):
            panel = figure.add_subplot(cells[column])
            _show(panel, patches[column], scale=False)
            if column == 0:
                panel.set_ylabel(title)
    return figure


def _show(panel: Panel, planes: Tensor, *, scale: bool) -> None:
    picture = planes.detach().permute(1, 2, 0).double().numpy()
    if scale:
        picture = picture / max(float(picture.max()), 1e-12)
    panel.imshow(np.clip(picture, 0, 1), interpolation="nearest")
    hide_ticks(panel)
