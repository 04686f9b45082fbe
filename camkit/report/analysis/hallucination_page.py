"""The page of what pictures show and captures do not hold: histograms, maps, worst patches."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.report.analysis.invented_detail import PLANTED, TRUTH, Crop, Method, Report
from camkit.report.analysis.patches import MEASURES, summary
from camkit.report.analysis.point_image import Array
from camkit.report.analysis.unexplained import LEVEL_PX
from camkit.report.figure import (
    Figure,
    chart,
    encode_png,
    field_color,
    hide_ticks,
    levels_of,
    new_figure,
    to_png,
)
from camkit.report.pages.page import Page, Picture, Section, Table, to_html
from camkit.report.stress.rig import INPUT

LEAST: Final = 1e-5
"""Of what is drawn by its logarithm."""
_BINS: Final = 40
_ENLARGED: Final = 2
_MOST_MAPS: Final = 5
_COLUMNS: Final = 4
_GAP_PX: Final = 4


def hallucination_html(report: Report) -> str:
    """Return the page."""
    control = report.control
    methods = [m for m in report.methods if m.name not in {TRUTH, INPUT}]
    primary = report.method(control.method)
    planted = report.method(control.method + PLANTED)
    patches = (
        f"{len(primary.patches)} patches of {report.options.side_px} px at ISO "
        f"{report.options.iso:g}. l1, l2 and overshoot in sRGB values against the truth; "
        f"perceptual: {report.options.perceptual_name}. chi2: mean square of |PSF * x - y| / "
        "sigma, 1 for the truth; detail: the same less the mean over "
        f"{LEVEL_PX} px; excess: detail less that of the filter alone; above 0 the capture "
        "denies what a method added.",
        _table(report),
        Picture("Patches by measure.", to_png(draw_histograms(methods))),
    )
    caption = f"detail of patches: {control.method}, below with what was planted."
    detection = (
        f"Bars planted into {control.planted} patches of {control.method}: "
        f"{control.detected} have a larger excess than 99 of 100 patches without, {control.first} "
        f"of the {control.planted} largest are theirs. detail rose by {control.rise:.2f} at "
        "least.",
        Picture(caption, to_png(draw_maps(primary, planted))),
    )
    each, order = (
        "By excess. Each: truth, capture, restored.",
        "The first is the worst; row by row.",
    )
    worst = [
        Section(
            f"The worst patches of {method.name}", (each, Picture(order, crops_png(method.worst)))
        )
        for method in methods
        if method.worst
    ]
    sections = [Section("Patches", patches), Section("Control", detection), *worst]
    return to_html(Page(title="What the capture does not hold", sections=sections))


@chart
def draw_histograms(methods: Sequence[Method]) -> Figure:
    """Draw how many patches have which value, of every measure; both axes logarithmic.

    Values below 1e-5 are drawn as that. The excess has a sign and keeps it: its logarithm is that
    of 1 + |excess|. The filter has none.
    """
    figure = new_figure(11.5, 2.6)
    panels = figure.subplots(1, len(MEASURES))
    for panel, measure in zip(panels, MEASURES, strict=True):
        for number, method in enumerate(methods):
            values = method.values(measure)
            values = _logarithm(values[np.isfinite(values)], signed=measure == "excess")
            if not values.any():
                continue
            color = field_color(number)
            panel.hist(values, _BINS, histtype="step", color=color, label=method.name)
        panel.set(yscale="log", xlabel=_label(measure))
        if measure == MEASURES[0]:
            panel.set_ylabel("patches")
    names = panels[0].get_legend_handles_labels()
    figure.legend(*names, loc="outside upper center", ncols=9)
    return figure


def _logarithm(values: Array, *, signed: bool) -> Array:
    if signed:
        return np.asarray(np.sign(values) * np.log10(1 + np.abs(values)))
    return np.asarray(np.log10(np.maximum(values, LEAST)))


def _label(measure: str) -> str:
    return "± log10 (1 + |excess|)" if measure == "excess" else f"log10 {measure}"


@chart
def draw_maps(plain: Method, planted: Method) -> Figure:
    """Draw `detail` of the patches of some pictures, logarithm, without and with bars planted."""
    maps = [method.maps("detail") for method in (plain, planted)]
    names = list(maps[0])[:_MOST_MAPS]
    figure = new_figure(1.9 * len(names) + 0.6, 3.6)
    panels = figure.subplots(2, len(names), squeeze=False)
    for row, by_scene in zip(panels, maps, strict=True):
        for panel, name in zip(row, names, strict=True):
            light = np.log10(np.maximum(by_scene[name], 1e-2))
            image = panel.imshow(light, cmap="magma", vmin=-0.3, vmax=1.5)
            panel.set_title(name[:24], fontsize=6)
            hide_ticks(panel)
    figure.colorbar(image, ax=panels.ravel().tolist(), fraction=0.03, label="log10 detail")
    return figure


def crop_picture(crop: Crop) -> NDArray[np.uint8]:
    """Return truth, capture and restored side by side, (h, w, 3) BGR, twice as large."""
    parts = (crop.truth, crop.capture, crop.restored)
    return levels_of(np.concatenate(parts, axis=2), _ENLARGED)


def crop_png(crop: Crop) -> bytes:
    """Return the PNG of `crop_picture`."""
    return encode_png(crop_picture(crop))


def crops_png(crops: Sequence[Crop]) -> bytes:
    """Return the PNG of several, in rows of four."""
    pictures = [
        np.pad(crop_picture(crop), ((0, _GAP_PX), (0, _GAP_PX), (0, 0)), constant_values=255)
        for crop in crops
    ]
    blank = np.full_like(pictures[0], 255)
    pictures += [blank] * (-len(pictures) % _COLUMNS)
    rows = [
        np.concatenate(pictures[i : i + _COLUMNS], axis=1)
        for i in range(0, len(pictures), _COLUMNS)
    ]
    return encode_png(np.concatenate(rows, axis=0))


def _table(report: Report) -> Table:
    header = ("method", *(f"{name} {part}" for name in MEASURES for part in ("median", "p99")))
    rows = []
    for method in report.methods:
        cells = [method.name]
        for name in MEASURES:
            figures = summary(method.values(name))
            cells += ["-" if figures[k] is None else f"{figures[k]:.4g}" for k in ("median", "p99")]
        rows.append(tuple(cells))
    return Table(header=header, rows=rows)
