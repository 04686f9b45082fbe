"""Colour spaces that files state are honoured as LittleCMS does, or named in a note."""

import io
import struct
import zlib

import numpy as np
import pytest
import tifffile
from PIL import Image, ImageCms, PngImagePlugin

from camkit.colorimetry import D65, REC709_PRIMARIES, adapt_white, encode_srgb, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.files.formats.color_space import (
    ADOBE_RGB_GAMMA,
    ADOBE_RGB_PRIMARIES,
    P3_PRIMARIES,
    REC2020_PRIMARIES,
)
from camkit.runtime.files.formats.icc_profile import PCS_WHITE
from camkit.runtime.files.picture import read_light, read_picture, read_scene
from camkit.runtime.output.icc import SRGB_CURVE, _assemble, _curve, _text, _xyz
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.tone_curve import PictureReading
from tests.data_folder import data_path

TWO_CODES = 2.1 / 255
COLOURS = np.random.default_rng(8).integers(70, 190, (16, 24, 3), dtype=np.uint8)
SPACES = {
    "Adobe RGB": (ADOBE_RGB_PRIMARIES, (ADOBE_RGB_GAMMA,)),
    "Display P3": (P3_PRIMARIES, SRGB_CURVE),
    "gamma 1.8": (REC709_PRIMARIES, (1.8,)),
    "Rec.2020": (REC2020_PRIMARIES, (2.4,)),
    "ProPhoto": (((0.7347, 0.2653), (0.1596, 0.8404), (0.0366, 0.0001)), (1.8,)),
    "linear": (REC709_PRIMARIES, (1.0,)),
}


def profile_of(name):
    primaries, curve = SPACES[name]
    white = (0.3457, 0.3585) if name == "ProPhoto" else D65
    colorants = adapt_white(white, PCS_WHITE) @ rgb_to_xyz(primaries, white)
    tags = [(b"desc", _text(name))]
    tags += [(tag, _xyz(colorants[:, n])) for n, tag in enumerate((b"rXYZ", b"gXYZ", b"bXYZ"))]
    return _assemble(tags + [(tag, _curve(curve)) for tag in (b"rTRC", b"gTRC", b"bTRC")])


def grey_profile(gamma):
    made = _assemble(
        [
            (b"desc", _text("my grey")),
            (b"wtpt", _xyz(np.array([0.9642, 1, 0.8249]))),
            (b"kTRC", _curve((gamma,))),
        ]
    )
    return made[:16] + b"GRAY" + made[20:]


def table_profile():
    """Return a profile of tables, which swap red and blue of a small Lab lattice."""
    source = ImageCms.createProfile("sRGB")
    lab = ImageCms.buildTransform(source, ImageCms.createProfile("LAB"), "RGB", "LAB", 1)
    side = 9
    grid = np.stack(np.meshgrid(*[np.linspace(0, 255, side)] * 3, indexing="ij"), -1)
    codes = np.rint(grid).astype(np.uint8).reshape(1, -1, 3)[..., ::-1]
    out = np.asarray(ImageCms.applyTransform(Image.fromarray(np.ascontiguousarray(codes)), lab))
    table = out.reshape(-1, 3).astype(np.uint8)
    content = b"mft1" + bytes(4) + bytes([3, 3, side, 0])
    content += b"".join(struct.pack(">i", n) for n in (65536, 0, 0, 0, 65536, 0, 0, 0, 65536))
    ramp = bytes(range(256))
    content += ramp * 3 + table.tobytes() + ramp * 3
    made = _assemble(
        [
            (b"desc", _text("tables")),
            (b"wtpt", _xyz(np.array([0.9642, 1, 0.8249]))),
            (b"A2B0", content),
        ]
    )
    return made[:8] + b"\x02\x10\0\0" + made[12:16] + b"RGB Lab " + made[24:]


def by_littlecms(codes, profile):
    mode = "L" if codes.ndim == 2 else "RGB"
    source = ImageCms.ImageCmsProfile(io.BytesIO(profile))
    way = ImageCms.buildTransform(source, ImageCms.createProfile("sRGB"), mode, "RGB", 1)
    return (
        np.moveaxis(np.asarray(ImageCms.applyTransform(Image.fromarray(codes), way)), -1, 0) / 255
    )


