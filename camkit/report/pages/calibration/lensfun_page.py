"""The page of a lens of lensfun's: where light comes from, what a model misses, how light falls."""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.sensor import Extent
from camkit.calibration.lensfun.entry import Entry
from camkit.calibration.lensfun.ordinary import LensBundle
from camkit.radial import RadialDistortion
from camkit.report.figure import BLUE, Figure, chart, new_figure, to_png
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html
from camkit.runtime.geometry.distortion import distort_points
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]
POINTS: Final = 257
_CAPTION: Final = (
    "How much farther out light lies in the capture than in the straight picture, and how much of "
    "it the model makes too large; below, how light falls off."
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """A lens along a radius.

    Attributes:
        radius_px: (n,) in the straight picture.
        moved_px: (n,) how much farther out light lies in the capture.
        missed_px: (n,) how much of that a model makes too large.
        light: (n,) relative illumination; None where there is none.
    """

    radius_px: FloatGrid
    moved_px: FloatGrid
    missed_px: FloatGrid
    light: FloatGrid | None


def entry_html(entry: Entry) -> str:
    """Return the page of an entry for lensfun."""
    return _html(f"camkit calibrate lensfun-out: {entry.name.model}", curves_of_entry(entry), entry)


def bundle_html(bundle: LensBundle) -> str:
    """Return the page of a bundle of a lens that lensfun knows."""
    title = f"camkit calibrate lensfun-in: {bundle.profile.lens.name}"
    return _html(title, curves_of_bundle(bundle), bundle)


def curves_of_entry(entry: Entry) -> Curves:
    """Return what an entry says and what it misses of its source."""
    distorted_px = np.linspace(0, entry.source.corner_px, POINTS)
    straight = entry.straight_px(distorted_px)
    half_px = float(np.hypot(*entry.size_px)) / 2
    return Curves(
        radius_px=straight,
        moved_px=distorted_px - straight,
        missed_px=entry.missed_px(distorted_px),
        light=entry.vignetting and entry.vignetting[0].light(distorted_px / half_px),
    )


def curves_of_bundle(bundle: LensBundle) -> Curves:
    """Return what a bundle does, and misses of lensfun's formula; green, else all colours."""
    match, extent = bundle.profile, bundle.manifest.sensor.known_extent
    pitch_mm, ideal_mm = to_mm(extent.pixel_pitch_um), half_diagonal_mm(extent)
    profile = match.profile
    assert profile.distortion is not None  # lensfun-in makes none without
    rows = profile.distortion.to_distortion()
    distorted_mm = placed_along(ideal_mm, rows, 0)
    unit_mm = rows.radius_mm
    formula = match.distortion.captured_radius(match.scale * ideal_mm / unit_mm) * unit_mm
    light = None
    if profile.illumination is not None:
        radial = profile.illumination.to_illumination()
        light = np.interp(distorted_mm**2, radial.heights_mm**2, radial.light)
    return Curves(
        radius_px=ideal_mm / pitch_mm,
        moved_px=(distorted_mm - ideal_mm) / pitch_mm,
        missed_px=(distorted_mm - formula) / pitch_mm,
        light=light,
    )


def half_diagonal_mm(extent: Extent) -> FloatGrid:
    """Return `POINTS` radii from the middle of a sensor to its corner."""
    half_px = np.hypot(extent.width_px, extent.height_px) / 2
    return np.linspace(0, half_px * to_mm(extent.pixel_pitch_um), POINTS)


def placed_along(ideal_mm: FloatGrid, rows: RadialDistortion, channel: int) -> FloatGrid:
    """Return where light of ideal radii falls."""
    points = np.stack([ideal_mm, np.zeros(ideal_mm.size)], axis=-1)
    return distort_points(points, rows, channel=channel)[:, 0]


def _html(title: str, curves: Curves, product: Entry | LensBundle) -> str:
    record = product.to_record()
    notes = sentences(*record.pop("notes"))
    table = Table(rows=[(name, _text(value)) for name, value in record.items()])
    lens = Section("Lens", (notes, table, Picture(_CAPTION, to_png(draw(curves)))))
    return to_html(Page(title=title, sections=[lens]))


def _text(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(f"{name} {_text(part)}" for name, part in value.items())
    if isinstance(value, list):
        return " ".join(map(_text, value))
    return f"{value:g}" if isinstance(value, float) else str(value)


@chart
def draw(curves: Curves) -> Figure:
    """Draw shift, what is missed of it, and light, over the radius."""
    figure = new_figure(7.0, 6.0)
    series = [(curves.moved_px, "moved, px"), (curves.missed_px, "missed, px")]
    if curves.light is not None:
        series.append((curves.light, "relative illumination"))
    for number, (values, label) in enumerate(series, start=1):
        panel = figure.add_subplot(len(series), 1, number)
        panel.plot(curves.radius_px, values, color=BLUE)
        panel.set_ylabel(label)
    panel.set_xlabel("radius in the straight picture, px")
    return figure
