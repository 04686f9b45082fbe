import contextlib
from pathlib import Path
from typing import Any

import pytest
from PIL import Image
from PIL.ExifTags import IFD

from camkit.calibration.lensfun.camera import FOCAL_LENGTH_35_MM, slug, stated_crop
from camkit.calibration.lensfun.database import LEAST, MOST
from camkit.calibration.lensfun.ordinary import CameraOptions, lensfun_bundle
from camkit.errors import CamkitError, ContractError, DecodeError
from camkit.runtime.files.exif_tags import NUMBER_TAGS
from tests.lensfun_factory import ZOOM, write_database, write_shot


def test_without_a_name_the_bundle_has_that_of_the_lens(tmp_path: Path) -> None:
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    made = lensfun_bundle(database, ZOOM, shot, CameraOptions(focal_mm=24.0))
    assert made.manifest.name == slug(ZOOM)
    assert any("in the database" in note for note in made.notes)


def _jpeg(path: Path, own_mm: float, told_mm: int) -> Path:
    """Write a JPEG of the Box 2 that states its focal length twice."""
    exif = Image.Exif()
    exif[272] = "Box 2"
    inner = exif.get_ifd(IFD.Exif)
    inner[NUMBER_TAGS["focal_length_mm"]] = own_mm
    inner[FOCAL_LENGTH_35_MM] = told_mm
    Image.new("RGB", (240, 160), (90, 90, 90)).save(path, exif=exif)
    return path


def test_a_crop_mode_is_not_taken_for_the_whole_sensor(tmp_path: Path) -> None:
    database, options = write_database(tmp_path), CameraOptions(focal_mm=24.0)
    whole = _jpeg(tmp_path / "whole.jpg", 24.0, 36)
    assert stated_crop(whole) == pytest.approx(1.5)
    assert lensfun_bundle(database, ZOOM, whole, options).notes
    part = _jpeg(tmp_path / "part.jpg", 24.0, 54)
    told = r"crop factor 1\.5 for the Box 2, .* crop factor 2\.25, .* add crop_factor"
    with pytest.raises(DecodeError, match=told):
        lensfun_bundle(database, ZOOM, part, options)
    said = CameraOptions(focal_mm=24.0, crop_factor=2.25)
    made = lensfun_bundle(database, ZOOM, part, said).manifest
    assert made.sensor.pixel_pitch_um == pytest.approx(1000 * 43.2666 / 2.25 / 288.444, rel=1e-3)
    assert stated_crop(_jpeg(tmp_path / "unknown.jpg", 24.0, 0)) is None


@pytest.mark.parametrize(
    "wrong",
    [
        {"focal_mm": 0.0},
        {"focal_mm": float("nan")},
        {"focal_mm": 24.0, "aperture": -1.0},
        {"focal_mm": 24.0, "distance_m": 0.0},
        {"focal_mm": 24.0, "crop_factor": float("inf")},
        {"focal_mm": 24.0, "scale": 0.0},
        {"focal_mm": 24.0, "scale": 1e9},
        {"focal_mm": 24.0, "aperture": 1e-300},
        {"focal_mm": 24.0, "distance_m": 1e-300},
    ],
)
def test_options_that_no_camera_has_are_named(wrong: dict[str, Any]) -> None:
    with pytest.raises(ContractError, match=f"{list(wrong)[-1]} must be > 0"):
        CameraOptions(**wrong)


@pytest.mark.parametrize("option", ["focal_mm", "aperture", "distance_m", "crop_factor", "scale"])
@pytest.mark.parametrize("value", [LEAST, MOST])
def test_the_ends_of_what_options_may_be_are_taken_or_refused_in_words(
    tmp_path: Path, option: str, value: float
) -> None:
    options = CameraOptions(**({"focal_mm": 24.0} | {option: value}))
    shot, database = write_shot(tmp_path / "shot.dng"), write_database(tmp_path)
    with contextlib.suppress(CamkitError):
        lensfun_bundle(database, ZOOM, shot, options)
