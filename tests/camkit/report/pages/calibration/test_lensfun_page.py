"""The page of a lens of lensfun's: its curves are those of the files."""

from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.lensfun.entry import EntryOptions, lensfun_entry
from camkit.calibration.lensfun.ordinary import CameraOptions, lensfun_bundle
from camkit.calibration.record import to_toml
from camkit.report.pages.calibration.lensfun_page import curves_of_bundle, curves_of_entry, draw
from tests.camkit.calibration.lensfun.test_entry import GEOMETRY
from tests.lensfun_factory import ZOOM, write_database, write_shot


def test_the_largest_miss_of_an_entry_is_the_one_it_states(tmp_path: Path) -> None:
    path = tmp_path / "camera.toml"
    path.write_text(to_toml(GEOMETRY), encoding="utf-8")
    made = lensfun_entry(path, EntryOptions(focal_mm=10.0, crop_factor=2.0))
    curves = curves_of_entry(made)
    assert np.abs(curves.missed_px).max() == pytest.approx(made.fit.residual_px, rel=0.05)
    coefficients, radius_px = GEOMETRY["radial"]["coefficients"], GEOMETRY["radial"]["radius_px"]
    r = curves.radius_px / radius_px
    placed = radius_px * sum(c * r ** (2 * n + 1) for n, c in enumerate(coefficients))
    np.testing.assert_allclose(curves.moved_px, placed - curves.radius_px, atol=1e-3)
    assert curves.light is None
    assert len(draw(curves).axes) == 2


def test_a_bundle_misses_nothing_of_the_formula(tmp_path: Path) -> None:
    shot = write_shot(tmp_path / "shot.dng")
    options = CameraOptions(focal_mm=24.0, aperture=4.0, crop_factor=1.0)
    made = lensfun_bundle(write_database(tmp_path), ZOOM, shot, options)
    curves = curves_of_bundle(made)
    assert np.abs(curves.missed_px).max() < 1e-6
    assert np.abs(curves.moved_px).max() > 1
    assert curves.light is not None
    assert curves.light[0] == pytest.approx(1)
    assert (np.diff(curves.light) < 0).all()
    assert [panel.get_ylabel() for panel in draw(curves).axes] == [
        "moved, px",
        "missed, px",
        "relative illumination",
    ]
