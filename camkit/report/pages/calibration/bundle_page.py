"""The page of a bundle with measured parts: each beside what the bundle said before."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor, PlanesSensor
from camkit.calibration.peak import light_within
from camkit.psf import FrozenPsf
from camkit.report.figure import Figure, channel_color, chart, new_figure, to_png
from camkit.report.pages.calibration.lensfun_page import POINTS, half_diagonal_mm, placed_along
from camkit.report.pages.page import Page, Picture, Section, Table, sentences, to_html
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.geometry.distortion import reference_channel
from camkit.units import to_mm

FloatGrid = NDArray[np.float64]
_LEVELS: Final = {
    "black_level": "black level, DN",
    "white_level": "white level, DN",
    "full_well_e": "full well, e-",
}
_OF_AN_ISO: Final = {"gain_e_per_dn": "gain, e- per DN", "read_noise_e": "read noise, e-"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curve:
    """Something along a radius, before and now.

    Attributes:
        radius: (n,) where.
        original: (n,) what the copied bundle says.
        now: (n,) what was measured.
    """

    radius: FloatGrid
    original: FloatGrid
    now: FloatGrid


def bundle_html(source: Bundle, calibrated: Bundle, record: Mapping[str, Any]) -> str:
    """Return the page.

    Args:
        source: What was copied.
        calibrated: The copy.
        record: What the command prints: `measured` names the parts.
    """
    parts = {"geometry": _geometry, "flat": _light, "noise": _noise, "psf": _kernels}
    rows = [(f"{name}, measured", file) for name, file in record["measured"].items()]
    rows += [
        (name.replace("_", " "), ", ".join(record[name]) or "none")
        for name in ("networks", "golden", "left_out")
    ]
    first = (sentences(*record["notes"]), Table(rows=rows))
    sections = [Section(f"From {source.manifest.name}", first)]
    sections += [parts[name](source, calibrated, record) for name in record["measured"]]
    return to_html(
        Page(title=f"camkit calibrate bundle: {calibrated.path.stem}", sections=sections)
    )


def outward_shift(source: Bundle, calibrated: Bundle) -> Curve:
    """Return how much farther out light lies than undistorted, in px; 0 where none is stated."""
    extent = calibrated.manifest.sensor.known_extent
    pitch_mm, ideal_mm = to_mm(extent.pixel_pitch_um), half_diagonal_mm(extent)
    shifts = []
    for bundle in (source, calibrated):
        if not _states(bundle, "distortion"):
            shifts.append(np.zeros(ideal_mm.size))
            continue
        rows = bundle.distortion
        placed_mm = placed_along(ideal_mm, rows, reference_channel(rows))
        shifts.append((placed_mm - ideal_mm) / pitch_mm)
    return Curve(radius=ideal_mm / pitch_mm, original=shifts[0], now=shifts[1])


def light(source: Bundle, calibrated: Bundle) -> Curve:
    """Return relative illumination over the height in mm; 1 where a bundle states none."""
    profiles = [_light_of(bundle) for bundle in (source, calibrated)]
    heights_mm = np.linspace(0, max(profile[0][-1] for profile in profiles), POINTS)
    first, second = (np.interp(heights_mm**2, at**2, value) for at, value in profiles)
    return Curve(radius=heights_mm, original=first, now=second)


def encircled_light(bundle: Bundle) -> list[FloatGrid]:
    """Return share of every colour's light within 0.5, 1.5, ... px of the middle, on the axis."""
    kernels = color_kernels(bundle.psf, *_sensor(bundle).response_arrays())
    return [light_within(kernel) for kernel in kernels.at(0.0, 0.0)]


def _sensor(bundle: Bundle) -> BayerSensor | PlanesSensor:
    sensor = bundle.manifest.sensor
    assert isinstance(sensor, BayerSensor | PlanesSensor)  # nothing else is measured so
    return sensor


