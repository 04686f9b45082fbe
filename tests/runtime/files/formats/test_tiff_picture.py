"""Sound TIFFs of unusual kinds are read rightly or refused by the name of their kind."""

import importlib.util
import lzma
import struct
import tracemalloc
import zlib

import cv2
import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms

from camkit.colorimetry import decode_srgb, encode_srgb
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.picture import read_mosaic, read_picture, read_scene
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.tone_curve import PictureReading
from tests.data_folder import data_path
from tests.tiff_factory import packed_page, write_tiff

HIGH, WIDE = 37, 51
RNG = np.random.default_rng(5)
DEEP = RNG.integers(0, 65535, (HIGH, WIDE, 3), dtype=np.uint16)
EIGHT = (DEEP >> 8).astype(np.uint8)
LIGHT = RNG.random((HIGH, WIDE, 3)).astype(np.float32)


def planes(samples):
    return np.moveaxis(samples, -1, 0)


def write(path, samples, **options):
    tifffile.imwrite(path, samples, **options)
    return path


def test_planar_and_packed_files_of_reports_are_read():
    expected = tifffile.imread(data_path("reports/tiff_planar_expected.tif"))
    found = read_capture(data_path("reports/tiff_planar.tif"))
    assert np.array_equal(found.samples, planes(expected))
    options = MosaicOptions(cfa="RGGB", black_level=200, white_level=4095)
    mosaic = read_capture(data_path("reports/tiff_12bit_mosaic.tif"), mosaic=options)
    wanted = np.load(data_path("reports/tiff_12bit_mosaic_expected.npy"))
    assert np.array_equal(mosaic.samples, wanted)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
@pytest.mark.parametrize("planar", ["contig", "separate"])
@pytest.mark.parametrize("byteorder", ["<", ">"])
@pytest.mark.parametrize(
    "layout", [{}, {"tile": (16, 32)}, {"rowsperstrip": 5}, {"compression": "zlib"}], ids=str
)
def test_colour_of_any_type_layout_and_byte_order_is_read(
    tmp_path, dtype, planar, byteorder, layout
):
    if np.issubdtype(dtype, np.floating):
        samples = LIGHT.astype(dtype)
    else:
        samples = EIGHT if dtype == np.uint8 else DEEP
    stored = samples if planar == "contig" else planes(samples).copy()
    options = {"photometric": "rgb", "planarconfig": planar, "byteorder": byteorder} | layout
    path = write(
        tmp_path / "a.tif", stored.astype(np.dtype(dtype).newbyteorder(byteorder)), **options
    )
    found = read_picture(path, PictureReading(keep_codes=True)).samples
    assert np.array_equal(found, planes(samples).astype(found.dtype))
    assert found.dtype == (dtype if np.issubdtype(dtype, np.integer) else np.float32)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("layout", [{}, {"tile": (16, 16)}, {"compression": "zlib"}], ids=str)
def test_min_is_white_is_inverted(tmp_path, dtype, layout):
    grey = (EIGHT if dtype == np.uint8 else DEEP)[..., 0]
    path = write(tmp_path / "a.tif", grey, photometric="miniswhite", **layout)
    found = read_picture(path, PictureReading(keep_codes=True))
    top = np.iinfo(dtype).max
    assert np.array_equal(found.samples, np.stack([top - grey] * 3))
    assert any("MinIsWhite" in note for note in found.notes)


@pytest.mark.parametrize("bits", [1, 2, 4, 6, 9, 10, 12, 13, 14, 15])
@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("layout", [{}, {"rows": 5}, {"tile": (16, 16)}], ids=str)
@pytest.mark.parametrize("way", [{}, {"reverse": True}, {"deflate": True}], ids=str)
def test_packed_bits_are_unpacked(tmp_path, bits, order, layout, way):
    mosaic = RNG.integers(0, 1 << bits, (HIGH, WIDE), dtype=np.uint16)
    page = packed_page(mosaic, bits, **layout, **way)
    path = write_tiff(tmp_path / "a.tif", [page], order=order)
    options = MosaicOptions(cfa="RGGB", black_level=0, white_level=(1 << bits) - 1)
    assert np.array_equal(read_mosaic(path, options).samples, mosaic)
    picture = read_picture(path)
    white = (
        decode_srgb(mosaic / np.float32((1 << bits) - 1)) if bits < 9 else mosaic / (2**bits - 1)
    )
    assert np.allclose(picture.linear_rows(0, HIGH), white, atol=2e-5)


