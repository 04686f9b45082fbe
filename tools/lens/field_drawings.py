"""The figures of `tools.lens.field_figures`: points, bars, decibels and crops over the field."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
from PIL import Image

from camkit.contracts import FloatArray
from camkit.report.analysis.point_image import PATCH_PX
from camkit.report.analysis.recovery import TRUTH
from camkit.report.figure import FIELD_COLORS, GRID_COLOR, MARKS, new_figure, to_png
from camkit.report.stress.rig import INPUT

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from tools.lens.field_figures import Shown

WIDE_PX: Final = 900
DECADES: Final = 3.0
COLUMNS: Final = 5
COLOURS: Final = 256
THESIS_DEG: Final = 7.0
"""Half field beyond which the thesis's asphere drops drastically (figure 3.9)."""


def write_figures(shown: "Sequence[Shown]", folder: Path) -> None:
    """Write psf, detection, recovery, board and crops as PNG."""
    figures = {
        "psf": draw_points(shown),
        "detection": draw_bars(shown),
        "recovery": draw_recovery(shown),
        "board": draw_tiles([(one.found.subject.name, one.board) for one in shown]),
        "crops": draw_tiles(crop_rows(shown)),
    }
    for name, figure in figures.items():
        if figure is not None:
            write_few_colours(to_png(figure), folder / f"{name}.png")


def write_few_colours(png: bytes, path: Path) -> None:
    """Write a PNG with a palette of 256 colours, a third of the bytes."""
    few = Image.open(io.BytesIO(png)).convert("RGB").quantize(COLOURS)
    few.save(path, optimize=True)


def draw_points(shown: "Sequence[Shown]") -> "Figure":
    """Draw the peak of every camera over the field, and the light far around where it is known."""
    rows = [(one, wide) for one in shown for wide in (False, True) if one.wide or not wide]
    figure = new_figure(1.5 * COLUMNS, 1.62 * len(rows))
    panels = figure.subplots(len(rows), COLUMNS, squeeze=False)
    for (one, wide), row in zip(rows, panels, strict=True):
        points = one.found.points
        chosen = np.linspace(0, len(points) - 1, COLUMNS).round().astype(int)
        for panel, index in zip(row, chosen, strict=True):
            if wide:
                light = _around(one.wide[index], WIDE_PX // one.cell_px)
                shade = np.log10(np.maximum(light / light.max(), 10**-DECADES)) / DECADES + 1
                reach = WIDE_PX
            else:
                patch = points[index].image.patch
                shade = np.sqrt(np.maximum(patch, 0) / patch.max())
                reach = PATCH_PX
            panel.imshow(shade, cmap="magma", vmin=0, vmax=1, extent=(-reach, reach, reach, -reach))
            panel.set_title(
                f"{points[index].image.height_mm:.1f} mm, {one.degrees[index]:.0f}°", fontsize=7
            )
            _bare(panel)
        row[0].set_ylabel(
            f"{one.found.subject.name}, ±{WIDE_PX if wide else PATCH_PX} px", fontsize=7
        )
    return figure


def draw_bars(shown: "Sequence[Shown]") -> "Figure":
    """Draw contrast, detection and CDP of bars over the field angle, in the weaker direction."""
    figure = new_figure(9.0, 3.2)
    panels = figure.subplots(1, 3)
    said = ("contrast", "told apart at 95 %", "CDP, within half of nominal")
    for panel, key, label in zip(panels, ("contrast", "detection", "cdp"), said, strict=True):
        for number, one in enumerate(shown):
            values = [getattr(p.bars[p.weaker], key) for p in one.found.points]
            _line(panel, number, one.degrees, values, "-", one.found.subject.name)
        panel.set_ylabel(label, fontsize=8)
        if key == "contrast":
            panel.axhline(0, color="black", linewidth=0.6)
        else:
            panel.set_ylim(-0.03, 1.03)
        _finish(panel)
    panels[0].legend(fontsize=6, frameon=False)
    return figure


def draw_recovery(shown: "Sequence[Shown]") -> "Figure | None":
    """Draw dB over the field angle: capture dashed, filter dotted; None without pictures."""
    kept = [(n, one) for n, one in enumerate(shown) if one.found.recovered is not None]
    if not kept:
        return None
    figure = new_figure(6.0, 3.6)
    panel = figure.subplots()
    for number, one in kept:
        assert one.found.recovered is not None
        method = one.found.recovered.method
        pairs = [
            (degrees, point.psnr_db)
            for degrees, point in zip(one.degrees, one.found.points, strict=True)
            if point.psnr_db is not None
        ]
        at = [degrees for degrees, _ in pairs]
        name = one.found.subject.name
        _line(panel, number, at, [db[0] for _, db in pairs], "--", f"{name}, capture")
        if any(db[1] != db[2] for _, db in pairs):
            _line(panel, number, at, [db[1] for _, db in pairs], ":", f"{name}, filter")
        _line(panel, number, at, [db[2] for _, db in pairs], "-", f"{name}, {method}")
    panel.axvline(THESIS_DEG, color="black", linewidth=0.6, linestyle=":")
    panel.set_ylabel("PSNR, dB of sRGB", fontsize=8)
    _finish(panel)
    panel.legend(fontsize=6, frameon=False)
    return figure


def crop_rows(shown: "Sequence[Shown]") -> list[tuple[str, Sequence[FloatArray]]]:
    """Name the rows of crops: the truth, then of every camera its capture and its result."""
    kept = [one for one in shown if one.crops]
    rows: list[tuple[str, Sequence[FloatArray]]] = []
    if kept:
        rows.append(("truth", kept[0].crops[TRUTH]))
    for one in kept:
        name, last = one.found.subject.name, list(one.crops)[-1]
        rows.append((f"{name},\ncapture", one.crops[INPUT]))
        rows.append((f"{name},\n{last}", one.crops[last]))
    return rows


def draw_tiles(rows: "Sequence[tuple[str, Sequence[FloatArray]]]") -> "Figure | None":
    """Draw crops (3, s, s) of sRGB, a row for each name, from the axis to the corner."""
    if not rows:
        return None
    columns = len(rows[0][1])
    figure = new_figure(1.3 * columns, 1.32 * len(rows))
    panels = figure.subplots(len(rows), columns, squeeze=False)
    for (name, crops), row in zip(rows, panels, strict=True):
        for panel, crop in zip(row, crops, strict=True):
            panel.imshow(np.clip(crop, 0, 1).transpose(1, 2, 0), interpolation="nearest")
            _bare(panel)
        row[0].set_ylabel(name, fontsize=6)
    return figure


def _around(light: FloatArray, reach: int) -> FloatArray:
    """Return the light within a reach of the middle, zero where nothing is known."""
    half = light.shape[0] // 2
    if half < reach:
        return np.pad(light, reach - half)
    return light[half - reach : half + reach + 1, half - reach : half + reach + 1]


def _line(
    panel: "Axes",
    number: int,
    at: Sequence[float],
    values: Sequence[float],
    style: str,
    label: str,
) -> None:
    panel.plot(
        at,
        values,
        style,
        marker=MARKS[number % len(MARKS)],
        color=FIELD_COLORS[number % len(FIELD_COLORS)],
        linewidth=1,
        markersize=4,
        label=label,
    )


def _finish(panel: "Axes") -> None:
    panel.set_xlabel("field angle, degrees", fontsize=8)
    panel.grid(visible=True, color=GRID_COLOR, linewidth=0.5)
    panel.tick_params(labelsize=7)


def _bare(panel: "Axes") -> None:
    panel.set_xticks([])
    panel.set_yticks([])
