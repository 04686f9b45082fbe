import struct
import time

import pytest
import tifffile
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.runtime.files.tiff_tags import (
    MAX_ALL_BYTES,
    MAX_ALL_ENTRIES,
    read_tiff_tags,
    tags_of_block,
)
from tests.dng_factory import dng_tags, scene_mosaic, write_scene


def test_numbers_text_and_rationals_come_back(tmp_path):
    write_scene(tmp_path / "x.dng")
    tags = read_tiff_tags(tmp_path / "x.dng")
    assert (80,) in [d.get(256) for d in tags.directories]
    assert tags.text(50708) == dng_tags().camera_model
    assert tags.numbers(33434) == (0.02,)
    assert tags.numbers(50721)[:2] == pytest.approx((0.664, -0.1847))
    assert tags.numbers(51041)[0] == 1e-4
    assert tags.numbers(1) is None
    assert tags.text(256) is None
    assert tags.file_bytes == (tmp_path / "x.dng").stat().st_size


@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize("big", [False, True])
def test_both_byte_orders_and_bigtiff_are_read(tmp_path, byteorder, big):
    path = tmp_path / "x.tif"
    with tifffile.TiffWriter(path, byteorder=byteorder, bigtiff=big) as file:
        file.write(scene_mosaic(), subifds=1)
        file.write(scene_mosaic(6, 8))
        file.write(scene_mosaic(10, 12))
    widths = [d[256] for d in read_tiff_tags(path).directories]
    assert widths == [(80,), (8,), (12,)]


def test_other_files_have_no_tags(tmp_path):
    for content in (b"", b"II*", b"\x89PNG" * 9, b"IIRO" + bytes(90)):
        (tmp_path / "x").write_bytes(content)
        assert read_tiff_tags(tmp_path / "x").directories == ()


def test_directories_that_point_at_themselves_end(tmp_path):
    entry = struct.pack("<HHII", 330, 4, 1, 8)  # a child at its own offset
    loop = b"II*\0" + struct.pack("<I", 8) + struct.pack("<H", 1) + entry + struct.pack("<I", 8)
    (tmp_path / "x").write_bytes(loop)
    assert len(read_tiff_tags(tmp_path / "x").directories) == 1


def test_values_outside_the_file_and_absurd_counts_are_left_out(tmp_path):
    entries = [
        struct.pack("<HHII", 256, 4, 1, 77),
        struct.pack("<HHII", 273, 4, 9, 10**6),
        struct.pack("<HHII", 279, 4, 2**32 - 1, 8),
        struct.pack("<HHII", 280, 99, 1, 8),
        struct.pack("<HHII", 33434, 5, 1, 8),
    ]
    body = struct.pack("<H", len(entries)) + b"".join(entries) + struct.pack("<I", 0)
    (tmp_path / "x").write_bytes(b"II*\0" + struct.pack("<I", 8) + body)
    (directory,) = read_tiff_tags(tmp_path / "x").directories
    assert directory[256] == (77,)
    assert set(directory) == {256, 33434}


@settings(max_examples=60, deadline=None)
@given(flips=st.lists(st.tuples(st.integers(0, 1200), st.integers(1, 255)), max_size=30))
def test_no_damage_makes_the_reader_raise(tmp_path_factory, flips):
    folder = tmp_path_factory.getbasetemp()
    path, damaged = folder / "good.dng", folder / "damaged.dng"
    if not path.exists():
        write_scene(path)
    data = bytearray(path.read_bytes())
    for position, mask in flips:
        data[position] ^= mask
    damaged.write_bytes(bytes(data))
    assert read_tiff_tags(damaged).file_bytes == len(data)


def _directory(entries: list[bytes]) -> bytes:
    return struct.pack("<H", len(entries)) + b"".join(entries) + struct.pack("<I", 0)


def test_entries_that_share_their_bytes_cost_no_more_than_a_file_may():
    """4096 times 4 MB would be 16 GB of numbers out of a small file."""
    shared = [struct.pack("<HHII", n, 1, 4 << 20, 0) for n in range(1000, 5096)]
    block = b"II*\0" + struct.pack("<I", 8) + _directory(shared)
    block += bytes((4 << 20) + 8 - len(block))
    began = time.perf_counter()
    (directory,) = tags_of_block(block).directories
    assert time.perf_counter() - began < 10
    assert sum(map(len, directory.values())) <= MAX_ALL_BYTES


def test_chains_of_full_directories_end():
    entries = [struct.pack("<HHII", n, 4, 1, 1) for n in range(4000)]
    each = 2 + 12 * len(entries) + 4
    count = 40
    block = b"II*\0" + struct.pack("<I", 8)
    for n in range(count):
        follows = 8 + (n + 1) * each if n + 1 < count else 0
        block += _directory(entries)[:-4] + struct.pack("<I", follows)
    found = tags_of_block(block).directories
    assert 0 < sum(map(len, found)) <= MAX_ALL_ENTRIES
