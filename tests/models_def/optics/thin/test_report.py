"""What is said of peaks."""

import math

import pytest

from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.thin.report import (
    band_wavelengths_um,
    report_peaks,
    to_json,
    to_text,
    with_ideal_grooves,
    with_midpoints,
)
from tests.thin_factory import perfect_lens


def test_middles_stand_between_the_fields() -> None:
    assert with_midpoints([0.0, 0.2, 0.3]) == pytest.approx((0.0, 0.1, 0.2, 0.25, 0.3))


def test_bands_lie_about_their_colour() -> None:
    for band, centre in (("blue", 0.46), ("green", 0.54), ("red", 0.60)):
        waves = band_wavelengths_um(band)
        assert len(waves) == 6
        assert sum(waves) / 6 == pytest.approx(centre)
        assert max(waves) - min(waves) < 0.09


def test_shares_add_up_and_lost_light_is_no_haze() -> None:
    lens = perfect_lens(50.0, 10.0, grooves=Grooves(depth_um=100.0))
    report = report_peaks(lens, [0.0, 0.2], 6.0, rays=4000)
    told = to_json(report)
    assert told["grooves"][0]["surface"] == 2
    for field in told["fields"]:
        lost = sum(field["lost"].values())
        assert field["within_50_px"] + lost <= 1 + 1e-9
        assert 0 <= field["beyond_900_px"] <= field["beyond_450_px"] <= 1 - lost + 1e-9
        assert field["within_10_px"]["real"] <= field["within_10_px"]["ideal"] + 0.02
    assert told["fields"][1]["lost"]["groove_wall"] > 0
    ideal = told["within_10_px_least"]["ideal"]
    assert f"ideal grooves {ideal:.3f}" in to_text(told)


def test_a_lens_without_walls_is_measured_once() -> None:
    lens = with_ideal_grooves(perfect_lens(50.0, 5.0, grooves=Grooves(depth_um=100.0)))
    report = report_peaks(lens, [0.0], 6.0, rays=1000)
    assert report.real[0] is report.ideal[0]


def test_rays_and_waves_of_a_blur_agree() -> None:
    """A defocus of many waves: diffraction only softens its rim."""
    done: list[tuple[int, int]] = []
    report = report_peaks(
        perfect_lens(50.0, 5.0, defocus_mm=0.5),
        [0.0],
        5.0,
        wave_fields_rad=[0.0],
        rays=4000,
        progress=lambda *told: done.append(told),
    )
    assert done == [(1, 4), (2, 4), (3, 4), (4, 4)]
    for peak in report.waves:
        assert peak.waves[1] == pytest.approx(peak.rays[1], abs=0.03), peak.band
        assert math.isclose(peak.field_angle_rad, 0.0)
    assert "green: within 10 px" in to_text(to_json(report))