def write(path, codes, profile=None, **options):
    if path.suffix == ".tif":
        tags = [(34675, 7, len(profile), profile, True)] if profile else []
        tifffile.imwrite(
            path, codes, photometric="rgb" if codes.ndim == 3 else "minisblack", extratags=tags
        )
        return path
    Image.fromarray(codes).save(path, icc_profile=profile, quality=100, subsampling=0, **options)
    return path


def stored(path):
    with Image.open(path) as picture:
        return np.asarray(picture)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("name", SPACES)
def test_profiles_are_honoured_as_littlecms_does(tmp_path, suffix, name):
    profile = profile_of(name)
    path = write(tmp_path / f"a{suffix}", COLOURS, profile)
    expected = by_littlecms(stored(path), profile)
    capture = read_picture(path)
    assert np.abs(encode_srgb(capture.linear_rows(0, 16)) - expected).max() < TWO_CODES
    assert np.abs(encode_srgb(read_scene(path)) - expected).max() < TWO_CODES
    assert any(name in note for note in capture.notes)


@pytest.mark.parametrize("name", SPACES)
def test_colours_outside_rec709_are_light_of_a_scene(tmp_path, name):
    pure = np.kron(np.eye(3, dtype=np.uint8)[None] * 255, np.ones((8, 8, 1), np.uint8))
    write(tmp_path / "pure.png", pure, profile_of(name))
    scene = read_scene(tmp_path / "pure.png")
    np.testing.assert_array_equal(read_light(tmp_path / "pure.png"), np.maximum(scene, 0))


def test_the_adobe_rgb_jpeg_of_reports_has_the_colours_of_littlecms():
    found = read_capture(data_path("reports/adobe_rgb.jpg"))
    wanted = stored(data_path("reports/adobe_rgb_expected_srgb.png"))
    codes = encode_srgb(found.linear_rows(0, found.height)) * 255
    assert np.abs(codes - np.moveaxis(wanted, -1, 0)).max() < 2


def test_a_profile_of_tables_goes_through_littlecms(tmp_path):
    profile = table_profile()
    for suffix in (".png", ".tif"):
        path = write(tmp_path / f"a{suffix}", COLOURS, profile)
        expected = by_littlecms(COLOURS, profile)
        assert np.abs(expected - np.moveaxis(COLOURS, -1, 0) / 255).max() > 0.1
        found = encode_srgb(read_picture(path).linear_rows(0, 16))
        assert np.abs(found - expected).max() < 1 / 255
    path = write(tmp_path / "deep.tif", COLOURS.astype(np.uint16) * 257, profile)
    assert np.abs(encode_srgb(read_scene(path)) - expected).max() < 1 / 255


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("gamma", [1.0, 1.8, 2.2])
def test_grey_profiles_are_honoured(tmp_path, suffix, gamma):
    path = write(tmp_path / f"a{suffix}", COLOURS[..., 0], grey_profile(gamma))
    expected = np.stack([(stored(path) / 255) ** gamma] * 3)
    assert np.abs(read_picture(path).linear_rows(0, 16) - expected).max() < 1e-4
    assert np.abs(read_scene(path) - expected).max() < 1e-4


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
def test_a_grey_profile_of_colours_is_named_and_not_applied(tmp_path, suffix):
    plain = read_picture(write(tmp_path / f"a{suffix}", COLOURS))
    found = read_picture(write(tmp_path / f"b{suffix}", COLOURS, grey_profile(1.8)))
    assert np.array_equal(found.samples, plain.samples)
    assert any(
        "of grey for colours, which is ignored: codes are read as sRGB" in note
        for note in found.notes
    )


def test_a_grey_picture_of_an_rgb_profile_has_its_curve(tmp_path):
    path = write(tmp_path / "a.png", COLOURS[..., 0], profile_of("Adobe RGB"))
    expected = np.stack([(COLOURS[..., 0] / 255) ** ADOBE_RGB_GAMMA] * 3)
    assert np.abs(read_picture(path).linear_rows(0, 16) - expected).max() < 1e-4


