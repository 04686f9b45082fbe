import math
import struct
import time
import zlib
from io import BytesIO

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from camkit.runtime.files.exif_tags import exif_of_picture, metadata_of, orientation_of
from camkit.runtime.files.tiff_tags import TiffTags
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.exif import NOTHING, exif_block
from tests.metadata_factory import FULL


def tags_of(**values):
    directory = {int(name[1:]): value for name, value in values.items()}
    return TiffTags(directories=(directory,), file_bytes=1)


def jpeg(exif: bytes = b"", *, before: bytes = b"") -> bytes:
    """Give a JPEG with an Exif segment, and segments of other kinds before it."""
    made = BytesIO()
    Image.fromarray(np.zeros((4, 6, 3), np.uint8)).save(made, "JPEG")
    data = made.getvalue()
    segment = b"\xff\xe1" + struct.pack(">H", 8 + len(exif)) + b"Exif\0\0" + exif if exif else b""
    return data[:2] + before + segment + data[2:]


def png(exif: bytes) -> bytes:
    """Give the start of a PNG whose eXIf follows another chunk."""

    def chunk(name: bytes, content: bytes) -> bytes:
        crc = struct.pack(">I", zlib.crc32(name + content))
        return struct.pack(">I", len(content)) + name + content + crc

    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", bytes(13)) + chunk(b"eXIf", exif)


BLOCK = exif_block(FULL, main=NOTHING, exif=NOTHING)


def test_exif_is_found_where_pictures_hold_it():
    other = b"\xff\xe1" + struct.pack(">H", 10) + b"http://\0"
    for data in (jpeg(BLOCK), jpeg(BLOCK, before=other), png(BLOCK), png(b"Exif\0\0" + BLOCK)):
        found = metadata_of(exif_of_picture(data))
        assert found.make == FULL.make
        assert found.latitude_deg == pytest.approx(FULL.latitude_deg, abs=1e-7)


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff\xd8", jpeg(), b"\xff\xd8\xff\xe1\0\0", png(b""), png(b"")[:20], b"GIF89a" * 9],
)
def test_pictures_without_exif_have_no_tags(data):
    assert exif_of_picture(data).directories == ()


def test_zero_means_unknown():
    for tag, name in (("t34855", "iso"), ("t33434", "exposure_time_s"), ("t33437", "f_number")):
        for value in (0, math.inf, math.nan):
            assert getattr(metadata_of(tags_of(**{tag: (value,)})), name) is None
        assert getattr(metadata_of(tags_of(**{tag: (100,)})), name) == 100


def test_speeds_beyond_16_bits_stand_in_another_tag():
    assert metadata_of(tags_of(t34855=(65535,), t34866=(102400,))).iso == 102400
    assert metadata_of(tags_of(t34855=(65535,))).iso == 65535


@pytest.mark.parametrize(
    ("references", "signs"), [((b"N\0", b"E\0"), (1, 1)), ((b"S\0", b"W\0"), (-1, -1))]
)
def test_the_side_of_the_globe_is_the_sign(references, signs):
    tags = tags_of(
        t1=references[0], t2=(10, 30, 36), t3=references[1], t4=(20, 0, 0), t5=(1,), t6=(7,)
    )
    found = metadata_of(tags)
    assert found.latitude_deg == pytest.approx(10.51 * signs[0])
    assert found.longitude_deg == pytest.approx(20 * signs[1])
    assert found.altitude_m == -7


def test_a_place_without_its_side_is_none():
    assert metadata_of(tags_of(t2=(10, 30, 36), t4=(20, 0, 0))) == Metadata()
    assert metadata_of(tags_of(t1=b"N", t2=(10,), t3=b"E", t4=(20, 0, 0))) == Metadata()


def test_only_orientations_that_exist_are_taken():
    assert [orientation_of(tags_of(t274=(n,))) for n in (0, 6, 9, math.nan)] == [1, 6, 1, 1]
    assert orientation_of(tags_of()) == orientation_of(TiffTags(directories=(), file_bytes=0)) == 1


def test_the_orientation_of_a_thumbnail_is_not_that_of_the_picture():
    tags = TiffTags(directories=({256: (9,)}, {256: (3,), 274: (6,)}), file_bytes=1)
    assert orientation_of(tags) == 1


@settings(max_examples=100, deadline=None)
@given(
    flips=st.lists(
        st.tuples(st.integers(0, len(BLOCK) - 1), st.integers(1, 255)), min_size=1, max_size=20
    ),
    keep=st.integers(0, len(BLOCK)),
)
def test_no_damage_raises_or_takes_long(flips, keep):
    block = bytearray(BLOCK)
    for position, mask in flips:
        block[position] ^= mask
    began = time.perf_counter()
    for data in (png(bytes(block)), jpeg(bytes(block)), png(bytes(block[:keep]))):
        tags = exif_of_picture(data)
        assert isinstance(metadata_of(tags), Metadata)
        assert orientation_of(tags) in range(1, 9)
    assert time.perf_counter() - began < 2
