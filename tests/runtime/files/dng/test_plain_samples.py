"""Floats, deflated samples and planes that lie apart come back bit by bit; damage is named."""

import zlib

import numpy as np
import pytest
import rawpy

from camkit.errors import DecodeError
from camkit.runtime.files.dng.predictors import as_floats
from camkit.runtime.raw import read_capture
from tests.dng_builder import build_dng

HEIGHT, WIDTH = 70, 90


def scene(planes=1):
    """Return light with noise in every bit, between 0.01 and 0.9, that float16 holds."""
    rng = np.random.default_rng(0)
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    light = 0.4 + 0.2 * np.sin(x / 9) + 0.15 * np.cos(y / 8) + rng.normal(0, 0.004, x.shape)
    light[:4] *= 0.02
    shades = [light * (1 - 0.2 * p) for p in range(planes)]
    return (np.stack(shades, axis=-1) if planes > 1 else light).astype(np.float16)


def read(path, samples, tags=None, **form):
    build_dng(path / "x.dng", samples, tags, **form)
    return read_capture(path / "x.dng", isolate=False)


FORMS = [
    {}, {"rows_per_strip": 16}, {"chunk": (32, 48)}, {"chunk": (16, 16), "order": ">"},
    {"order": ">"}, {"rows_per_strip": 70, "order": ">"},
]  # fmt: skip


def planar(samples, rows=None, pack=bytes):
    """Return strips of each plane after the other, and the tags that say so."""
    height, planes = samples.shape[0], samples.shape[2]
    strips = [
        pack(samples[top : top + (rows or height), :, plane].tobytes())
        for plane in range(planes)
        for top in range(0, height, rows or height)
    ]
    return strips, {284: ("short", (2,))}


PREDICTORS = [1, 2, 3, 34892, 34893, 34894, 34895]


@pytest.mark.parametrize("planes", [1, 3])
@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("form", FORMS)
def test_floats_are_read_in_every_layout(tmp_path, bits, form, planes):
    samples = scene(planes)
    for extra in ({}, {"compression": 8, "predictor": 3}, {"compression": 8}):
        capture = read(tmp_path, samples.astype(np.float32 if bits != 16 else np.float16),
                       bits=bits, **form, **extra)  # fmt: skip
        found = capture.samples if planes == 1 else np.moveaxis(capture.samples, 0, -1)
        assert capture.samples.dtype == np.float32
        assert np.array_equal(found, samples.astype(np.float32))
        assert capture.white_level == 1


@pytest.mark.parametrize("predictor", PREDICTORS)
@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("order", ["<", ">"])
def test_floats_are_read_behind_every_predictor(tmp_path, predictor, bits, order):
    if bits == 24 and predictor in (2, 34892, 34893):
        pytest.skip("the builder takes differences of 16 and 32 bits")
    samples = scene().astype(np.float32 if bits != 16 else np.float16)
    capture = read(tmp_path, samples, bits=bits, predictor=predictor, compression=8, order=order,
                   chunk=(32, 32))  # fmt: skip
    assert np.array_equal(capture.samples, samples.astype(np.float32))


@pytest.mark.parametrize("predictor", [1, 2, 34892, 34893])
@pytest.mark.parametrize("compression", [8, 32946])
@pytest.mark.parametrize("bits", [8, 16])
def test_deflated_whole_numbers_are_read(tmp_path, predictor, compression, bits):
    samples = np.rint(scene().astype(np.float32) * (2**bits - 20)).astype(f"u{bits // 8}")
    tags = {50714: ("long", (0,)), 50717: ("long", (2**bits - 1,))}
    capture = read(tmp_path, samples, tags, predictor=predictor, compression=compression)
    assert np.array_equal(capture.samples, samples)


def test_a_monochrome_float_is_one_plane_seen_three_times(tmp_path):
    capture = read(tmp_path, scene()[..., None])
    assert capture.cfa is None
    assert np.array_equal(capture.samples, np.stack([scene().astype(np.float32)] * 3))


@pytest.mark.parametrize(("stated", "white"), [(None, 1), (("long", (4,)), 4), (("long", (0,)), 1)])
def test_white_of_floats_is_one_where_the_file_states_none(tmp_path, stated, white):
    capture = read(tmp_path, scene(), {50717: stated})
    assert capture.white_level == white
    assert capture.linear_rows(0, HEIGHT) == pytest.approx(scene() / white, rel=1e-3)


@pytest.mark.parametrize("peak", [1.5, 16, 3000])
@pytest.mark.parametrize("planes", [1, 3])
def test_samples_above_white_are_kept_and_change_nothing_else(tmp_path, peak, planes):
    samples = scene(planes)
    samples[40, 40:44] = peak
    capture = read(tmp_path, samples)
    light = capture.linear_rows(0, HEIGHT)
    found = light if planes == 1 else np.moveaxis(light, 0, -1)
    assert np.array_equal(found, samples.astype(np.float32))
    assert any("lie above white 1" in note for note in capture.notes)
    if planes == 1:
        clipped = capture.saturated_rows(0, HEIGHT)
        assert np.array_equal(np.argwhere(clipped), [[40, n] for n in range(40, 44)])


