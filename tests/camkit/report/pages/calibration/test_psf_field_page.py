"""The page of imported kernels draws them where they lie, as they point."""

import numpy as np
import pytest

from camkit.calibrate import import_psf
from camkit.calibration.psf_import.psf_facts import places_text
from camkit.report.pages.calibration.psf_field_page import draw_field, draw_impulse, psf_field_html
from tests.psf_files import SIDE, counts


def _import(tmp_path, kernels, **options):
    np.save(tmp_path / "psf.npy", kernels)
    return import_psf(tmp_path / "psf.npy", pitch_um=2.5, **options)


@pytest.mark.parametrize(
    ("kernels", "options"),
    [
        (counts(), {"span_mm": "9x6"}),
        (counts()[:1], {"span_mm": "9x0"}),
        (counts()[0, 0], {}),
        (counts()[:1], {"heights_mm": "0,1,2,4"}),
        (counts()[:, :, :1], {"x_mm": "-3,-1,1,3", "y_mm": "-1,0,1"}),
    ],
    ids=["grid", "row", "uniform", "radial", "grey"],
)
def test_every_symmetry_has_its_page(tmp_path, kernels, options):
    result = _import(tmp_path, kernels, **options)
    html = psf_field_html(result, "psf.npy")
    assert html.count("data:image/png") == 2
    assert f"psf.npy: {places_text(result.psf)}." in html


def test_rows_run_down_and_columns_right(tmp_path):
    """Up left only green, below right only red: so they are drawn."""
    kernels = np.zeros((2, 2, 3, SIDE, SIDE)) + 1e-9
    kernels[..., 5, 5] = 1
    kernels[0, 0, 1, 5, 8] = 50
    kernels[1, 1, 0, 8, 5] = 50
    psf = _import(tmp_path, kernels, span_mm="4x2").psf
    images = draw_field(psf).axes[0].images
    upper_left, *_, lower_right = images
    left, right, bottom, top = upper_left.get_extent()
    assert left < right < 0
    assert top < bottom < 0
    # green, three samples right of the middle; red, three below
    assert np.asarray(upper_left.get_array())[5, 8].tolist() == pytest.approx([0, 1, 0], abs=0.2)
    assert np.asarray(lower_right.get_array())[8, 5].tolist() == pytest.approx([1, 0, 0], abs=0.2)
    point = np.asarray(draw_impulse(psf).axes[0].images[0].get_array())
    assert point[5, 8, 1] > point[8, 5, 0]
