"""The metadata of a photograph in every format, read by programs and libraries of others."""

import json
import shutil
import subprocess
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import exifread
import numpy as np
import OpenEXR
import pytest
import tifffile
from PIL import Image

from camkit.runtime.color import color_stage
from camkit.runtime.files.exif_tags import metadata_of
from camkit.runtime.files.tiff_tags import read_tiff_tags, tags_of_block
from camkit.runtime.metadata import Metadata
from camkit.runtime.output import tiff_writer
from camkit.runtime.output.exif import NOTHING, exif_block, nearest_ratio
from camkit.runtime.output.origin import Origin
from camkit.runtime.output.picture_writer import PictureFormat
from camkit.runtime.output.writer import SUFFIXES, open_writer
from camkit.runtime.raw import read_capture
from tests.metadata_factory import FULL, assert_like

HEIGHT, WIDTH, TURNED = 30, 40, 6
BLOCKS = ("tiff", "png", "jpeg", "dng")


def write(folder: Path, kind: str, metadata: Metadata = FULL) -> Path:
    """Write a picture of a camera that was held sideways."""
    is_dng = kind == "dng"
    picture = PictureFormat(
        width=WIDTH,
        height=HEIGHT,
        color=color_stage(None, "camera" if is_dng else "rec709"),
        orientation=1 if is_dng else TURNED,
        origin=Origin(metadata=metadata, orientation=TURNED),
    )
    path = folder / f"a.{SUFFIXES[kind]}"
    band = np.random.default_rng(0).random((3, HEIGHT, WIDTH), dtype=np.float32)
    with open_writer(path, kind, picture) as writer:
        writer.write(band[:, :13])
        writer.write(band[:, 13:])
    return path


@pytest.mark.parametrize("kind", SUFFIXES)
def test_camkit_reads_back_what_it_wrote(tmp_path: Path, kind: str) -> None:
    found = read_capture(write(tmp_path, kind))
    lost = {"artist": ""} if kind == "exr" else {}
    assert_like(found.metadata, replace(FULL, **lost))
    assert found.orientation == (TURNED if kind == "dng" else 1), "pictures stand upright"


@pytest.mark.parametrize("kind", BLOCKS)
def test_exifread_finds_what_was_written(tmp_path: Path, kind: str) -> None:
    with write(tmp_path, kind).open("rb") as file:
        found = {name: tag.printable for name, tag in exifread.process_file(file).items()}
    assert found["Image Model"] == "Kamera 7"
    assert found["EXIF LensModel"] == FULL.lens_model
    assert found["EXIF DateTimeOriginal"] == FULL.captured_at
    assert found["EXIF OffsetTimeOriginal"] == FULL.utc_offset
    assert found["EXIF ExposureTime"] == "1/640"
    assert found["EXIF FNumber"] == "63/10"
    assert found["EXIF ISOSpeedRatings"] == "3200"
    assert found["EXIF FocalLength"] == "129"
    assert (found["GPS GPSLatitudeRef"], found["GPS GPSLongitudeRef"]) == ("S", "E")
    assert found["GPS GPSLatitude"].startswith("[33, 51, ")
    assert found["GPS GPSAltitude"] == "25/2"
    turned = found["Image Orientation"]
    assert turned == ("Rotated 90 CW" if kind == "dng" else "Horizontal (normal)")


@pytest.mark.parametrize("kind", ["tiff", "png", "jpeg"])
def test_pillow_finds_what_was_written(tmp_path: Path, kind: str) -> None:
    with Image.open(write(tmp_path, kind)) as image:
        exif = image.getexif()
        inner, place = exif.get_ifd(34665), exif.get_ifd(34853)
        assert "icc_profile" in image.info
        assert image.size == (HEIGHT, WIDTH)
    assert (exif[272], exif[274]) == ("Kamera 7", 1)
    assert Fraction(inner[33434]) == Fraction(1, 640)
    assert inner[40961] == 1, "sRGB"
    assert float(place[6]) == 12.5
    assert bytes(place[5]) == b"\1", "below the sea"


def test_openexr_finds_what_was_written(tmp_path: Path) -> None:
    with OpenEXR.File(str(write(tmp_path, "exr")), header_only=True) as file:
        header = dict(file.header())
    assert (header["cameraMake"], header["lensModel"]) == ("Müller", FULL.lens_model)
    assert header["expTime"] == pytest.approx(1 / 640)
    assert header["latitude"] == pytest.approx(FULL.latitude_deg)
    assert header["capDate"] == FULL.captured_at


