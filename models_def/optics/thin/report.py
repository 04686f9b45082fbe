"""Report on the image of a point over the field: peak, haze, grooves, rays against waves."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from camkit.models_def.optics.prescription import Lens, grooves_of
from camkit.models_def.optics.thin.peak import (
    RAYS,
    Peak,
    land_light,
    measure_peak,
    share_within,
)
from camkit.models_def.optics.thin.waves import wave_shares
from camkit.units import to_degrees, to_mm

# centres and full width at half maximum of camkit's model camera (`gaussian_response`), in um
BANDS: Final = {"blue": 0.46, "green": 0.54, "red": 0.60}
BAND_FWHM_UM: Final = 0.09
BAND_WAVES: Final = 6
WAVE_RADII_PX: Final = (5.0, 10.0)

Progress = Callable[[int, int], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class WavePeak:
    """The peak of a field in a colour: share of the light by rays and by waves.

    Attributes:
        field_angle_rad: Of the point.
        band: Name of the colour.
        rays: Within each of `WAVE_RADII_PX` of the peak of the reference wavelength.
        waves: The same.
    """

    field_angle_rad: float
    band: str
    rays: tuple[float, ...]
    waves: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakReport:
    """Peaks of a lens.

    Attributes:
        lens: It.
        pitch_um: Of the pixels.
        real: By field, grooves as they are.
        ideal: By field, grooves without walls; `real` itself where no surface has walls.
        waves: Empty unless asked for.
    """

    lens: Lens
    pitch_um: float
    real: tuple[Peak, ...]
    ideal: tuple[Peak, ...]
    waves: tuple[WavePeak, ...]


def with_ideal_grooves(lens: Lens) -> Lens:
    """Return the lens whose grooves have no walls."""
    surfaces = (
        s if s.grooves is None else replace(s, grooves=replace(s.grooves, walls=False))
        for s in lens.surfaces
    )
    return replace(lens, surfaces=tuple(surfaces))


def with_tool(lens: Lens, radius_um: float) -> Lens:
    """Return the lens whose grooves are cut by a tool with a nose of this radius.

    Raises:
        UnsupportedError: If a groove is narrower than the tool.
    """
    surfaces = (
        s if s.grooves is None else replace(s, grooves=replace(s.grooves, tool_radius_um=radius_um))
        for s in lens.surfaces
    )
    return replace(lens, surfaces=tuple(surfaces))


def with_midpoints(angles_rad: Sequence[float]) -> tuple[float, ...]:
    """Return angles and the middles between them."""
    angles = np.array(sorted(angles_rad))
    middles = (angles[1:] + angles[:-1]) / 2
    return tuple(np.sort(np.concatenate([angles, middles])).tolist())


def band_wavelengths_um(band: str) -> tuple[float, ...]:
    """Return wavelengths spread evenly over the width of a colour."""
    places = (np.arange(BAND_WAVES) + 0.5) / BAND_WAVES - 0.5
    return tuple((BANDS[band] + BAND_FWHM_UM * places).tolist())


def report_peaks(
    lens: Lens,
    field_angles_rad: Sequence[float],
    pitch_um: float,
    *,
    wave_fields_rad: Sequence[float] = (),
    rays: int = RAYS,
    progress: Progress | None = None,
) -> PeakReport:
    """Measure the peaks of a lens at its reference wavelength.

    Args:
        lens: The prescription.
        field_angles_rad: Of the points.
        pitch_um: Of the pixels.
        wave_fields_rad: Of the points whose peaks are summed from waves too, in every colour.
        rays: In half the stop.
        progress: Told how many fields are done, and of how many.

    Raises:
        ContractError: If no light arrives, or waves cannot be summed (`wave_shares`).
    """
    wave_um = lens.reference_wavelength_um
    ideal_lens = with_ideal_grooves(lens)
    total = len(field_angles_rad) + len(wave_fields_rad) * len(BANDS)
    real: list[Peak] = []
    ideal: list[Peak] = []
    waves: list[WavePeak] = []

    def advance() -> None:
        if progress is not None:
            progress(len(real) + len(waves), total)

    for angle in field_angles_rad:
        ideal.append(measure_peak(ideal_lens, angle, wave_um, pitch_um, rays))
        same = ideal_lens == lens
        real.append(ideal[-1] if same else measure_peak(lens, angle, wave_um, pitch_um, rays))
        advance()
    for angle in wave_fields_rad:
        place_px = measure_peak(lens, angle, wave_um, pitch_um, rays).height_px
        for band in BANDS:
            waves.append(_wave_peak(lens, angle, band, place_px, pitch_um, rays))
            advance()
    return PeakReport(
        lens=lens, pitch_um=pitch_um, real=tuple(real), ideal=tuple(ideal), waves=tuple(waves)
    )


def _wave_peak(
    lens: Lens, angle_rad: float, band: str, place_px: float, pitch_um: float, rays: int
) -> WavePeak:
    pitch_mm = to_mm(pitch_um)
    radii_mm = tuple(radius * pitch_mm for radius in WAVE_RADII_PX)
    by_rays, by_waves = [], []
    for wave_um in band_wavelengths_um(band):
        light = land_light(lens, angle_rad, wave_um, pitch_um, rays)
        by_rays.append([share_within(light, place_px, radius) for radius in WAVE_RADII_PX])
        by_waves.append(wave_shares(lens, angle_rad, wave_um, place_px * pitch_mm, radii_mm))
    return WavePeak(
        field_angle_rad=angle_rad,
        band=band,
        rays=tuple(np.mean(by_rays, axis=0).tolist()),
        waves=tuple(np.mean(by_waves, axis=0).tolist()),
    )


def to_json(report: PeakReport) -> dict[str, Any]:
    """Return the report as plain JSON values."""
    ideal, real = ([p.within_px(10.0) for p in peaks] for peaks in (report.ideal, report.real))
    return {
        "lens": report.lens.name,
        "wavelength_um": report.lens.reference_wavelength_um,
        "pitch_um": report.pitch_um,
        "grooves": grooves_of(report.lens),
        "within_10_px_least": {"ideal": min(ideal), "real": min(real)},
        "within_10_px_ratio": {"ideal": max(ideal) / min(ideal), "real": max(real) / min(real)},
        "fields": [_field(a, b) for a, b in zip(report.ideal, report.real, strict=True)],
        "waves": [
            {
                "field_angle_deg": round(to_degrees(w.field_angle_rad), 9),
                "band": w.band,
                "within_5_px": {"rays": w.rays[0], "waves": w.waves[0]},
                "within_10_px": {"rays": w.rays[1], "waves": w.waves[1]},
            }
            for w in report.waves
        ],
    }


def _field(ideal: Peak, real: Peak) -> dict[str, Any]:
    def both(radius_px: float) -> dict[str, float]:
        return {"ideal": ideal.within_px(radius_px), "real": real.within_px(radius_px)}

    alive = 1 - sum(real.losses.values())
    return {
        "field_angle_deg": round(to_degrees(real.field_angle_rad), 9),
        "peak_px": real.height_px,
        "within_5_px": both(5.0),
        "within_10_px": both(10.0),
        "within_50_px": real.within_px(50.0),
        "beyond_450_px": max(0.0, alive - real.within_px(450.0)),
        "beyond_900_px": max(0.0, alive - real.within_px(900.0)),
        "lost": real.losses,
    }


def to_text(report: dict[str, Any]) -> str:
    """Return the report, as `to_json` has it, as a table."""
    lines = [
        f"surface {g['surface']}: {g['walls']} walls, grooves of {g['groove_depth_um']:.2f} um"
        + (f", narrowest {g['narrowest_mm']:.3f} mm" if g["narrowest_mm"] else "")
        for g in report["grooves"]
    ]
    head = ("field", "peak, px", "5 px", "10 px", "50 px", ">450 px", ">900 px", "10 px ideal")
    lines.append(("{:>9}" * 7 + "{:>13}  lost").format(*head))
    for f in report["fields"]:
        losses = ", ".join(f"{k.replace('_', ' ')} {v:.3f}" for k, v in f["lost"].items())
        near = [f["within_5_px"]["real"], f["within_10_px"]["real"], f["within_50_px"]]
        row = [*near, f["beyond_450_px"], f["beyond_900_px"]]
        shares = "".join(f"{v:9.3f}" for v in row) + f"{f['within_10_px']['ideal']:13.3f}"
        lines.append(f"{f['field_angle_deg']:9.2f}{f['peak_px']:9.1f}{shares}  {losses}".rstrip())
    least, ratio = report["within_10_px_least"], report["within_10_px_ratio"]
    lines += [
        f"within 10 px, least of all fields: {least['real']:.3f} (ideal grooves "
        f"{least['ideal']:.3f}); largest / least {ratio['real']:.2f} ({ratio['ideal']:.2f})"
    ]
    for w in report["waves"]:
        near = w["within_10_px"]
        lines.append(
            f"{w['field_angle_deg']:.2f} degrees, {w['band']}: within 10 px {near['waves']:.3f} by "
            f"waves, {near['rays']:.3f} by rays"
        )
    return "\n".join(lines)