def in_segments(data, profile, size, order=1, drop=None):
    parts = [profile[at : at + size] for at in range(0, len(profile), size)]
    segments = [
        b"\xff\xe2"
        + struct.pack(">H", len(part) + 16)
        + b"ICC_PROFILE\0"
        + bytes([n, len(parts)])
        + part
        for n, part in enumerate(parts, 1)
        if n != drop
    ]
    return data[:2] + b"".join(segments[::order]) + data[2:]


@pytest.mark.parametrize("order", [1, -1])
def test_a_profile_in_several_segments_is_joined(tmp_path, order):
    data = write(tmp_path / "a.jpg", COLOURS).read_bytes()
    path = tmp_path / "b.jpg"
    path.write_bytes(in_segments(data, profile_of("Adobe RGB"), 100, order))
    expected = by_littlecms(stored(tmp_path / "a.jpg"), profile_of("Adobe RGB"))
    assert np.abs(encode_srgb(read_picture(path).linear_rows(0, 16)) - expected).max() < TWO_CODES
    path.write_bytes(in_segments(data, profile_of("Adobe RGB"), 100, order, drop=2))
    assert "parts, of which it has" in read_picture(path).notes[0]
    with pytest.raises(DecodeError, match="save it as sRGB"):
        read_scene(path)


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".tif"])
@pytest.mark.parametrize("damage", ["cut", "noise", "CMYK"])
def test_profiles_that_cannot_be_honoured_are_named(tmp_path, suffix, damage):
    whole = profile_of("Adobe RGB")
    profile = {
        "cut": whole[:200],
        "noise": whole[:128] + b"\xff" * 200,
        "CMYK": whole[:16] + b"CMYK" + whole[20:],
    }[damage]
    path = write(tmp_path / f"a{suffix}", COLOURS, profile)
    assert any("states" in note and "profile" in note for note in read_picture(path).notes)
    with pytest.raises(DecodeError, match="profile"):
        read_scene(path)


def exif_of(index, color_space, suffix=".jpg"):
    exif = Image.Exif()
    exif[271] = "Maker"
    if color_space is not None:
        exif.get_ifd(0x8769)[0xA001] = color_space
    if index:
        exif.get_ifd(0x8769)[0xA005] = {1: index}
    exif.get_ifd(0x8825)[1] = "S"
    exif.get_ifd(0x8825)[2] = (10.0, 0.0, 0.0)
    exif.get_ifd(0x8825)[3] = "E"
    exif.get_ifd(0x8825)[4] = (20.0, 0.0, 0.0)
    return exif


@pytest.mark.parametrize(
    ("index", "color_space", "adobe"),
    [
        ("R03", 65535, True),
        ("R03", None, True),
        ("R98", 1, False),
        ("R98", None, False),
        ("R03", 1, False),
        (None, 2, True),
        (None, 65535, False),
    ],
)
@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_exif_tells_adobe_rgb(tmp_path, index, color_space, adobe, suffix):
    path = tmp_path / f"a{suffix}"
    write(path, COLOURS, exif=exif_of(index, color_space))
    expected = np.moveaxis(stored(path), -1, 0) / 255
    if adobe:
        expected = by_littlecms(stored(path), profile_of("Adobe RGB"))
    capture = read_picture(path)
    assert np.abs(encode_srgb(capture.linear_rows(0, 16)) - expected).max() < TWO_CODES
    assert capture.metadata.latitude_deg == -10


def test_a_profile_goes_before_exif(tmp_path):
    srgb = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    path = write(tmp_path / "a.png", COLOURS, srgb, exif=exif_of("R03", 65535))
    assert "decoded from sRGB" in read_picture(path).notes[0]


def png_with(path, chunks, codes=COLOURS):
    info = PngImagePlugin.PngInfo()
    Image.fromarray(codes).save(path, pnginfo=info)
    data = path.read_bytes()
    more = b"".join(
        struct.pack(">I", len(content))
        + name
        + content
        + struct.pack(">I", zlib.crc32(name + content))
        for name, content in chunks
    )
    path.write_bytes(data[:33] + more + data[33:])
    return path


