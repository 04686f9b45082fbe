"""Data in memory are read as the file that they would be."""

import io
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from camkit.errors import ContractError, DecodeError
from camkit.runtime.files.in_memory import list_paths, stored
from camkit.runtime.raw import read_capture
from tests.dng_factory import write_scene


def as_bytesio(data):
    return io.BytesIO(data)


def as_named(data):
    file = io.BytesIO(data)
    file.name = "folder/shot.dng"
    return file


@pytest.mark.parametrize("hold", [bytes, bytearray, memoryview, as_bytesio, as_named])
def test_a_dng_in_memory_is_the_capture_of_its_file(tmp_path, hold):
    write_scene(tmp_path / "x.dng")
    known = read_capture(tmp_path / "x.dng", isolate=False)
    capture = read_capture(hold((tmp_path / "x.dng").read_bytes()), isolate=False)
    assert np.array_equal(capture.samples, known.samples)
    assert (capture.sha256, capture.bundle_name) == (known.sha256, "duet")


def test_an_open_file_is_read_from_where_it_stands(tmp_path):
    write_scene(tmp_path / "x.dng")
    (tmp_path / "y").write_bytes(b"12345" + (tmp_path / "x.dng").read_bytes())
    with (tmp_path / "y").open("rb") as file:
        file.seek(5)
        assert read_capture(file, isolate=False).cfa == "RGGB"
    with (tmp_path / "x.dng").open() as text, pytest.raises(ContractError, match="binary mode"):
        read_capture(text)


@pytest.mark.parametrize("suffix", [".png", ".tif", ".exr", ".hdr"])
def test_pictures_are_told_from_raw_files_by_their_content(tmp_path, suffix):
    path = tmp_path / f"x{suffix}"
    samples = np.full((8, 8, 3), 0.25, np.float32)
    if suffix == ".exr":
        import OpenEXR

        OpenEXR.File({}, {"RGB": samples}).write(str(path))
    elif suffix == ".hdr":
        cv2.imwrite(str(path), samples)
    else:
        whole = np.full((8, 8, 3), 16384, np.uint16)
        if suffix == ".tif":
            tifffile.imwrite(path, whole, photometric="rgb")
        else:
            cv2.imwrite(str(path), whole)
    capture = read_capture(path.read_bytes())
    assert capture.contract == "linear_rgb_v1"
    np.testing.assert_allclose(capture.linear_rows(0, 8), 0.25, atol=1e-4)


def test_a_damaged_file_in_memory_is_refused_and_nothing_stays(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    with pytest.raises(DecodeError, match=r"data in memory\.raw"):
        read_capture(b"nothing", isolate=False)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("nonsense", [None, 7, [b"a"]])
def test_what_is_no_file_is_refused_with_what_would_be(nonsense):
    with pytest.raises(ContractError, match="expected a path, bytes or a file"), stored(nonsense):
        pass


def test_pictures_that_would_have_no_name_are_refused():
    assert list_paths("a.dng") == ["a.dng"]
    assert list_paths((Path("a.dng"), "b.dng")) == [Path("a.dng"), "b.dng"]
    for data in (b"II*", io.BytesIO(), ["a.dng", b"II*"]):
        with pytest.raises(ContractError, match=r"Pipeline\.process"):
            list_paths(data)


def test_a_closed_file_is_refused_in_words():
    file = io.BytesIO(b"II*")
    file.close()
    with pytest.raises(ContractError, match="the file is closed"), stored(file):
        pass
