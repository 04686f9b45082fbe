"""`camkit calibrate bundle`: measured parts in a copy of a bundle, which proves itself."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.psf_file import write_psf
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.calibration.record import to_toml
from camkit.cli.exit_code import ExitCode
from camkit.psf import FrozenPsf
from camkit.radial import RadialDistortion
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.proof.check import check_bundle
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import write_tiny_bundle
from tests.plain_bundle import write_networkless_bundle
from tests.profile_bundle import profile_manifest

GEOMETRY: dict[str, Any] = {
    "width_px": 96,
    "height_px": 64,
    "model": "radial_2",
    "centre_px": [50.0, 30.0],
    "covered_radius_px": 80.0,
    "radial": {"coefficients": [1.0, -0.02, 0.0, 0.0], "radius_px": 57.7, "residual_px": 0.02},
}
FLAT: dict[str, Any] = {
    "heights_mm": [0.0, 0.2, 0.4],
    "relative_illumination": [1.0, 0.85, 0.7],
    "pixel_pitch_um": 6.0,
    "centre_px": [40.0, 33.0],
    "centre_found": True,
    "separated": True,
}
NOISE: dict[str, Any] = {
    "iso": [
        {
            "iso": iso,
            "gain_e_per_dn": 800 / iso,
            "read_noise_e": 2.0,
            "read_noise_resolved": iso > 100,
            "full_well_e": 800 / iso * 900,
            "black_level": 100.0,
            "white_level": 1000.0,
        }
        for iso in (400.0, 100.0)
    ]
}


def measured_point() -> FrozenPsf:
    """Give kernels as `camkit calibrate psf` writes them: one place, three colours."""
    x = np.arange(-3, 4)
    kernels = np.stack([np.exp(-(x**2 + x[:, None] ** 2) / s) for s in (1.0, 1.3, 1.6)])
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True)
    return FrozenPsf(
        kernels=kernels[None, None].astype(np.float32),
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array([0.46, 0.54, 0.60]),
        pixel_pitch_um=6.0,
        distortion=RadialDistortion(coefficients=np.array([[1.0, 0, 0, 0]]), radius_mm=1.0),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )


def write_part(folder: Path, name: str, record: dict[str, Any]) -> Path:
    path = folder / f"{name}.toml"
    path.write_text(to_toml(record), encoding="utf-8")
    return path


def _proves_itself(path: Path) -> Bundle:
    report = check_bundle(path, run=case_work)
    assert report.passed, report.lines()
    return open_bundle(path)


def test_geometry_flat_and_noise_are_put_into_a_copy(camkit_command, tmp_path: Path) -> None:
    source, out = write_tiny_bundle(tmp_path), tmp_path / "mine.camkit"
    page = tmp_path / "pages" / "mine.html"
    parts = {"geometry": GEOMETRY, "flat": FLAT, "noise": NOISE}
    words = [w for n, record in parts.items() for w in (f"--{n}", write_part(tmp_path, n, record))]
    done = camkit_command(
        "calibrate", "bundle", source, *words, "-o", out, "--page", page, "--json"
    )
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["page"] == str(page)
    assert "<h2>Noise</h2>" in page.read_text(encoding="utf-8")
    assert (told["model"], told["residual_px"], told["out"]) == ("radial_2", 0.02, str(out))
    assert told["networks"] == ["M"]
    assert told["golden"] == ["typical", "saturated", "very_dark"]
    assert any("not resolved" in note for note in told["notes"])
    made = _proves_itself(out)
    sensor = made.manifest.sensor
    assert sensor.known_extent.optical_centre_px == (50.0, 30.0)
    assert (sensor.black_level, sensor.white_level, sensor.full_well_e) == (100, 1000, 7200)
    assert [one.iso for one in sensor.noise] == [100, 400]
    np.testing.assert_allclose(made.distortion.row(0), [1.0, -0.02, 0, 0])
    assert made.distortion.radius_mm == pytest.approx(57.7 * 0.006)
    np.testing.assert_allclose(made.psf.relative_illumination, [1.0, 0.7])
    assert "card.md" not in made.names
    assert camkit_command("calibrate", "bundle", source, *words, "-o", out).code == ExitCode.USAGE


def test_isos_that_nobody_measured_again_are_named(camkit_command, tmp_path: Path) -> None:
    source, out = write_tiny_bundle(tmp_path), tmp_path / "mine.camkit"
    before = [one.iso for one in open_bundle(source).manifest.sensor.noise]
    record = {**NOISE, "iso": [one for one in NOISE["iso"] if one["iso"] == 400]}
    noise = write_part(tmp_path, "noise", record)
    done = camkit_command("calibrate", "bundle", source, "--noise", noise, "-o", out, "--json")
    assert done.code == 0, done.err
    known = f"noise is known at ISO 400 to 400 now, at {before[0]:g} to {before[-1]:g} before"
    assert known in json.loads(done.out)["notes"]


def test_without_geometry_the_centre_is_that_of_the_flat(camkit_command, tmp_path: Path) -> None:
    source, out = write_tiny_bundle(tmp_path), tmp_path / "mine.camkit"
    done = camkit_command(
        "calibrate", "bundle", source, "--flat", write_part(tmp_path, "flat", FLAT), "-o", out
    )
    assert done.code == 0, done.err
    assert "tiny with flat as measured" in done.out
    assert _proves_itself(out).manifest.sensor.known_extent.optical_centre_px == (40.0, 33.0)
    assert "the flat is known to" not in done.err


def test_a_flat_that_ends_before_the_corner_says_so(camkit_command, tmp_path: Path) -> None:
    short = FLAT | {"heights_mm": [0.0, 0.1, 0.3], "width_px": 96, "height_px": 64}
    words = ("--flat", write_part(tmp_path, "flat", short), "-o", tmp_path / "mine.camkit")
    done = camkit_command("calibrate", "bundle", write_tiny_bundle(tmp_path), *words)
    assert done.code == 0, done.err
    assert "the flat is known to 0.3 mm of 0.385 from the centre" in done.err


@pytest.mark.parametrize("keep", [True, False])
def test_other_kernels_leave_networks_out_unless_they_are_kept(
    camkit_command, tmp_path: Path, keep: bool
) -> None:
    psf = measured_point()
    path, out = tmp_path / "point.safetensors", tmp_path / "mine.camkit"
    write_psf(path, psf)
    more = ("--keep-networks",) if keep else ()
    words = ("calibrate", "bundle", write_tiny_bundle(tmp_path), "--psf", path, "-o", out)
    done = camkit_command(*words, *more, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["networks"] == (["M"] if keep else [])
    assert any("light is not evened" in note for note in told["notes"])
    made = _proves_itself(out)
    np.testing.assert_allclose(made.psf.kernels, psf.kernels)
    assert made.manifest.optics is not None
    assert made.manifest.optics.symmetry == "uniform"
    # red, the first channel, sees the kernel of the longest wavelength and no other
    seen = color_kernels(made.psf, *made.manifest.sensor.response_arrays()).kernels
    np.testing.assert_allclose(seen[0], psf.kernels[0, 0, ::-1], atol=1e-5)
    types = [stage.type for stage in made.manifest.stages]
    assert "illumination" not in types
    assert ("network" in types) == keep
    # the distortion is that of before
    np.testing.assert_allclose(made.distortion.row(1), [1.0, -0.01, 0, 0])
    flat = write_part(tmp_path, "flat", FLAT)
    done = camkit_command(*words, "--flat", flat, "--overwrite")
    assert done.code == 1
    assert "kernels of one place hold no vignetting" in done.err


def test_a_bundle_without_networks_gets_golden_cases(camkit_command, tmp_path: Path) -> None:
    source, out = write_networkless_bundle(tmp_path).path, tmp_path / "mine.camkit"
    words = ("--noise", write_part(tmp_path, "noise", NOISE))
    done = camkit_command("calibrate", "bundle", source, *words, "-o", out)
    assert done.code == 0, done.err
    report = check_bundle(out, run=case_work)
    golden = next(layer for layer in report.layers if layer.name == "golden")
    assert (golden.status, report.passed) == ("pass", True)


def test_a_lens_profile_takes_what_was_measured(camkit_command, tmp_path: Path) -> None:
    source, out = tmp_path / "plain.camkit", tmp_path / "mine.camkit"
    write_bundle(source, profile_manifest(), {})
    parts = {"geometry": GEOMETRY, "flat": FLAT}
    words = [w for n, record in parts.items() for w in (f"--{n}", write_part(tmp_path, n, record))]
    done = camkit_command("calibrate", "bundle", source, *words, "-o", out)
    assert done.code == 0, done.err
    made = _proves_itself(out)
    np.testing.assert_allclose(made.distortion.row(2), [1.0, -0.02, 0, 0])
    assert made.illumination.light.tolist() == [1.0, 0.85, 0.7]


REFUSED: dict[str, tuple[str, dict[str, Any], str]] = {
    "another size": ("geometry", GEOMETRY | {"width_px": 100}, "is of 100x64 px, the sensor has"),
    "a fold": (
        "geometry",
        GEOMETRY | {"radial": GEOMETRY["radial"] | {"coefficients": [1.0, -0.9, 0.0, 0.0]}},
        "the geometry cannot be undone",
    ),
    "another command's file": ("geometry", FLAT, "is not what `camkit calibrate geometry` writes"),
    "heights that fall": (
        "flat",
        FLAT | {"heights_mm": [0.0, 0.4, 0.2]},
        "is not what `camkit calibrate flat` writes",
    ),
    "a flat of another size": (
        "flat",
        FLAT | {"width_px": 192, "height_px": 128},
        "the flat is of 192x128 px, the sensor has 96x64",
    ),
    "a centre outside": (
        "flat",
        FLAT | {"centre_px": [5000.0, 3.0]},
        "the optical centre (5000, 3) lies outside of the sensor of 96x64 px",
    ),
    "another pitch": ("flat", FLAT | {"pixel_pitch_um": 3.0}, "pixels of 3 um, the sensor has 6"),
    "an ISO twice": ("noise", {"iso": NOISE["iso"][:1] * 2}, "an ISO is stated twice"),
    "white below black": (
        "noise",
        {"iso": [NOISE["iso"][0] | {"white_level": 90.0}]},
        "ISO 400 has its white level 90 not above its black level 100",
    ),
    "no noise": ("noise", {"camera": "x"}, "is not what `camkit calibrate noise` writes"),
}


@pytest.mark.parametrize(("name", "record", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_does_not_fit_is_refused_in_one_line(
    camkit_command, tmp_path: Path, name: str, record: dict[str, Any], message: str
) -> None:
    source, out = write_tiny_bundle(tmp_path), tmp_path / "mine.camkit"
    words = (f"--{name}", write_part(tmp_path, name, record), "-o", out)
    done = camkit_command("calibrate", "bundle", source, *words)
    assert done.code == 1
    assert message in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not out.exists()


def test_wrong_options_are_usage_and_damaged_kernels_an_input(
    camkit_command, tmp_path: Path
) -> None:
    words = ("calibrate", "bundle", write_tiny_bundle(tmp_path), "-o", tmp_path / "mine.camkit")
    assert camkit_command(*words).code == ExitCode.USAGE
    noise = write_part(tmp_path, "noise", NOISE)
    assert camkit_command(*words, "--noise", noise, "--keep-networks").code == ExitCode.USAGE
    path = tmp_path / "point.safetensors"
    path.write_bytes(b"no tensors")
    assert camkit_command(*words, "--psf", path).code == 1