def test_metadata_survive_an_exr_that_turns_to_float(tmp_path: Path) -> None:
    picture = PictureFormat(
        width=4, height=2, color=color_stage(None), origin=Origin(metadata=FULL)
    )
    with open_writer(tmp_path / "a.exr", "exr", picture) as writer:
        writer.write(np.ones((3, 1, 4), np.float32))
        writer.write(np.full((3, 1, 4), 1e6, np.float32))
    assert read_capture(tmp_path / "a.exr").metadata.make == FULL.make


@pytest.mark.parametrize("kind", SUFFIXES)
def test_exiftool_finds_what_was_written_and_nothing_amiss(tmp_path: Path, kind: str) -> None:
    """The reader that people check with."""
    if shutil.which("exiftool") is None:
        pytest.skip("exiftool is not on the path; install it to check against it")
    told = subprocess.run(
        ["exiftool", "-json", "-n", "-validate", "-warning", "-all", write(tmp_path, kind)],
        capture_output=True,
        check=True,
    )
    (found,) = json.loads(told.stdout)
    # how a place was measured is not known; exiftool misses it in TIFF only
    assert found.get("Warning", "GPSProcessingMethod").endswith("GPSProcessingMethod")
    assert found.get("Make", found.get("CameraMake")) == "Müller"
    assert found["LensModel"] == FULL.lens_model
    assert found["DateTimeOriginal"] == FULL.captured_at
    assert float(found["ExposureTime"]) == pytest.approx(1 / 640)
    assert found["ISO"] == 3200
    assert found.get("FNumber", found.get("Aperture")) == pytest.approx(6.3)
    assert found.get("FocalLength", found.get("NominalFocalLength")) == 129
    assert found["GPSLatitude"] == pytest.approx(FULL.latitude_deg, abs=1e-5)
    assert found["GPSLongitude"] == pytest.approx(FULL.longitude_deg, abs=1e-5)
    assert found["GPSAltitude"] == pytest.approx(-12.5)
    if kind != "exr":
        assert found["Orientation"] == (TURNED if kind == "dng" else 1)
    if kind == "dng":
        assert found["PreviewImageLength"] > 100


@pytest.mark.parametrize("kind", SUFFIXES)
def test_the_same_picture_is_the_same_file(tmp_path: Path, kind: str) -> None:
    contents = []
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        contents.append(write(tmp_path / name, kind).read_bytes())
    assert contents[0] == contents[1]


@pytest.mark.parametrize("kind", SUFFIXES)
def test_where_nothing_is_stated_nothing_is_written(tmp_path: Path, kind: str) -> None:
    path = write(tmp_path, kind, Metadata())
    data = path.read_bytes()
    for sign in (b"eXIf", b"Exif\0\0", b"0232", b"camera"):
        assert sign not in data
    found = read_capture(path).metadata
    assert found == (Metadata(make="camkit", model="camkit") if kind == "dng" else Metadata())


def test_a_bigtiff_holds_it_too(tmp_path: Path) -> None:
    origin = Origin(metadata=FULL)
    picture = PictureFormat(width=30_000, height=30_000, color=color_stage(None), origin=origin)
    (tmp_path / "a.tif").write_bytes(tiff_writer._front(picture))
    assert_like(metadata_of(read_tiff_tags(tmp_path / "a.tif")), FULL)
    with tifffile.TiffFile(tmp_path / "a.tif") as file:
        page = file.pages[0]
        assert file.is_bigtiff
        assert page.shape == (30_000, 30_000, 3)  # type: ignore[union-attr]
        assert page.dataoffsets == ((tmp_path / "a.tif").stat().st_size,)  # type: ignore[union-attr]
        assert page.databytecounts == (30_000**2 * 6,)  # type: ignore[union-attr]


def test_speeds_beyond_16_bits_come_back() -> None:
    block = exif_block(Metadata(iso=409_600.0), main=NOTHING, exif=NOTHING)
    assert metadata_of(tags_of_block(block)) == Metadata(iso=409_600.0)


@pytest.mark.parametrize(
    ("value", "ratio"),
    [
        (float(np.float32(1 / 640)), "1/640"),
        (1 / 3, "1/3"),
        (1 / 60, "1/60"),
        (1 / 6000, "1/6000"),
        (1e-6, "1/1000000"),
        (30.0, "30"),
        (float(np.float32(6.3)), "63/10"),
        (0.0, "0"),
    ],
)
def test_numbers_are_written_as_people_would(value: float, ratio: str) -> None:
    assert nearest_ratio(value) == Fraction(ratio)
