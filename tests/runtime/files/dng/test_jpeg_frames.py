"""The JPEG of a tile and the header agree on its samples, however they are folded."""

import struct

import numpy as np
import pytest

from camkit.runtime.files.dng.jpeg_frames import frame_doubt
from camkit.runtime.files.dng.picture_tags import sensor_picture
from camkit.runtime.files.tiff_tags import read_tiff_tags
from tests.dng_builder import build_dng


def jpeg(height, width, planes, marker=0xC3):
    table = b"\xff\xc4" + struct.pack(">H", 2 + 17) + bytes(17)
    frame = struct.pack(">BHHB", 14, height, width, planes) + bytes(3 * planes)
    return b"\xff\xd8" + table + bytes((0xFF, marker)) + struct.pack(">H", 2 + len(frame)) + frame


def doubt(path, stream, tags=None, size=(64, 96), compression=7):
    build_dng(path / "x.dng", np.zeros(size, np.uint16), tags, compression=compression)
    data = (path / "x.dng").read_bytes()
    found = sensor_picture(read_tiff_tags(path / "x.dng"))
    at = int(found.directory[273][0])
    (path / "x.dng").write_bytes(data[:at] + stream + data[at + len(stream) :])
    return frame_doubt(path / "x.dng", found)


@pytest.mark.parametrize("frame", [(64, 96, 1), (64, 48, 2), (32, 96, 2), (128, 48, 1)])
def test_samples_may_be_folded(tmp_path, frame):
    assert doubt(tmp_path, jpeg(*frame)) == ""


@pytest.mark.parametrize("frame", [(64, 95, 1), (63, 48, 2), (64, 96, 3)])
@pytest.mark.parametrize("compression", [7, 34892])
def test_another_number_of_samples_is_named(tmp_path, frame, compression):
    message = doubt(tmp_path, jpeg(*frame), compression=compression)
    assert f"a JPEG of {frame[1]}x{frame[0]} pixels and {frame[2]} sample(s)" in message


@pytest.mark.parametrize("stream", [b"\xff\xd8", b"\xff\xd8\xff", b"\xff\xd8\xff\xc3\0\x09"])
def test_a_stream_without_a_frame_says_nothing(tmp_path, stream):
    assert doubt(tmp_path, stream) == ""


@pytest.mark.parametrize("stream", [b"", b"\xff\xd9", b"rows of plain samples"])
def test_a_strip_without_a_jpeg_is_named(tmp_path, stream):
    assert doubt(tmp_path, stream) == "no JPEG lies in a strip or tile that should be one"


def test_other_compressions_say_nothing(tmp_path):
    assert doubt(tmp_path, jpeg(1, 1, 1), compression=1) == ""