def test_a_float_mosaic_is_clipped_from_the_share_of_white_on_that_others_are(tmp_path):
    samples = scene().astype(np.float32)
    samples[10, 10:13] = 0.98, 0.991, 1.0
    capture = read(tmp_path, samples)
    assert capture.saturated_rows(0, HEIGHT)[10, 10:13].tolist() == [False, True, True]


def test_black_of_floats_is_taken_off(tmp_path):
    tags = {50714: ("rational", (0.125,)), 50716: ("srational", (0.01, -0.01) * (HEIGHT // 2))}
    black = 0.125 + np.tile([0.01, -0.01], HEIGHT // 2)[:, None]
    capture = read(tmp_path, (black + 0.875 * scene()).astype(np.float32), tags)
    assert capture.linear_rows(0, HEIGHT) * (1 - 0.125) / 0.875 == pytest.approx(
        scene().astype(float), abs=0.015
    )


def test_samples_that_are_no_numbers_are_counted(tmp_path):
    samples = scene()
    samples[5, 5], samples[6, 6], samples[7, 7] = np.nan, np.inf, -np.inf
    capture = read(tmp_path, samples)
    assert any("3 samples are NaN or infinite" in note for note in capture.notes)
    assert np.isnan(capture.linear_rows(0, HEIGHT)[[5, 6, 7], [5, 6, 7]]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({258: ("short", (64,))}, "64 bits"),
        ({317: ("short", (9,))}, "predictor 9"),
        ({259: ("short", (7,))}, "method 7"),
        ({259: ("short", (52546,))}, "JPEG XL"),
        ({33421: ("short", (6, 6)), 33422: ("byte", (0, 1, 2) * 12)}, "CFA of 6x6"),
        ({33422: ("byte", (0, 1, 1, 5))}, "CFA of 2x2"),
    ],
)
def test_floats_that_are_not_read_are_refused_by_their_name(tmp_path, change, message):
    with pytest.raises(DecodeError, match=message) as error:
        read(tmp_path, scene(), change, compression=8)
    assert "damage" not in str(error.value)


@pytest.mark.parametrize("count", [1, 40])
def test_a_byte_that_changed_in_deflated_data_is_damage(tmp_path, count):
    path = build_dng(tmp_path / "x.dng", scene(), compression=8, predictor=3)
    data = bytearray(path.read_bytes())
    for n in range(count):
        data[-len(data) // 4 - 50 * n] ^= 0x55
    path.write_bytes(data)
    with pytest.raises(DecodeError, match="damaged"):
        read_capture(path, isolate=False)


def test_a_stream_that_claims_less_than_its_tile_is_damage(tmp_path):
    path = build_dng(tmp_path / "x.dng", scene(), {257: ("long", (HEIGHT + 20,))}, compression=8,
                     rows_per_strip=HEIGHT)  # fmt: skip
    with pytest.raises(DecodeError, match="damaged"):
        read_capture(path, isolate=False)


def test_the_child_sends_floats_as_they_are(tmp_path):
    path = build_dng(tmp_path / "x.dng", scene(), compression=8)
    capture = read_capture(path)
    assert np.array_equal(capture.samples, scene().astype(np.float32))


@pytest.mark.parametrize("light", [1e-6, 0.25, 0.5, 1.0, 3.75])
def test_exponents_of_24_bits_are_those_that_libraw_reads(tmp_path, light):
    samples = scene().astype(np.float32)
    samples[20:24, 20:24] = light
    tags = {50717: ("long", (4,))}
    build_dng(tmp_path / "x.dng", samples, tags, bits=24)
    with rawpy.imread(str(tmp_path / "x.dng")) as file:
        by_libraw = file.raw_image_visible / (16383 / 4)
    found = read_capture(tmp_path / "x.dng", isolate=False).samples
    assert np.abs(found - by_libraw).max() <= 4 / 16383
    assert found[20, 20] == pytest.approx(light, rel=2**-15)


@pytest.mark.parametrize("word", [(0x3F0000, 1.0), (0x3F8000, 1.5), (0xBF0000, -1.0), (1, 2**-78)])
def test_words_of_24_bits_are_numbers(word):
    octets = np.array([[list(word[0].to_bytes(3, "big"))]], dtype=np.uint8)
    assert as_floats(octets)[0, 0] == word[1]


@pytest.mark.parametrize("rows", [None, 16])
@pytest.mark.parametrize("compression", [1, 8])
@pytest.mark.parametrize("dtype", ["<u2", ">u2", "u1", "<f4"])
def test_planes_that_lie_apart_are_read(tmp_path, rows, compression, dtype):
    light = scene(3).astype(np.float64)
    is_float = dtype.endswith("f4")
    top = {"f4": 1, "u2": 60000, "u1": 255}[dtype[-2:]]
    samples = (light * top if is_float else np.rint(light * top)).astype(dtype)
    strips, tags = planar(samples, rows, zlib.compress if compression == 8 else bytes)
    tags |= {50717: ("long", (top,) * 3), 50714: ("long", (0,) * 3)}
    build_dng(tmp_path / "x.dng", samples, tags, compression=compression, pieces=strips,
              rows_per_strip=rows, order=">" if dtype[0] == ">" else "<")  # fmt: skip
    capture = read_capture(tmp_path / "x.dng", isolate=False)
    assert np.array_equal(np.moveaxis(capture.samples, 0, -1), samples)
    assert not any("damage" in note for note in capture.notes)
