"""Charts of lenses over the field: light, detection, CDP, contrast, MTF, recovery."""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from camkit.report.analysis.lens_field import THESIS_WIDTHS, FieldPoint, LensField
from camkit.report.analysis.point_image import DIRECTIONS, PATCH_PX
from camkit.report.figure import MARKS, Figure, Panel, chart, field_color, hide_ticks, new_figure

Value = Callable[[FieldPoint], float]
LEAST_SHARE: Final = 1e-3
_MOST_PEAKS: Final = 5
_FREQUENCIES: Final = np.linspace(0.0, 0.5, 101)


@chart
def draw_light(lenses: Sequence[LensField]) -> Figure:
    """Draw the shares near the peak and within 900 px, and the width of the peak."""
    figure = new_figure(9.0, 3.0)
    near, far, width = figure.subplots(1, 3)
    _lines(near, lenses, lambda p: p.image.near_share)
    near.set(yscale="log", ylim=(LEAST_SHARE, 1.3), ylabel="light within 10 px")
    _lines(far, lenses, lambda p: p.image.far_share)
    far.set(ylim=(0, 1.05), ylabel="light within 900 px")
    _lines(width, lenses, lambda p: p.image.fwhm_px)
    width.set(yscale="log", ylabel="width of the peak, px")
    near.legend()
    return figure


@chart
def draw_detection(lenses: Sequence[LensField], bars_px: int) -> Figure:
    """Draw contrast, detection and CDP of bars; the thesis's below."""
    figure = new_figure(9.0, 5.6)
    rows = figure.subplots(2, 3, sharex=True)
    titles = (f"bars of {bars_px} px", f"bars of {THESIS_WIDTHS} widths of the peak")
    for row, (title, panels) in enumerate(zip(titles, rows, strict=True)):
        contrast, detection, cdp = panels
        _lines(contrast, lenses, _of_bars(row, "contrast"))
        contrast.axhline(0, color="black", linewidth=0.6)
        contrast.set(ylabel="contrast", title=title)
        _lines(detection, lenses, _of_bars(row, "detection"), interval=_interval(row))
        detection.axhline(0.95, color="black", linewidth=0.6, linestyle=":")
        detection.axhline(0.05, color="black", linewidth=0.6, linestyle=":")
        detection.set(ylim=(-0.03, 1.03), ylabel="told apart at 95 %")
        _lines(cdp, lenses, _of_bars(row, "cdp"))
        cdp.set(ylim=(-0.03, 1.03), ylabel="CDP, within half of nominal")
    rows[0][0].legend()
    return figure


@chart
def draw_mtf(lenses: Sequence[LensField]) -> Figure:
    """Draw the MTF on the axis, in the middle of the field and at its end; across dashed."""
    figure = new_figure(9.0, 3.0)
    for panel, share in zip(figure.subplots(1, 3, sharey=True), (0.0, 0.5, 1.0), strict=True):
        for number, lens in enumerate(lenses):
            image = lens.points[round(share * (len(lens.points) - 1))].image
            color = field_color(number)
            for direction, style in zip(DIRECTIONS, ("-", "--"), strict=True):
                mtf = image.mtf(direction, _FREQUENCIES)
                label = lens.subject.name if style == "-" else None
                panel.plot(_FREQUENCIES, mtf, style, color=color, label=label)
        panel.set(title=f"{share:g} of the field", xlabel="cycles/px", ylim=(0, 1.02))
        if share == 0:
            panel.set_ylabel("MTF")
            panel.legend()
    return figure


@chart
def draw_recovery(lenses: Sequence[LensField]) -> Figure:
    """Draw dB before (dashed) and after recovery, of lenses that were photographed with."""
    figure = new_figure(6.0, 3.4)
    panel = figure.subplots()
    for number, lens in enumerate(lenses):
        if lens.recovered is None:
            continue
        color = field_color(number)
        points = [p for p in lens.points if p.psnr_db is not None]
        at = [p.image.height_mm for p in points]
        triples = [p.psnr_db for p in points if p.psnr_db is not None]
        panel.plot(at, [t[0] for t in triples], "--", color=color)
        panel.plot(
            at,
            [t[2] for t in triples],
            marker=MARKS[number % len(MARKS)],
            color=color,
            label=f"{lens.subject.name}, {lens.recovered.method}",
        )
    panel.set(xlabel="mm from the axis", ylabel="PSNR, dB of sRGB")
    panel.legend()
    return figure


@chart
def draw_peaks(lenses: Sequence[LensField]) -> Figure:
    """Draw the peaks of every lens over the field, square root of the light."""
    columns = min(_MOST_PEAKS, max(len(lens.points) for lens in lenses))
    figure = new_figure(1.5 * columns, 1.6 * len(lenses))
    rows = figure.subplots(len(lenses), columns, squeeze=False)
    for lens, panels in zip(lenses, rows, strict=True):
        indices = np.linspace(0, len(lens.points) - 1, columns).round().astype(int)
        for panel, index in zip(panels, indices, strict=True):
            image = lens.points[index].image
            light = np.sqrt(np.maximum(image.patch, 0) / image.patch.max())
            reach = PATCH_PX
            panel.imshow(light, cmap="magma", vmin=0, vmax=1, extent=(-reach, reach, reach, -reach))
            panel.set_title(f"{image.height_mm:.1f} mm", fontsize=7)
            hide_ticks(panel)
        panels[0].set_ylabel(lens.subject.name)
    return figure


def _of_bars(row: int, name: str) -> Value:
    return lambda p: float(getattr((p.bars, p.thesis)[row][p.weaker], name))


def _interval(row: int) -> Callable[[FieldPoint], tuple[float, float]]:
    return lambda p: (p.bars, p.thesis)[row][p.weaker].detection_ci


def _lines(
    panel: Panel,
    lenses: Sequence[LensField],
    value: Value,
    *,
    interval: Callable[[FieldPoint], tuple[float, float]] | None = None,
) -> None:
    for number, lens in enumerate(lenses):
        color = field_color(number)
        at = [p.image.height_mm for p in lens.points]
        panel.plot(
            at,
            [value(p) for p in lens.points],
            marker=MARKS[number % len(MARKS)],
            color=color,
            label=lens.subject.name,
        )
        if interval is not None:
            low, high = zip(*(interval(p) for p in lens.points), strict=True)
            panel.fill_between(at, low, high, color=color, alpha=0.2, linewidth=0)
    panel.set_xlabel("mm from the axis")
