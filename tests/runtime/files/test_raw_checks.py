import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.files.raw_checks import (
    Levels,
    check_chunks_inside,
    check_content,
    check_levels,
    check_pattern,
    check_size,
)
from camkit.runtime.files.tiff_tags import TiffTags

RNG_SEED = 7


def levels(black=256.0, white=4095.0):
    return Levels(black=np.full((2, 2), black, dtype=np.float32), white=white)


def night(height=80, width=60, black=256):
    """Dark but alive: read noise around black and one lamp."""
    rng = np.random.default_rng(RNG_SEED)
    samples = np.round(rng.normal(black, 1.5, (height, width))).clip(0).astype(np.uint16)
    samples[10:14, 20:24] = 4095
    return samples


def tags_of(*directories, file_bytes=1000):
    return TiffTags(directories=directories, file_bytes=file_bytes)


def test_strips_inside_the_file_pass_and_outside_are_refused():
    good = {262: (32803,), 273: (100, 500), 279: (400, 500)}
    check_chunks_inside(tags_of(good))
    with pytest.raises(DecodeError, match="cut off"):
        check_chunks_inside(tags_of(good, file_bytes=999))
    with pytest.raises(DecodeError, match="cut off"):
        check_chunks_inside(tags_of({262: (34892,), 324: (100,), 325: (901,)}))


def test_pixel_data_that_lie_over_the_header_are_refused():
    with pytest.raises(DecodeError, match="before the header ends"):
        check_chunks_inside(tags_of({262: (32803,), 273: (0,), 279: (400,)}))
    sensor = {262: (32803,), 273: (100,), 279: (400,)}
    check_chunks_inside(TiffTags(directories=(sensor,), file_bytes=1000, starts=(8, 500)))
    with pytest.raises(DecodeError, match="before the header ends"):
        check_chunks_inside(TiffTags(directories=(sensor,), file_bytes=1000, starts=(8, 400)))


def test_offsets_without_their_lengths_are_refused():
    with pytest.raises(DecodeError, match="2 strip offsets but 1 lengths"):
        check_chunks_inside(tags_of({262: (32803,), 273: (1, 2), 279: (3,)}))


def test_a_broken_preview_does_not_condemn_the_sensor_picture():
    preview = {262: (6,), 256: (9,), 257: (9,), 273: (5000,), 279: (10,)}
    sensor = {262: (32803,), 273: (100,), 279: (10,)}
    check_chunks_inside(tags_of(preview, sensor))
    check_chunks_inside(tags_of())


def test_without_sensor_directory_the_largest_is_checked():
    small = {256: (9,), 257: (9,), 273: (5000,), 279: (10,)}
    large = {256: (99,), 257: (99,), 273: (100,), 279: (10,)}
    check_chunks_inside(tags_of(small, large))
    with pytest.raises(DecodeError):
        check_chunks_inside(tags_of(small))


@pytest.mark.parametrize(
    ("height", "width", "file_bytes"),
    [(60000, 60000, 10**10), (1, 500, 10**6), (4000, 6000, 5000), (0, 0, 5)],
)
def test_sizes_that_cannot_be_are_refused(height, width, file_bytes):
    with pytest.raises(DecodeError):
        check_size(height, width, file_bytes)


def test_a_24_megapixel_file_passes_the_size_check():
    check_size(4000, 6000, 21_367_648)


@pytest.mark.parametrize(
    ("black", "white"),
    [(4095, 4095), (-1, 4095), (np.nan, 4095), (256, 70000), (256, 0), (256, np.nan)],
)
def test_levels_that_cannot_be_are_refused(black, white):
    with pytest.raises(DecodeError):
        check_levels(levels(black, white))


def test_only_bayer_letters_are_a_pattern():
    assert check_pattern("GBRG") == "GBRG"
    with pytest.raises(DecodeError, match="RRGB"):
        check_pattern("RRGB")


@pytest.mark.parametrize("black", [256, 0])
def test_a_night_photograph_passes(black):
    check_content(night(black=black), levels(black))


def test_a_dark_foreground_clipped_at_zero_passes_where_black_is_zero():
    samples = night(black=0)
    samples[30:] = 0
    check_content(samples, levels(0))


def test_an_overexposed_sky_passes():
    samples = night()
    samples[:60] = 4095
    check_content(samples, levels())
    check_content(samples[::-1], levels())


@pytest.mark.parametrize("value", [0, 256, 4095])
def test_a_constant_picture_is_refused(value):
    with pytest.raises(DecodeError, match="every pixel"):
        check_content(np.full((8, 8), value, dtype=np.uint16), levels())


def test_nothing_above_black_is_refused():
    samples = np.random.default_rng(0).integers(100, 256, (9, 9)).astype(np.uint16)
    with pytest.raises(DecodeError, match="exceeds the black level"):
        check_content(samples, levels())


@pytest.mark.parametrize("black", [256, 0])
def test_rows_that_were_never_read_are_refused(black):
    samples = night(black=256) + np.uint16(500)
    samples[50:] = 0
    with pytest.raises(DecodeError, match=r"incomplete|cut off"):
        check_content(samples, levels(black))


def test_unread_tiles_are_refused_where_black_is_not_zero():
    samples = night()
    samples[:40, :30] = 0
    with pytest.raises(DecodeError, match="25"):
        check_content(samples, levels())


def test_unread_rows_of_planes_are_refused():
    samples = np.stack([night() + np.uint16(500)] * 3)
    samples[:, 40:] = 0
    with pytest.raises(DecodeError):
        check_content(samples, Levels(black=np.zeros(3, dtype=np.float32), white=4095.0))


def test_a_white_level_far_below_the_data_is_refused():
    samples = night() + np.uint16(2000)
    with pytest.raises(DecodeError, match="above the white level"):
        check_content(samples, levels(white=1000.0))
