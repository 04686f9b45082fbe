"""`camkit analyse field`: light of points, bars told apart and pictures restored over the field.

names -> subjects -> images of points -> shares, widths, bars, MTF   (by field)
                  -> a camera -> whole frames restored               (by zone)
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.analysis.bars import Bars, see_bars
from camkit.report.analysis.point_image import (
    DIRECTIONS,
    Direction,
    PointImage,
    band_of,
    likeness,
)
from camkit.report.analysis.recovery import Recovered, Watch, recover
from camkit.report.analysis.subject import Subject
from camkit.runtime.twin.exposure import Setting
from camkit.units import to_degrees

FIELDS: Final = 9
BARS_PX: Final = 12
ISO: Final = 100.0
THESIS_WIDTHS: Final = 3
"""Distance of the two points of the thesis, in widths of the peak."""
CYCLES_PER_PX: Final = (0.005, 0.01, 0.02, 0.04, 0.08, 0.16, 0.25, 0.35, 0.5)
Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldOptions:
    """Settings of the measurement.

    Attributes:
        iso: Sensitivity.
        bars_px: Width of a bar.
        fields: Points from the axis to the corner.
        wavelength_um: Of the points; None for the middle colour of each sensor.
        pictures: Sharp pictures (3, h, w), linear Rec.709, that are photographed; none leaves
            recovery out.
        frame_px: (width, height) of these photographs; None for whole frames, and without pictures.
    """

    iso: float = ISO
    bars_px: int = BARS_PX
    fields: int = FIELDS
    wavelength_um: float | None = None
    pictures: tuple[FloatArray, ...] = ()
    frame_px: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be measured.

        Raises:
            ContractError: If a number is out of range, or a frame is asked for without pictures.
        """
        Setting(iso=self.iso)  # refuses what is no sensitivity
        if self.fields < 2:
            raise ContractError(f"a field needs 2 points at least; got {self.fields}")
        if self.bars_px < 1:
            raise ContractError(f"a bar is at least 1 px wide; got {self.bars_px}")
        if self.frame_px is not None and min(self.frame_px) < 128:
            raise ContractError(f"a frame has sides of at least 128 px; got {self.frame_px}")
        if self.frame_px is not None and not self.pictures:
            raise ContractError("only pictures are framed: give --data too, or leave --frame out")


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldPoint:
    """One field, measured.

    Attributes:
        image: Of a point.
        likeness: Of its peak and that on the axis.
        bars: Direction -> what can be told of bars.
        thesis: The same of bars three widths of the peak wide.
        psnr_db: Of the capture, of the filter alone, of what restores; None where not measured.
    """

    image: PointImage
    likeness: float
    bars: dict[Direction, Bars]
    thesis: dict[Direction, Bars]
    psnr_db: tuple[float, float, float] | None

    @property
    def weaker(self) -> Direction:
        """Return the direction in which bars have the least contrast."""
        return min(DIRECTIONS, key=lambda direction: self.bars[direction].contrast)


@dataclass(frozen=True, slots=True, kw_only=True)
class LensField:
    """One lens, measured.

    Attributes:
        subject: It.
        points: From the axis outward.
        recovered: None where nothing was photographed.
        note: Why not, where that failed.
    """

    subject: Subject
    points: tuple[FieldPoint, ...]
    recovered: Recovered | None = None
    note: str | None = None


def measure_field(
    subject: Subject,
    options: FieldOptions,
    tell: Tell | None = None,
    watch: Watch | None = None,
) -> LensField:
    """Measure a lens over the field.

    Args:
        subject: The lens.
        options: Settings of the measurement.
        tell: Takes lines about what is being done.
        watch: Is shown every frame that is photographed, (3, h, w) of sRGB; see `recover`.

    Raises:
        ContractError: If no light arrives.
    """
    report = tell or (lambda _: None)
    report(f"{subject.name}: points")
    images = subject.images(band_of(subject.sensor, options.wavelength_um), options.fields)
    recovered: Recovered | None = None
    note: str | None = None
    if options.pictures:
        report(f"{subject.name}: pictures")
        # a lens that no kernels hold is still measured
        try:
            recovered = _recover(subject, images, options, watch)
        except ContractError as error:
            note = f"not photographed: {error}"
    zones: Sequence[tuple[float, float, float] | None] = (
        (None,) * len(images) if recovered is None else recovered.zones
    )
    points = tuple(
        _point(image, images[0], zone, subject, options)
        for image, zone in zip(images, zones, strict=True)
    )
    return LensField(subject=subject, points=points, recovered=recovered, note=note)


def _recover(
    subject: Subject,
    images: Sequence[PointImage],
    options: FieldOptions,
    watch: Watch | None,
) -> Recovered:
    with TemporaryDirectory() as folder:
        return recover(
            subject.camera(Path(folder)),
            options.pictures,
            np.maximum.accumulate([image.height_mm for image in images]),
            iso=options.iso,
            frame_px=options.frame_px,
            watch=watch,
        )


