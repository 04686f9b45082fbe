from datetime import datetime
from types import SimpleNamespace

import pytest
import rawpy

from camkit.runtime.files.raw_metadata import raw_metadata
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.metadata import Metadata
from camkit.runtime.raw import read_capture
from tests.data_folder import data_path
from tests.metadata_factory import FULL, assert_like
from tests.runtime.files.test_exif_tags import BLOCK, jpeg, tags_of

NO_TIFF = TiffTags(directories=(), file_bytes=1)

# What exiftool tells of the same files, where they tell anything; none of them holds a place.
REAL_FILES = {
    "sony_a7rm3_crop_DSC2164.ARW": Metadata(
        make="SONY",
        model="ILCE-7RM3",
        lens_model="E 55-210mm F4.5-6.3 OSS",
        captured_at="2018:07:11 01:18:47",
        utc_offset="+00:00",
        exposure_time_s=1 / 640,
        f_number=6.3,
        iso=3200.0,
        focal_length_mm=129.0,
    ),
    "canon_eos6d_linear_lossy.dng": Metadata(
        make="Canon",
        model="Canon EOS 6D",
        lens_model="EF24-105mm f/4L IS USM",
        captured_at="2019:06:06 07:29:51",
        exposure_time_s=1 / 60,
        f_number=5.6,
        iso=1000.0,
        focal_length_mm=65.0,
    ),
    "canon_g2_colorchecker_CRW_0304.CRW": Metadata(
        make="Canon",
        model="PowerShot G2",
        captured_at="2022:01:20 08:13:24",
        exposure_time_s=0.01982892,
        f_number=4.0,
        iso=50.0,
        focal_length_mm=7.0,
    ),
    "kodak_dc120_P003917.KDC": Metadata(
        make="Eastman Kodak Company",
        model="Kodak DC120 ZOOM Digital Camera",
        copyright="Kodak DC120 ZOOM Digital Camera K",
        captured_at="1994:01:02 16:01:02",
        exposure_time_s=0.0037,
        f_number=3.9,
        iso=160.0,
        focal_length_mm=37.0,
    ),
    "canon_kissx4_magiclantern_colorchart.dng": Metadata(make="Canon", model="Canon EOS Kiss X4"),
    "blackmagic_pocket4k.dng": Metadata(model="Blackmagic Pocket Cinema Camera 4K"),
}


class Raw:
    """A file as rawpy opens it."""

    def __init__(self, preview=None, **other):
        self.preview = preview
        self.other = SimpleNamespace(**other)
        self.lens = SimpleNamespace(make="", model="100mm Macro")

    def extract_thumb(self):
        if self.preview is None:
            raise rawpy.LibRawNoThumbnailError(b"none")
        return SimpleNamespace(format=rawpy.ThumbFormat.JPEG, data=self.preview)


def test_libraw_is_asked_only_for_what_has_no_tag():
    raw = Raw(iso_speed=64.0, shutter_speed=1.0, aperture=2.8)
    found = raw_metadata(raw, tags_of(t33434=(0.0,), t34855=(200,)))
    assert found == Metadata(iso=200, f_number=2.8, lens_model="100mm Macro")


def test_a_file_that_is_no_tiff_tells_through_its_preview():
    raw = Raw(jpeg(BLOCK), iso_speed=64.0, timestamp=datetime(2020, 1, 2, 3, 4, 5))
    found = raw_metadata(raw, NO_TIFF)
    assert (found.make, found.model) == (FULL.make, FULL.model)
    assert found.longitude_deg == pytest.approx(FULL.longitude_deg, abs=1e-7)
    assert (found.iso, found.captured_at) == (64, "2020:01:02 03:04:05")


def test_no_date_and_no_preview_are_nothing():
    raw = Raw(timestamp=datetime(1970, 1, 1))
    assert raw_metadata(raw, NO_TIFF) == Metadata(lens_model="100mm Macro")


@pytest.mark.parametrize("name", REAL_FILES)
def test_real_files_tell_what_exiftool_reads_in_them(name):
    capture = read_capture(data_path("raw") / name, isolate=name.endswith("CRW"))
    assert_like(capture.metadata, REAL_FILES[name])


def test_a_date_does_not_change_with_the_time_zone(monkeypatch):
    """CRW counts seconds since 1970, as its camera's clock showed them."""
    monkeypatch.setenv("TZ", "Asia/Tokyo")
    capture = read_capture(data_path("raw/canon_g2_colorchecker_CRW_0304.CRW"))
    assert capture.metadata.captured_at == "2022:01:20 08:13:24"
