"""Geometry, light and noise go into a camera with a haze; kernels without its haze do not."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.haze_file import haze_to_bytes
from camkit.bundle.haze_golden import haze_golden_from_bytes
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import HAZE_GOLDEN, STRESS_HAZE, STRESS_PSF, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.calibration.measured_files import FlatFile, GeometryFile
from camkit.errors import DecodeError
from camkit.export.golden_cases import HAZE_SCENE
from camkit.export.remeasured import Measured, remeasured
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from camkit.runtime.proof.haze_band import make_haze_golden
from tests.bundle_factory import tiny_psf
from tests.haze_bundle import hazy_manifest, hazy_optics, write_hazy_bundle
from tests.haze_factory import tiny_haze

CENTRE = (50.0, 30.0)


def test_kernels_of_another_lens_are_refused_beside_a_haze(tmp_path: Path) -> None:
    bundle, out = write_hazy_bundle(tmp_path), tmp_path / "new.camkit"
    with pytest.raises(DecodeError, match="haze of tiny belongs to its kernels; leave psf out"):
        remeasured(bundle, Measured(psf=tiny_psf()), out)
    assert not out.exists()


def test_geometry_and_flat_move_the_haze_with_its_cores(tmp_path: Path) -> None:
    camera, out = tmp_path / "near.camkit", tmp_path / "new.camkit"
    nearer = {STRESS_PSF: psf_to_bytes(tiny_psf()), STRESS_HAZE: haze_to_bytes(tiny_haze())}
    write_bundle(camera, hazy_manifest(), hazy_optics().members | nearer)
    bundle = open_bundle(camera)
    geometry = GeometryFile.model_validate(
        {
            "width_px": 96,
            "height_px": 64,
            "model": "radial_2",
            "centre_px": CENTRE,
            "covered_radius_px": 80.0,
            "radial": {
                "coefficients": [1.0, -0.02, 0.0, 0.0],
                "radius_px": 57.7,
                "residual_px": 0.02,
            },
        }
    )
    flat = FlatFile.model_validate(
        {
            "heights_mm": [0.0, 0.2, 0.4],
            "relative_illumination": [1.0, 0.85, 0.7],
            "pixel_pitch_um": 6.0,
            "centre_px": CENTRE,
            "centre_found": True,
            "separated": True,
        }
    )
    remeasured(bundle, Measured(geometry=geometry, flat=flat), out)
    made = open_bundle(out)
    assert not nearer.keys() & set(made.names), "they are of the camera as designed"
    assert made.manifest.format_version == bundle.manifest.format_version
    assert made.manifest.sensor.known_extent.optical_centre_px == CENTRE
    np.testing.assert_allclose(made.distortion.row(0), [1.0, -0.02, 0, 0])
    assert made.psf.relative_illumination[-1] == pytest.approx(0.7)
    np.testing.assert_array_equal(made.haze.kernels, bundle.haze.kernels)
    case = haze_golden_from_bytes(made.member(HAZE_GOLDEN), what=HAZE_GOLDEN)
    before = make_haze_golden(bundle, HAZE_SCENE)
    np.testing.assert_array_equal(case.cells, before.cells)
    assert np.abs(case.gain - before.gain).max() > 0.01
    report = check_bundle(out, run=case_work)
    assert report.passed, report.lines()