def _point(
    image: PointImage,
    axis: PointImage,
    psnr_db: tuple[float, float, float] | None,
    subject: Subject,
    options: FieldOptions,
) -> FieldPoint:
    wide = max(1, round(THESIS_WIDTHS * image.fwhm_px))

    def bars_of(width_px: int) -> dict[Direction, Bars]:
        return {d: see_bars(image, d, width_px, subject.sensor, options.iso) for d in DIRECTIONS}

    return FieldPoint(
        image=image,
        likeness=likeness(axis, image),
        bars=bars_of(options.bars_px),
        thesis=bars_of(wide),
        psnr_db=psnr_db,
    )


def to_json(fields: Sequence[LensField], options: FieldOptions) -> dict[str, Any]:
    """Return what was found as plain JSON values."""
    return {
        "iso": options.iso,
        "bars_px": options.bars_px,
        "wavelength_um": options.wavelength_um,
        "cycles_per_px": list(CYCLES_PER_PX),
        "pictures": len(options.pictures),
        "lenses": {lens.subject.name: _lens(lens) for lens in fields},
    }


def _lens(field: LensField) -> dict[str, Any]:
    recovered = field.recovered
    return {
        "kind": field.subject.kind,
        "pixel_pitch_um": field.subject.sensor.known_extent.pixel_pitch_um,
        "method": None if recovered is None else recovered.method,
        "psnr_db": None if recovered is None else _psnr(recovered.overall),
        "notes": [] if field.note is None else [field.note],
        "fields": [_field(point) for point in field.points],
    }


def _field(point: FieldPoint) -> dict[str, Any]:
    image, bars = point.image, point.bars[point.weaker]
    angle = image.field_angle_rad
    return {
        "height_mm": round(image.height_mm, 4),
        "field_angle_deg": None if angle is None else round(to_degrees(angle), 4),
        "peak_share_10px": _short(image.near_share),
        "peak_fwhm_px": round(image.fwhm_px, 3),
        "share_900px": _short(image.far_share),
        "lost_share": None if image.lost_share is None else _short(image.lost_share),
        "shift_correlation": _short(point.likeness),
        "contrast": _short(bars.contrast),
        "detection": _short(bars.detection),
        "detection_ci": [_short(end) for end in bars.detection_ci],
        "cdp": _short(bars.cdp),
        "weaker": point.weaker,
        "directions": {d: _bars(b) for d, b in point.bars.items()},
        "three_widths": {d: _bars(b) for d, b in point.thesis.items()},
        "mtf": {d: [_short(v) for v in image.mtf(d, np.array(CYCLES_PER_PX))] for d in DIRECTIONS},
        "psnr_db": None if point.psnr_db is None else _psnr(point.psnr_db),
    }


def _bars(bars: Bars) -> dict[str, Any]:
    return {
        "width_px": bars.width_px,
        "contrast": _short(bars.contrast),
        "detection": _short(bars.detection),
        "detection_ci": [_short(end) for end in bars.detection_ci],
        "cdp": _short(bars.cdp),
    }


def _psnr(values: tuple[float, float, float]) -> dict[str, float]:
    before, filtered, after = values
    return {"before": round(before, 3), "filter": round(filtered, 3), "after": round(after, 3)}


def _short(value: float) -> float:
    return round(float(value), 5)


def to_text(report: dict[str, Any]) -> str:
    """Return what was found, as `to_json` has it, as a table for each lens."""
    head = (
        "mm",
        "deg",
        "10 px",
        "900 px",
        "width",
        "like",
        "contrast",
        "told",
        "CDP",
        "dB",
        "after",
    )
    lines = []
    for name, lens in report["lenses"].items():
        method = "not photographed" if lens["method"] is None else f"restored by {lens['method']}"
        lines.append(f"{name} ({lens['kind']}, {method})")
        lines += [f"  note: {note}" for note in lens["notes"]]
        lines.append("  " + "".join(f"{word:>9}" for word in head))
        lines += ["  " + _row(f) for f in lens["fields"]]
    return "\n".join(lines)


def _row(f: dict[str, Any]) -> str:
    angle, psnr = f["field_angle_deg"], f["psnr_db"]
    cells = (
        f"{f['height_mm']:.2f}",
        "-" if angle is None else f"{angle:.1f}",
        f"{f['peak_share_10px']:.3f}",
        f"{f['share_900px']:.3f}",
        f"{f['peak_fwhm_px']:.1f}",
        f"{f['shift_correlation']:.2f}",
        f"{f['contrast']:+.3f}",
        f"{f['detection']:.3f}",
        f"{f['cdp']:.3f}",
        "-" if psnr is None else f"{psnr['before']:.1f}",
        "-" if psnr is None else f"{psnr['after']:.1f}",
    )
    return "".join(f"{cell:>9}" for cell in cells)
