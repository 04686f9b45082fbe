"""The tables of compared lenses, from made-up numbers."""

from typing import Any

import pytest

from tools.tables.lenses.lens_page import lens_table, mean_and_spread

Entry = dict[str, Any]


def _scored(db: list[list[float]]) -> Entry:
    ssim = [[value / 40 for value in row] for row in db]
    return {"db": db, "ssim": ssim}


def _report(**changes: Any) -> Entry:
    capture = _scored([[20.0, 10.0]])
    lens = {
        "window_px": 201,
        "held": [[1.0, 0.25]],
        "arriving": [[1.0, 0.5]],
        "rms_um": [[10.0, 640.0]],
        "capture": capture,
        "recovered": [
            _scored([[24.0, 14.0]]),
            _scored([[26.0, 16.0]]),
        ],
    }
    report = {
        "recipe": "strip",
        "front": "none",
        "network": "lean_s",
        "steps": 10,
        "f_number": 4.0,
        "object_mm": 1000.0,
        "depths_mm": [1000.0],
        "field_angles_deg": [0.0, 30.0],
        "recovered_px": 128,
        "lenses": {"one": lens},
    }
    return {**report, **changes}


def test_seeds_are_averaged_and_their_spread_is_that_of_their_means() -> None:
    found = _report()["lenses"]["one"]["recovered"]
    assert mean_and_spread(found, "db") == pytest.approx((20.0, 1.0))


def test_page_gives_quality_by_field_and_light() -> None:
    page = lens_table(_report())
    assert "| one | 15.00 | 0.375 | - | 20.00 ± 1.00 | 0.500 ± 0.025 |" in page
    assert "| lens | 0° | 30° |" in page
    assert "| one | 25.00 | 15.00 |" in page
    assert "| one | 201 | 25% | 50% | 640 |" in page
    assert "mars" not in page


def test_several_depths_are_told_with_their_spread() -> None:
    report = _report(depths_mm=[500.0, 1000.0])
    report["lenses"]["one"]["recovered"] = [_scored([[18.0, 20.0], [24.0, 25.0]])]
    page = lens_table(report)
    assert "| lens | 500 mm | 1000 mm | spread |" in page
    assert "| one | 19.00 | 24.50 | 5.50 |" in page


def test_a_wiener_filter_that_is_narrower_than_a_psf_is_told() -> None:
    assert "128 px: too few for the PSFs of one" in lens_table(_report(front="wiener"))
