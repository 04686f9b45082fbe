"""`camkit calibrate lensfun-in` and `lensfun-out`: bundles that work, and there and back."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.calibration.lensfun.ordinary import CameraOptions, lensfun_bundle
from camkit.calibration.record import to_toml
from camkit.cli.exit_code import ExitCode
from camkit.report.kind_finder import check_photographs
from camkit.runtime.geometry.distortion import distort_points
from camkit.runtime.proof.check import check_bundle
from tests.bundle_factory import write_tiny_bundle
from tests.camkit.calibration.lensfun.test_entry import GEOMETRY
from tests.data_folder import data_path
from tests.lensfun_factory import ZOOM, write_database, write_shot

AGREES_PX = 1e-3
SIZE = (240, 160)


@pytest.fixture
def asked(tmp_path: Path) -> list[Any]:
    shot = write_shot(tmp_path / "shot.dng")
    db = write_database(tmp_path)
    return ["calibrate", "lensfun-in", db, "--capture", shot, "-o", tmp_path / "zoom.camkit"]


def test_a_bundle_of_a_lens_is_made_and_passes_its_check(
    camkit_command, asked: list[Any], tmp_path: Path
) -> None:
    done = camkit_command(*asked, "--lens", ZOOM, "--focal-mm", 24, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert (told["model"], told["focal_mm"], told["crop_factor"]) == ("ptlens", 24.0, 1.0)
    assert told["terms"] == {"a": 0.02, "b": -0.06, "c": 0.03}
    assert told["residual_px"] < AGREES_PX
    assert (told["vignetting"]["aperture"], told["out"]) == (2.8, str(tmp_path / "zoom.camkit"))
    assert any("that of the Box 2 in the database" in note for note in told["notes"])
    bundle = open_bundle(tmp_path / "zoom.camkit")
    assert bundle.manifest.format_version == "2.6"
    assert bundle.manifest.name == "zoom"
    assert bundle.manifest.sensor.known_extent.width_px == SIZE[0]
    assert bundle.manifest.sensor.black_level == 256
    assert check_bundle(bundle.path).passed
    # crop 1.5: the unit is half the shorter side of a sensor 1.5 times as large
    pitch_mm = bundle.manifest.sensor.pixel_pitch_um * 1e-3
    assert bundle.distortion.radius_mm / pitch_mm == pytest.approx(1.5 * 80)
    again = camkit_command(*asked, "--lens", ZOOM, "--focal-mm", 24)
    assert again.code == ExitCode.USAGE
    done = camkit_command(*asked, "--lens", ZOOM, "--focal-mm", 24, "--overwrite")
    assert done.code == 0
    assert f"{ZOOM}, ptlens at 24 mm, light evened as at f/2.8" in done.out


def test_python_gives_the_bundle_of_the_command(camkit_command, tmp_path: Path) -> None:
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    options = CameraOptions(focal_mm=24.0, aperture=4.0, crop_factor=1.4, scale=1.0)
    made = lensfun_bundle(database, ZOOM, shot, options, name="own")
    write_bundle(tmp_path / "python.camkit", made.manifest, {})
    done = camkit_command(
        *("calibrate", "lensfun-in", database, "--lens", ZOOM, "--capture", shot, "--json"),
        *("--focal-mm", 24, "--aperture", 4, "--crop-factor", 1.4, "--scale", 1),
        *("-o", tmp_path / "own.camkit"),
    )
    assert done.code == 0, done.err
    assert (tmp_path / "python.camkit").read_bytes() == (tmp_path / "own.camkit").read_bytes()
    told = json.loads(done.out)
    assert told.pop("out") == str(tmp_path / "own.camkit")
    assert told == json.loads(json.dumps(made.to_record()))


def test_processing_evens_and_straightens_as_lensfun_says(
    camkit_command, asked: list[Any], tmp_path: Path
) -> None:
    """A spot, dimmed by the lens: lighter by the formula, and where the formula says."""
    x0, y0 = 200, 130
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    spot = 256 + 2500 * np.exp(-((x - x0) ** 2 + (y - y0) ** 2) / 18)
    shot = write_shot(tmp_path / "spot.dng", spot)
    assert camkit_command(*asked, "--lens", ZOOM, "--focal-mm", 24, "--scale", 1).code == 0
    straight: dict[str, Any] = {}
    for name, more in {"on": (), "off": ("--no-undistort", "--no-vignetting")}.items():
        folder = tmp_path / name
        words = ("process", shot, "--bundle", tmp_path / "zoom.camkit", "--out-dir", folder, *more)
        done = camkit_command(*words, "--format", "tiff", "--linear")
        assert done.code == 0, done.err
        import tifffile

        grey = tifffile.imread(folder / "spot.tif")[..., 1].astype(float)
        grey[grey < 0.05 * grey.max()] = 0
        straight[name] = [float((grey * axis).sum() / grey.sum()) for axis in (x, y)]
        straight[f"{name} light"] = grey.sum()
    unit_px, corner_px = 1.5 * 80, 1.5 * np.hypot(*SIZE) / 2
    middle = (np.array(SIZE) - 1) / 2
    away = np.array(straight["on"]) - middle
    r = np.hypot(*away) / unit_px
    placed = 0.02 * r**4 - 0.06 * r**3 + 0.03 * r**2 + 1.01 * r
    np.testing.assert_allclose(middle + away * placed / r, straight["off"], atol=0.1)
    assert np.hypot(*(np.array(straight["on"]) - straight["off"])) > 0.3
    h = np.hypot(x0 - middle[0], y0 - middle[1]) / corner_px
    light = 1 - 0.9 * h**2 + 0.3 * h**4 - 0.1 * h**6
    stretch = (r / placed) * 1 / (0.08 * r**3 - 0.18 * r**2 + 0.06 * r + 1.01)
    assert straight["on light"] / straight["off light"] == pytest.approx(stretch / light, rel=0.02)


def test_a_bundle_without_kernels_is_not_photographed_with(
    camkit_command, asked: list[Any], tmp_path: Path
) -> None:
    assert camkit_command(*asked, "--lens", ZOOM, "--focal-mm", 24).code == 0
    manifest = open_bundle(tmp_path / "zoom.camkit").manifest
    with pytest.raises(ValueError, match="states a lens profile without kernels"):
        check_photographs(manifest, "x")
    words = ("simulate", "procedural:1", "--bundle", tmp_path / "zoom.camkit")
    done = camkit_command(*words, "-o", tmp_path / "x.dng")
    assert done.code != 0
    assert "Traceback" not in done.err
    assert not (tmp_path / "x.dng").exists()


REFUSED = {
    "no such lens": (("Sharp 24-70", 24), (), "near: Sharp 24-70mm f/2.8"),
    "not so long": ((ZOOM, 100), (), "was measured at 24 to 70 mm; got 100 mm"),
    "no distortion": (("Unmeasured 50mm", 50), (), "has no distortion of Unmeasured 50mm"),
    "one that folds": (
        ("Folding 8mm", 8),
        ("--crop-factor", 1),
        "Folding 8mm at 8 mm (poly3) folds back inside",
    ),
    "a smaller sensor": (("Small 50mm", 50), (), "was measured with crop factor 2"),
}


@pytest.mark.parametrize(("lens", "more", "message"), REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_is_refused_in_one_line(
    camkit_command,
    asked: list[Any],
    tmp_path: Path,
    lens: tuple[str, float],
    more: tuple[Any, ...],
    message: str,
) -> None:
    done = camkit_command(*asked, "--lens", lens[0], "--focal-mm", lens[1], *more)
    assert done.code == 1
    assert message in done.err
    assert len(done.err.strip().splitlines()) == 1
    assert not (tmp_path / "zoom.camkit").exists()


def test_malformed_files_and_unknown_cameras_are_refused(
    camkit_command, asked: list[Any], tmp_path: Path
) -> None:
    unknown = write_shot(tmp_path / "unknown.dng", model="Box 9")
    words = [*asked, "--lens", ZOOM, "--focal-mm", 24]
    words[4] = unknown
    done = camkit_command(*words)
    assert done.code == 1
    assert "add --crop-factor" in done.err
    assert camkit_command(*words, "--crop-factor", 1.5).code == 0
    (asked[2] / "zz.xml").write_text("<lensdatabase>", encoding="utf-8")
    done = camkit_command(*words, "--overwrite")
    assert done.code == 1
    assert "zz.xml is no sound XML" in done.err


@pytest.mark.parametrize(
    "more", [("--focal-mm", 0), ("--focal-mm", 24, "--crop-factor", -1), ("--focal-mm", "nan")]
)
def test_wrong_options_are_usage(camkit_command, asked: list[Any], more: tuple[Any, ...]) -> None:
    assert camkit_command(*asked, "--lens", ZOOM, *more).code == ExitCode.USAGE


def _placed_px(path: Path, scale: float = 1.0) -> np.ndarray:
    """Give the distorted radii of ideal ones, in pixels, as a bundle has them.

    Args:
        path: The bundle.
        scale: By which its ideal picture is larger.
    """
    bundle = open_bundle(path)
    pitch_mm = bundle.manifest.sensor.pixel_pitch_um * 1e-3
    radii = np.linspace(0, 140, 100) * scale * pitch_mm
    points = np.stack([radii, radii * 0], axis=-1)
    return distort_points(points, bundle.distortion, channel=1)[:, 0] / pitch_mm


@pytest.mark.parametrize(
    ("lens", "focal_mm", "crop_factor", "scaled"),
    [
        (ZOOM, 24, 1, False),
        (ZOOM, 50, 1, False),
        (ZOOM, 24, 2, True),
        ("Small 50mm", 50, 2, False),
    ],
)
def test_out_and_in_again_agree(
    camkit_command,
    asked: list[Any],
    tmp_path: Path,
    lens: str,
    focal_mm: float,
    crop_factor: float,
    scaled: bool,
) -> None:
    """On another sensor than measured, ptlens has another scale: its 1 lies elsewhere."""
    crop = ("--crop-factor", crop_factor, "--scale", 1)
    assert camkit_command(*asked, "--lens", lens, "--focal-mm", focal_mm, *crop).code == 0
    made = tmp_path / "zoom.camkit"
    words = ("calibrate", "lensfun-out", made, "-o", tmp_path / "own.xml")
    said = ("--focal-mm", focal_mm, "--lens-name", "Own lens", "--aperture", 2.8, "--json")
    done = camkit_command(*words, *said)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["residual_px"] < AGREES_PX
    assert told["crop_factor"] == pytest.approx(crop_factor)
    assert (abs(told["scale"] - 1) > 1e-3) == scaled
    again = [*asked, "--lens", "Own lens", "--focal-mm", focal_mm, *crop]
    again[2] = tmp_path / "own.xml"
    back = [tmp_path / "back.camkit" if word == made else word for word in again]
    done = camkit_command(*back)
    assert done.code == 0, done.err
    np.testing.assert_allclose(
        _placed_px(tmp_path / "back.camkit", told["scale"]), _placed_px(made), atol=AGREES_PX
    )
    if lens == ZOOM:
        there, here = (open_bundle(p).illumination for p in (made, tmp_path / "back.camkit"))
        np.testing.assert_allclose(here.light, there.light, atol=1e-4)


def test_a_traced_lens_goes_out_and_comes_in_but_for_its_scale(
    camkit_command, asked: list[Any], tmp_path: Path
) -> None:
    words = ("calibrate", "lensfun-out", write_tiny_bundle(tmp_path), "-o", tmp_path / "own.xml")
    done = camkit_command(*words, "--focal-mm", 10, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["model"] == "poly3"
    assert told["residual_px"] < AGREES_PX
    assert "vignetting is left out: it needs --aperture" in told["notes"]
    assert told["vignetting"] is None


def test_pages_show_what_the_models_miss(camkit_command, asked: list[Any], tmp_path: Path) -> None:
    inside, outside = tmp_path / "pages" / "in.html", tmp_path / "pages" / "out.html"
    words = (*asked, "--lens", ZOOM, "--focal-mm", 24, "--crop-factor", 1, "--page", inside)
    done = camkit_command(*words, "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["page"] == str(inside)
    path = tmp_path / "camera.toml"
    path.write_text(to_toml(GEOMETRY), encoding="utf-8")
    out = ("--focal-mm", 10, "--crop-factor", 2, "--page", outside, "-o", tmp_path / "own.xml")
    done = camkit_command("calibrate", "lensfun-out", path, *out, "--json")
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["page"] == str(outside)
    for page in (inside, outside):
        assert page.read_text(encoding="utf-8").count("<img") == 1
    kept = camkit_command("calibrate", "lensfun-out", path, *out[:-1], tmp_path / "other.xml")
    assert kept.code == ExitCode.USAGE
    assert not (tmp_path / "other.xml").exists()


def test_a_geometry_tells_its_focal_length_and_a_bundle_does_not(
    camkit_command, tmp_path: Path
) -> None:
    path, out = tmp_path / "camera.toml", tmp_path / "own.xml"
    width, height = GEOMETRY["width_px"], GEOMETRY["height_px"]
    path.write_text(to_toml(GEOMETRY | {"focal_px": 500.0}), encoding="utf-8")
    words = ("calibrate", "lensfun-out", path, "-o", out, "--crop-factor", 2, "--json")
    done = camkit_command(*words)
    assert done.code == 0, done.err
    pitch_mm = np.hypot(36, 24) / 2 / np.hypot(width, height)
    assert json.loads(done.out)["focal_mm"] == pytest.approx(500 * pitch_mm, rel=1e-3)
    assert camkit_command(*words, "--overwrite", "--focal-mm", 9).code == 0
    assert 'focal="9"' in out.read_text(encoding="utf-8")
    bundle = write_tiny_bundle(tmp_path)
    done = camkit_command("calibrate", "lensfun-out", bundle, "-o", tmp_path / "b.xml")
    assert done.code == ExitCode.USAGE
    assert "add --focal-mm" in done.err


def test_a_geometry_needs_its_crop_factor_and_obeys_the_limit(
    camkit_command, tmp_path: Path
) -> None:
    path, out = tmp_path / "camera.toml", tmp_path / "own.xml"
    path.write_text(to_toml(GEOMETRY), encoding="utf-8")
    words = ("calibrate", "lensfun-out", path, "-o", out, "--focal-mm", 10)
    assert camkit_command(*words).code == ExitCode.USAGE
    done = camkit_command(*words, "--crop-factor", 1.5)
    assert done.code == 0, done.err
    assert "known to 250 px of 360" in done.err
    assert camkit_command(*words, "--crop-factor", 1.5).code == ExitCode.USAGE
    waves = GEOMETRY | {"radial": GEOMETRY["radial"] | {"coefficients": [1.0, -0.1, 0.2, -0.1]}}
    path.write_text(to_toml(waves), encoding="utf-8")
    out.unlink()
    done = camkit_command(*words, "--crop-factor", 1.5, "--most-residual-px", 0.01)
    assert done.code == 1
    assert "misses the distortion of camera by" in done.err
    assert not out.exists()


@pytest.mark.parametrize(
    ("name", "more"),
    [("own.txt", ()), ("own.xml", ("--maker", " ")), ("own.xml", ("--most-residual-px", 0))],
)
def test_wrong_options_of_out_are_usage(
    camkit_command, tmp_path: Path, name: str, more: tuple[Any, ...]
) -> None:
    words = ("calibrate", "lensfun-out", write_tiny_bundle(tmp_path), "-o", tmp_path / name)
    assert camkit_command(*words, "--focal-mm", 10, *more).code == ExitCode.USAGE


def test_a_lens_of_the_real_database_is_made(camkit_command, tmp_path: Path) -> None:
    database = data_path("lens/lensfun_db")
    shot = write_shot(tmp_path / "shot.dng")
    words = ("calibrate", "lensfun-in", database, "--capture", shot, "--crop-factor", 1.613)
    lens = ("--lens", "Canon EF-M 18-55mm f/3.5-5.6 IS STM", "--focal-mm", 21)
    done = camkit_command(*words, *lens, "-o", tmp_path / "kit.camkit", "--json")
    assert done.code == 0, done.err
    assert json.loads(done.out)["model"] == "ptlens"
    assert check_bundle(tmp_path / "kit.camkit").passed
