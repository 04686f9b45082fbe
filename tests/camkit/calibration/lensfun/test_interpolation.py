"""Entries between those measured."""

from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.lensfun.database import Database, Lens
from camkit.calibration.lensfun.interpolation import distortion_at, vignetting_at
from camkit.errors import DecodeError
from tests.lensfun_factory import TERMS, ZOOM, write_database


@pytest.fixture
def lens(tmp_path: Path) -> Lens:
    return Database(write_database(tmp_path)).find(ZOOM)[0]


def _lens(tmp_path: Path, entries: str) -> Lens:
    text = f"<lens><model>X</model><calibration>{entries}</calibration></lens>"
    return Database(write_database(tmp_path, text)).find("X")[0]


def test_measured_focal_lengths_are_taken_as_they_stand(lens: Lens) -> None:
    for focal_mm, terms in TERMS.items():
        assert distortion_at(lens, focal_mm).terms == terms


def test_terms_that_fall_as_one_over_the_focal_length_are_met_between(tmp_path: Path) -> None:
    entries = "".join(
        f'<distortion model="poly3" focal="{focal}" k1="{0.9 / focal}"/>' for focal in (20, 30, 60)
    )
    found = distortion_at(_lens(tmp_path, entries), 41.0)
    assert found.terms[0] == pytest.approx(0.9 / 41, rel=1e-12)


def test_the_cubic_is_that_of_catmull_and_rom(lens: Lens) -> None:
    """Between the first two: values and slopes of the products, by the Hermite basis."""
    products = np.array([np.array(terms) * focal for focal, terms in TERMS.items()])
    t = (30.0 - 24) / (35 - 24)
    h = [2 * t**3 - 3 * t**2 + 1, t**3 - 2 * t**2 + t, -2 * t**3 + 3 * t**2, t**3 - t**2]
    left, right = products[1] - products[0], (products[2] - products[0]) / 2
    wanted = (h[0] * products[0] + h[1] * left + h[2] * products[1] + h[3] * right) / 30
    np.testing.assert_allclose(distortion_at(lens, 30.0).terms, wanted, rtol=1e-12)


def test_what_was_not_measured_is_refused_but_for_rounding(lens: Lens) -> None:
    for focal_mm in (23.0, 71.0):
        with pytest.raises(DecodeError, match=r"was measured at 24 to 70 mm; got"):
            distortion_at(lens, focal_mm)
    assert distortion_at(lens, 23.9).focal_mm == 24.0
    assert distortion_at(lens, 70.4).focal_mm == 70.0


def test_the_first_model_counts_and_the_first_entry(tmp_path: Path) -> None:
    entries = (
        '<distortion model="poly3" focal="20" k1="0.1"/>'
        '<distortion model="poly3" focal="20" k1="0.2"/>'
        '<distortion model="ptlens" focal="30" a="0.1"/>'
    )
    lens = _lens(tmp_path, entries)
    assert distortion_at(lens, 20.0).terms == (0.1,)
    with pytest.raises(DecodeError, match="measured at 20 mm"):
        distortion_at(lens, 30.0)


@pytest.mark.parametrize(
    ("focal_mm", "aperture", "distance_m", "expected"),
    [
        (24.0, 2.8, None, (24.0, 2.8)),
        (26.0, 7.0, 100.0, (24.0, 8.0)),
        (60.0, 8.0, None, (70.0, 8.0)),
        (24.0, None, None, (24.0, 8.0)),
    ],
)
def test_vignetting_is_the_nearest(
    lens: Lens,
    focal_mm: float,
    aperture: float | None,
    distance_m: float | None,
    expected: tuple[float, float],
) -> None:
    found = vignetting_at(lens, focal_mm, aperture, distance_m)
    assert found is not None
    assert (found.focal_mm, found.aperture) == expected
