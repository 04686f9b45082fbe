"""The page of lenses over the field."""

from collections.abc import Sequence
from typing import Final

from camkit.report.analysis.bars import PAIRS, WHITE
from camkit.report.analysis.field_charts import (
    draw_detection,
    draw_light,
    draw_mtf,
    draw_peaks,
    draw_recovery,
)
from camkit.report.analysis.lens_field import THESIS_WIDTHS, FieldOptions, FieldPoint, LensField
from camkit.report.figure import to_png
from camkit.report.pages.page import Page, Picture, Section, Table, to_html
from camkit.units import to_degrees

_HEADER: Final = (
    *("mm", "degrees", "10 px", "900 px", "lost", "width, px", "like the axis", "contrast"),
    *("told apart", "95 %", "CDP", "dB before", "filter", "after"),
)


def field_html(lenses: Sequence[LensField], options: FieldOptions) -> str:
    """Return the page."""
    colour = (
        "the middle colour of each sensor"
        if options.wavelength_um is None
        else f"{options.wavelength_um:g} um"
    )
    light = (
        f"In {colour}, all light that arrives is 1. The peak is the densest disc of 5 px; its "
        "width is that of a disc of the area above half its height.",
        Picture("Light and width over the field.", to_png(draw_light(lenses))),
        Picture("Peaks, 129 px wide; square root of the light.", to_png(draw_peaks(lenses))),
    )
    bars = (
        f"Bars of full contrast at ISO {options.iso:g}, white on the axis at "
        f"{WHITE:g} of the white level for every lens, {PAIRS} pairs of pixels each. Told "
        "apart means: the bright pixel exceeds the dark one by more than two equal pixels "
        "differ in 19 of 20 pairs; 0.05 is chance. CDP is the share of pairs whose contrast "
        f"lies within half of the nominal one. Below: bars {THESIS_WIDTHS} widths of the peak "
        "wide. Of two directions the one with less contrast at the bars above is shown.",
        Picture("Bars over the field.", to_png(draw_detection(lenses, options.bars_px))),
    )
    detail = "Detail along the radius (line) and across it (dashed)."
    sections = [
        Section("Light of a point", light),
        Section("Bars", bars),
        Section("MTF", (Picture(detail, to_png(draw_mtf(lenses))),)),
    ]
    if any(lens.recovered is not None for lens in lenses):
        recovery = Picture(
            "Capture (dashed) and what was made of it.", to_png(draw_recovery(lenses))
        )
        sections.append(Section("Recovery", (_photographed(options), recovery)))
    sections += [_table(lens) for lens in lenses]
    return to_html(Page(title="Over the field", sections=sections))


def _photographed(options: FieldOptions) -> str:
    frame = (
        "Whole frames"
        if options.frame_px is None
        else "{}x{} px about the middle of frames".format(*options.frame_px)
    )
    return f"{frame}, filled with {len(options.pictures)} picture(s), photographed and restored."


def _table(lens: LensField) -> Section:
    table = Table(header=_HEADER, rows=[_row(point) for point in lens.points])
    return Section(lens.subject.name, (lens.note, table))


def _row(point: FieldPoint) -> tuple[str, ...]:
    image, bars = point.image, point.bars[point.weaker]
    low, high = bars.detection_ci
    psnr = ("-", "-", "-") if point.psnr_db is None else tuple(f"{v:.1f}" for v in point.psnr_db)
    angle = image.field_angle_rad
    return (
        f"{image.height_mm:.2f}",
        "-" if angle is None else f"{to_degrees(angle):.1f}",
        f"{image.near_share:.3f}",
        f"{image.far_share:.3f}",
        "-" if image.lost_share is None else f"{image.lost_share:.3f}",
        f"{image.fwhm_px:.1f}",
        f"{point.likeness:.2f}",
        f"{bars.contrast:+.3f}",
        f"{bars.detection:.3f}",
        f"{low:.3f} to {high:.3f}",
        f"{bars.cdp:.3f}",
        *psnr,
    )