@pytest.mark.parametrize("planar", [False, True])
@pytest.mark.parametrize("big", [False, True])
def test_packed_colour_is_unpacked(tmp_path, planar, big):
    samples = DEEP >> 4
    path = write_tiff(tmp_path / "a.tif", [packed_page(samples, 12, planar=planar)], big=big)
    found = read_picture(path)
    assert np.array_equal(found.samples, planes(samples))
    assert found.white_level == 4095
    assert np.allclose(read_scene(path), decode_srgb(planes(samples) / np.float32(4095)), atol=1e-6)


def test_a_packed_strip_that_is_too_short_is_refused(tmp_path):
    tags, segments = packed_page(DEEP[..., 0] >> 4, 12, rows=10)
    path = write_tiff(tmp_path / "a.tif", [(tags, [segments[0][:-9], *segments[1:]])])
    with pytest.raises(DecodeError, match="holds 761 of 770 bytes"):
        read_picture(path)


@pytest.mark.parametrize("bits", [8, 12, 16])
@pytest.mark.parametrize("deflate", [False, True])
def test_planar_strips_that_are_too_short_are_refused(tmp_path, bits, deflate):
    tags, segments = packed_page(DEEP >> (16 - bits), bits, planar=True, deflate=deflate)
    short = [segments[0], segments[1][: len(segments[1]) // 2], segments[2]]
    path = write_tiff(tmp_path / "a.tif", [(tags, short)])
    with pytest.raises(DecodeError, match=r"damaged|cut off|incomplete"):
        read_picture(path)


@pytest.mark.parametrize("marked", ["NewSubfileType", "SubfileType", "nothing"])
@pytest.mark.parametrize("children", [False, True])
@pytest.mark.parametrize("bits", [8, 12, 16])
def test_the_picture_behind_a_thumbnail_is_read(tmp_path, marked, children, bits):
    samples = DEEP >> (16 - bits)
    small = packed_page(samples[::4, ::4] // 2, bits)
    tags = {"NewSubfileType": {254: ("I", 1)}, "SubfileType": {255: ("H", 2)}, "nothing": {}}[
        marked
    ]
    tags = tags | {274: ("H", 1)} | ({330: ("I", None)} if children else {})
    path = write_tiff(tmp_path / "a.tif", [(small[0] | tags, small[1]), packed_page(samples, bits)])
    found = read_picture(path, PictureReading(keep_codes=True))
    assert np.array_equal(found.samples, planes(samples))
    assert any("page 2 of the TIFF is read" in note for note in found.notes)


def test_a_picture_before_its_reduced_pages_is_read_and_a_stack_is_told(tmp_path):
    small = packed_page(DEEP[::2, ::2], 16, tags={254: ("I", 1)})
    path = write_tiff(tmp_path / "a.tif", [packed_page(DEEP, 16), small])
    found = read_picture(path)
    assert np.array_equal(found.samples, planes(DEEP))
    assert found.notes == ()
    stack = write(tmp_path / "b.tif", np.stack([DEEP, DEEP // 2]), photometric="rgb")
    found = read_picture(stack)
    assert np.array_equal(found.samples, planes(DEEP))
    assert any("one page of the TIFF is read, 1 more are not" in note for note in found.notes)


@pytest.mark.parametrize("kind", ["CIELab", "ICCLab"])
@pytest.mark.parametrize("bits", [8, 16])
def test_lab_becomes_the_colours_that_littlecms_gives(tmp_path, kind, bits):
    lab = np.zeros((24, 24, 3), np.uint8)
    lab[..., 0] = np.linspace(90, 180, 24)[None, :]
    lab[..., 1:] = (np.linspace(116, 140, 24)[:, None, None]).astype(np.uint8)
    signed = lab ^ np.array([0, 128, 128], np.uint8)
    picture = Image.frombytes("LAB", (24, 24), signed.tobytes())
    way = ImageCms.buildTransform(
        ImageCms.createProfile("LAB"),
        ImageCms.createProfile("sRGB"),
        "LAB",
        "RGB",
        1,
        ImageCms.Flags.NOOPTIMIZE,
    )
    expected = np.asarray(ImageCms.applyTransform(picture, way))
    stored = lab if kind == "ICCLab" else signed
    if bits == 16:
        wide = stored.astype(np.uint16)
        stored = np.stack([wide[..., 0] * 257, wide[..., 1] << 8, wide[..., 2] << 8], -1)
    page = packed_page(stored, bits, photometric=8 if kind == "CIELab" else 9)
    found = encode_srgb(read_scene(write_tiff(tmp_path / "a.tif", [page])))
    assert np.abs(found - planes(expected) / 255).max() < 3 / 255


@pytest.mark.parametrize("bits", [1, 2, 4, 8])
@pytest.mark.parametrize("scale", [257, 1])
def test_palettes_are_looked_up(tmp_path, bits, scale):
    indices = RNG.integers(0, 1 << bits, (HIGH, WIDE), dtype=np.uint16)
    table = RNG.integers(0, 256, (3, 1 << bits), dtype=np.uint16)
    table[0, 0] = 255
    page = packed_page(indices, bits, photometric=3, tags={320: ("H", (table * scale).ravel())})
    found = read_picture(write_tiff(tmp_path / "a.tif", [page]), PictureReading(keep_codes=True))
    assert np.array_equal(found.samples, table[:, indices])


@pytest.mark.parametrize("compression", ["tiff_lzw", "packbits", "tiff_adobe_deflate", "jpeg"])
@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1", "I;16"])
def test_compressed_files_of_pillow_are_read_or_named(tmp_path, compression, mode):
    if compression == "jpeg" and mode in ("P", "1", "I;16"):
        pytest.skip("JPEG holds 8 bits of grey or colour")
    if mode == "I;16":
        picture = Image.fromarray(DEEP[..., 0])
    else:
        smooth = cv2.GaussianBlur(EIGHT, (9, 9), 3)
        alpha = np.full((HIGH, WIDE, 1), 255, np.uint8)
        picture = Image.fromarray(np.dstack([smooth, alpha])).convert(mode)
    path = tmp_path / "a.tif"
    picture.save(path, compression=compression)
    again = Image.open(path)
    wanted = np.asarray(again if mode == "I;16" else again.convert("RGB"))
    found = read_picture(path, PictureReading(keep_codes=True)).samples
    expected = np.stack([wanted] * 3) if mode == "I;16" else planes(wanted)
    tolerance = 3 if compression == "jpeg" else 0
    assert np.abs(found.astype(int) - expected).max() <= tolerance


def test_alpha_does_not_change_colours(tmp_path):
    for dtype, colours in ((np.uint8, EIGHT), (np.uint16, DEEP)):
        alpha = np.arange(HIGH * WIDE).reshape(HIGH, WIDE, 1).astype(dtype)
        path = write(
            tmp_path / "a.tif",
            np.dstack([colours, alpha]),
            photometric="rgb",
            extrasamples=["unassalpha"],
        )
        found = read_picture(path, PictureReading(keep_codes=True))
        assert np.array_equal(found.samples, planes(colours))
        assert "alpha channel dropped" in found.notes


@pytest.mark.parametrize(
    ("tags", "samples", "bits", "words"),
    [
        ({262: ("H", 5)}, 4, 8, "inks"),
        ({262: ("H", 10)}, 3, 8, "ITU Lab"),
        ({262: ("H", 4)}, 1, 8, "transparency mask"),
        ({262: ("H", 34892)}, 1, 16, "linear RAW"),
        ({262: ("H", 2), 338: ("H", [0, 0])}, 5, 8, "5 samples per pixel"),
        ({339: ("H", [2, 2, 2])}, 3, 16, "signed integers"),
        ({339: ("H", [3, 3, 3])}, 3, 24, "floats of 24 bits"),
        ({339: ("H", [1, 1, 1])}, 3, 32, "integers of 32 bits"),
        ({259: ("H", 32773), 317: ("H", 2)}, 3, 8, "PackBits with a predictor"),
        ({258: ("H", [5, 6, 5])}, 3, 8, r"samples of \[5, 6\] bits"),
        ({259: ("H", 34887), 317: ("H", 2)}, 3, 8, "LERC with a predictor"),
        ({262: ("H", 8)}, 1, 8, "Lab with 1 of its 3 samples"),
        ({262: ("H", 6)}, 2, 8, "YCbCr with 2 of its 3 samples"),
        ({32997: ("I", 16)}, 1, 16, "16 layers in depth"),
        ({259: ("H", 34661)}, 1, 1, "JBIG"),
        ({259: ("H", 32771)}, 1, 1, "CCITT RLE in words"),
        ({259: ("H", 34676)}, 3, 16, "SGILog"),
        ({259: ("H", 32809)}, 1, 4, "ThunderScan"),
        ({259: ("H", 65000)}, 3, 8, "compression 65000"),
    ],
)
def test_what_is_not_read_is_refused_by_its_name(tmp_path, tags, samples, bits, words):
    shaped = np.zeros((8, 8, samples), np.uint16)
    page = packed_page(shaped, bits)
    path = write_tiff(tmp_path / "a.tif", [(page[0] | tags, page[1])])
    with pytest.raises(DecodeError, match=words):
        read_picture(path)
    with pytest.raises(DecodeError, match=words):
        read_scene(path)


@pytest.mark.parametrize(
    ("compression", "name"), [(5, "LZW"), (50000, "Zstandard"), (50002, "JPEG XL")]
)
@pytest.mark.parametrize("bits", [12, 16])
def test_what_needs_imagecodecs_names_it(tmp_path, compression, name, bits):
    if importlib.util.find_spec("imagecodecs"):
        pytest.skip("imagecodecs is installed")
    page = packed_page(DEEP, bits, planar=True)
    path = write_tiff(tmp_path / "a.tif", [(page[0] | {259: ("H", compression)}, page[1])])
    with pytest.raises(DecodeError, match=rf"{name}.*needs imagecodecs: pip install"):
        read_picture(path)


@pytest.mark.parametrize(
    ("compression", "pack"), [(8, zlib.compress), (32946, zlib.compress), (34925, lzma.compress)]
)
@pytest.mark.parametrize("sound", [False, True])
def test_strips_that_become_too_large_are_refused(tmp_path, compression, pack, sound):
    tags, segments = packed_page(DEEP, 16, planar=True)
    packed = [pack(segment) for segment in segments]
    if not sound:
        packed[0] = pack(bytes(50_000_000))
    path = write_tiff(tmp_path / "a.tif", [(tags | {259: ("H", compression)}, packed)])
    if sound:
        assert np.array_equal(read_picture(path).samples, planes(DEEP))
        return
    with pytest.raises(DecodeError, match="holds more than its"):
        read_picture(path)


@pytest.mark.parametrize("bits", [1, 4, 12, 14])
def test_packed_strips_that_become_too_large_take_no_memory(tmp_path, bits):
    codes = (DEEP[..., 0] >> (16 - bits)).astype(np.uint16)
    tags, segments = packed_page(codes, bits)
    segments = [zlib.compress(segments[0] + bytes(200_000_000))]
    path = write_tiff(tmp_path / "a.tif", [(tags | {259: ("H", 8)}, segments)])
    tracemalloc.start()
    try:
        read_picture(path)
        assert tracemalloc.get_traced_memory()[1] < 5_000_000
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("size", [(200_000, 200_000), (2**31, 1), (0, 5)])
@pytest.mark.parametrize("planar", [False, True])
def test_sizes_that_a_file_cannot_hold_are_refused(tmp_path, size, planar):
    tags, segments = packed_page(DEEP, 16, planar=planar)
    tags |= {256: ("I", size[0]), 257: ("I", size[1])}
    with pytest.raises(DecodeError, match=f"claims {size[0]}x{size[1]} pixels"):
        read_picture(write_tiff(tmp_path / "a.tif", [(tags, segments)]))


@pytest.mark.parametrize("bits", [4, 8, 12, 16])
@pytest.mark.parametrize("photometric", [0, 1])
def test_sparse_tiles_are_dark_and_told(tmp_path, bits, photometric):
    codes = (DEEP[..., 0] >> (16 - bits)).astype(np.uint16)
    tags, tiles = packed_page(codes, bits, tile=(16, 16), photometric=photometric)
    tags[339] = ("H", 1)
    path = write_tiff(tmp_path / "a.tif", [(tags, tiles)])
    sparse_tiff(path, 5)
    found = read_picture(path, PictureReading(keep_codes=True))
    assert "1 strips or tiles hold no data: their samples are 0" in found.notes
    wanted_path = write_tiff(tmp_path / "b.tif", [(tags, tiles)])
    wanted = read_picture(wanted_path, PictureReading(keep_codes=True)).samples
    hole = np.zeros(wanted.shape[1:], dtype=bool)
    hole[16:32, 16:32] = True
    assert np.array_equal(found.samples[:, ~hole], wanted[:, ~hole])
    assert len(np.unique(found.samples[:, hole])) == 1


def sparse_tiff(path, number):
    """Take the place and the length of a tile out of a file."""
    data = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as file:
        for tag in (324, 325):
            struct.pack_into("<I", data, file.pages[0].tags[tag].valueoffset + 4 * number, 0)
    path.write_bytes(data)


@pytest.mark.parametrize("orientation", range(1, 9))
@pytest.mark.parametrize("planar", [False, True])
def test_unusual_files_stay_as_stored_too(tmp_path, orientation, planar):
    page = packed_page(DEEP, 16, planar=planar, tags={274: ("H", orientation)})
    found = read_picture(write_tiff(tmp_path / "a.tif", [page]))
    assert found.orientation == orientation
    assert np.array_equal(found.samples, planes(DEEP))