def _states(bundle: Bundle, part: str) -> bool:
    """Return whether a lens profile has a part; optics with kernels have both."""
    return bool(getattr(bundle.manifest.optics, part, True))


def _light_of(bundle: Bundle) -> tuple[FloatGrid, FloatGrid]:
    profile = bundle.illumination if _states(bundle, "illumination") else None
    radial = profile.radial_illumination if isinstance(profile, FrozenPsf) else profile
    if radial is None:
        return np.array([0.0, 1.0]), np.ones(2)
    return radial.heights_mm, radial.light


def _geometry(source: Bundle, calibrated: Bundle, record: Mapping[str, Any]) -> Section:
    rows = [
        ("optical centre, px", _centre(source), _centre(calibrated)),
        ("model", "", str(record["model"])),
        ("most that the polynomial misses of it, px", "", f"{record['residual_px']:.4f}"),
    ]
    caption = "How much farther out light lies than without distortion; below, what changed of it."
    figure = draw([outward_shift(source, calibrated)], "radius, px", "moved, px")
    return Section("Geometry", (_table(rows), Picture(caption, to_png(figure))))


def _light(source: Bundle, calibrated: Bundle, _record: Mapping[str, Any]) -> Section:
    caption = "Relative illumination over the height; below, what changed of it."
    figure = draw([light(source, calibrated)], "height, mm", "relative illumination")
    return Section("Vignetting", (Picture(caption, to_png(figure)),))


def _noise(source: Bundle, calibrated: Bundle, _record: Mapping[str, Any]) -> Section:
    sensors = [_sensor(bundle) for bundle in (source, calibrated)]
    rows = [
        (label, *(f"{getattr(sensor, name):g}" for sensor in sensors))
        for name, label in _LEVELS.items()
    ]
    by_iso = [{one.iso: one for one in sensor.noise} for sensor in sensors]
    for iso in sorted({*by_iso[0], *by_iso[1]}):
        for name, label in _OF_AN_ISO.items():
            values = (f"{getattr(one[iso], name):.4g}" if iso in one else "-" for one in by_iso)
            rows.append((f"ISO {iso:g}: {label}", *values))
    return Section("Noise", (_table(rows),))


def _kernels(source: Bundle, calibrated: Bundle, _record: Mapping[str, Any]) -> Section:
    curves = []
    for first, second in zip(encircled_light(source), encircled_light(calibrated), strict=True):
        side = max(first.size, second.size)
        # beyond its border a kernel holds what it held there
        wide = [np.pad(one, (0, side - one.size), mode="edge") for one in (first, second)]
        curves.append(Curve(radius=np.arange(0.5, side), original=wide[0], now=wide[1]))
    caption = (
        "Share of the light within a radius, on the axis, by colours; below, what changed of it."
    )
    figure = draw(curves, "radius, px", "share of the light", _sensor(calibrated).channels)
    return Section("Kernels", (Picture(caption, to_png(figure)),))


@chart
def draw(
    curves: Sequence[Curve], x_label: str, y_label: str, channels: Sequence[str] = ()
) -> Figure:
    """Draw curves before (dashed) and now, and below the difference; in colours of channels."""
    figure = new_figure(7.0, 4.4)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
    for number, curve in enumerate(curves):
        color = channel_color(channels[number] if channels else "", number)
        above.plot(curve.radius, curve.original, "--", color=color, linewidth=0.9, label="before")
        above.plot(curve.radius, curve.now, color=color, label="measured")
        below.plot(curve.radius, curve.now - curve.original, color=color)
    above.legend(*(part[:2] for part in above.get_legend_handles_labels()))
    above.set_ylabel(y_label)
    below.set(ylabel="change", xlabel=x_label)
    return figure


def _centre(bundle: Bundle) -> str:
    x, y = bundle.manifest.sensor.known_extent.axis_px
    return f"{x:.2f}, {y:.2f}"


def _table(rows: Sequence[tuple[str, ...]]) -> Table:
    return Table(header=("", "before", "measured"), rows=rows)
