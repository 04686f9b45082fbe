"""Formats that are not read are refused by their names, whatever their files are called."""

import io

import numpy as np
import pytest
from PIL import Image

from camkit.errors import DecodeError
from camkit.runtime.files.picture import read_scene
from camkit.runtime.raw import is_picture, read_capture

PICTURE = Image.linear_gradient("L").convert("RGB")


def by_pillow(kind):
    stream = io.BytesIO()
    PICTURE.save(stream, kind)
    return stream.getvalue()


def of_brand(brand):
    return b"\0\0\0\x18ftyp" + brand + bytes(3000)


FILES = {
    "a WebP": lambda: by_pillow("WEBP"),
    "a GIF": lambda: by_pillow("GIF"),
    "a JPEG 2000": lambda: by_pillow("JPEG2000"),
    "a PNM": lambda: by_pillow("PPM"),
    "a DDS": lambda: by_pillow("DDS"),
    "a HEIC": lambda: of_brand(b"heic"),
    "a HEIF": lambda: of_brand(b"mif1"),
    "an AVIF": lambda: of_brand(b"avif"),
    r"a film \(QuickTime\)": lambda: of_brand(b"qt  "),
    "a JPEG XL": lambda: b"\0\0\0\x0cJXL \r\n\x87\n" + bytes(3000),
    "a Photoshop PSD": lambda: b"8BPS\0\x01" + bytes(3000),
    "a FITS": lambda: b"SIMPLE  =                    T" + bytes(3000),
    "a JPEG XR": lambda: b"II\xbc\x01" + bytes(3000),
}


@pytest.mark.parametrize("name", FILES)
@pytest.mark.parametrize("suffix", [".bin", ".jpg", ".png", ".tif", ".dng", ".heic"])
def test_foreign_files_are_named(tmp_path, name, suffix):
    path = tmp_path / f"x{suffix}"
    path.write_bytes(FILES[name]())
    with pytest.raises(DecodeError, match=f"x{suffix}: {name} file is not read; save it as"):
        read_capture(path, isolate=False)
    with pytest.raises(DecodeError, match=f"{name} file is not read; save it as"):
        read_scene(path)


@pytest.mark.parametrize("suffix", [".jpe", ".jfif", ".mpo", ".JPG", ".bmp"])
def test_names_that_pictures_have_are_known(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    path.write_bytes(by_pillow("BMP" if suffix == ".bmp" else "JPEG"))
    assert is_picture(path)
    found = read_capture(path, keep_codes=True).samples
    wanted = np.moveaxis(np.asarray(Image.open(path).convert("RGB")), -1, 0)
    assert np.array_equal(found, wanted)


@pytest.mark.parametrize("suffix", [".nef", ".raw", ".thm", ""])
def test_a_jpeg_under_another_name_is_called_one(tmp_path, suffix):
    (tmp_path / f"x{suffix}").write_bytes(by_pillow("JPEG"))
    with pytest.raises(DecodeError, match="a JPEG, under another name"):
        read_capture(tmp_path / f"x{suffix}")


@pytest.mark.parametrize("head", [b"BM" + bytes(100), b"RIFF0000AVI " + bytes(99), b"P9 " * 40])
def test_other_beginnings_are_not_given_a_wrong_name(tmp_path, head):
    (tmp_path / "x.raw").write_bytes(head)
    with pytest.raises(DecodeError, match="LibRaw cannot decode the file"):
        read_capture(tmp_path / "x.raw", isolate=False)