GAMMA = (b"gAMA", struct.pack(">I", 55556))
SRGB_GAMMA = (b"gAMA", struct.pack(">I", 45455))
ADOBE_POINTS = (b"cHRM", struct.pack(">8I", 31270, 32900, 64000, 33000, 21000, 71000, 15000, 6000))
RENDERING = (b"sRGB", b"\0")
P3 = (b"cICP", bytes([12, 13, 0, 1]))
PQ = (b"cICP", bytes([9, 16, 0, 1]))
ICC = (b"iCCP", b"x\0\0" + zlib.compress(profile_of("Adobe RGB")))


@pytest.mark.parametrize(
    ("chunks", "name"),
    [
        ([RENDERING], None),
        ([SRGB_GAMMA], None),
        ([RENDERING, GAMMA, ADOBE_POINTS], None),
        ([GAMMA], "gamma 1.8"),
        ([ICC, GAMMA], "Adobe RGB"),
        ([P3, ICC], "Display P3"),
        ([P3], "Display P3"),
    ],
)
def test_chunks_of_png_are_honoured_in_their_order(tmp_path, chunks, name):
    path = png_with(tmp_path / "a.png", chunks)
    expected = (
        np.moveaxis(COLOURS, -1, 0) / 255
        if name is None
        else by_littlecms(COLOURS, profile_of(name))
    )
    assert np.abs(encode_srgb(read_picture(path).linear_rows(0, 16)) - expected).max() < TWO_CODES
    assert np.abs(encode_srgb(read_scene(path)) - expected).max() < TWO_CODES


def test_gamma_with_chromaticities_is_honoured(tmp_path):
    adobe_gamma = (b"gAMA", struct.pack(">I", round(100_000 / ADOBE_RGB_GAMMA)))
    path = png_with(tmp_path / "a.png", [ADOBE_POINTS, (b"gAMA", struct.pack(">I", 45000))])
    assert "cHRM" in read_picture(path).notes[0]
    path = png_with(tmp_path / "a.png", [ADOBE_POINTS, adobe_gamma])
    # 1 / 2.2 stands for sRGB, whose curve is near
    expected = by_littlecms(COLOURS, profile_of("Adobe RGB"))
    assert np.abs(encode_srgb(read_picture(path).linear_rows(0, 16)) - expected).max() < 0.03


def test_code_points_that_are_not_known_are_named(tmp_path):
    path = png_with(tmp_path / "a.png", [PQ])
    assert "9/16/0/1" in read_picture(path).notes[0]
    with pytest.raises(DecodeError, match="cICP"):
        read_scene(path)


def test_codes_of_16_bits_stay_linear_and_the_profile_is_named(tmp_path):
    deep = COLOURS.astype(np.uint16) * 257
    path = write(tmp_path / "a.tif", deep, profile_of("Adobe RGB"))
    capture = read_picture(path)
    assert np.array_equal(capture.samples, np.moveaxis(deep, -1, 0))
    assert "'Adobe RGB' is not applied" in capture.notes[0]
    assert read_picture(write(tmp_path / "b.tif", deep, profile_of("linear"))).notes == ()
    expected = by_littlecms(COLOURS, profile_of("Adobe RGB"))
    assert np.abs(encode_srgb(read_scene(path)) - expected).max() < TWO_CODES


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_a_mosaic_is_not_colour_managed(tmp_path, suffix):
    mosaic = COLOURS[..., 0]
    path = write(tmp_path / f"a{suffix}", mosaic, grey_profile(1.8))
    options = MosaicOptions(cfa="RGGB", black_level=0, white_level=255)
    found = read_capture(path, mosaic=options)
    assert np.array_equal(found.samples, mosaic)
    assert found.notes == ("headerless mosaic: CFA and levels are those of the options",)


def test_codes_that_are_kept_name_the_space(tmp_path):
    path = write(tmp_path / "a.png", COLOURS, profile_of("Adobe RGB"))
    found = read_picture(path, PictureReading(keep_codes=True))
    assert np.array_equal(found.samples, np.moveaxis(COLOURS, -1, 0))
    assert "'Adobe RGB' is not applied" in found.notes[0]
