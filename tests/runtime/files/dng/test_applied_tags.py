"""Tags of a DNG that LibRaw leaves out are applied: black, white, gains, areas, orientation."""

import struct

import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.raw import read_capture
from tests.dng_builder import build_dng, gain_map, opcode_list

HEIGHT, WIDTH = 96, 128
WHITE, CELL = 4095, np.array([[0.5, 1.0], [1.0, 0.7]])
TOLERANCE = 1.5 / (WHITE - 256)
"""Rounding of the samples, made larger by the gains."""


QUAD = (0, 0, 1, 1, 0, 0, 1, 1, 1, 1, 2, 2, 1, 1, 2, 2)
X_TRANS = tuple("RGB".index(c) for c in "GBGGRGRGRBGBGBGGRGGRGGBGBGBRGRGRGGBG")


def scene(height=HEIGHT, width=WIDTH):
    """Return light of a smooth scene, every place different."""
    y, x = np.mgrid[:height, :width]
    return 0.2 + 0.1 * np.sin(x / 11) + 0.08 * np.cos(y / 7) + 0.1 * x / width


def stored(light, black=256.0, white=WHITE):
    return np.clip(np.rint(black + light * (white - 256)), 0, 65535).astype(np.uint16)


def read(path, samples, tags=None, *, said=None, **form):
    build_dng(path / "x.dng", samples, tags, **form)
    capture = read_capture(path / "x.dng", isolate=False, mosaic=said)
    return capture, capture.linear_rows(0, capture.height)


def damage(capture):
    return [note for note in capture.notes if "damage" in note and "darker" not in note]


DOWN, ACROSS = 8 * np.sin(np.arange(HEIGHT)), 6 * np.cos(np.arange(WIDTH) / 3)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("tags", [{50716: DOWN}, {50715: ACROSS}, {50715: ACROSS, 50716: DOWN}])
def test_black_of_rows_and_columns_is_taken_off(tmp_path, tags, order):
    black = 256 + tags.get(50716, np.zeros(HEIGHT))[:, None] + tags.get(50715, np.zeros(WIDTH))
    told = {tag: ("srational", tuple(values)) for tag, values in tags.items()}
    capture, light = read(tmp_path, stored(scene(), black), told, order=order)
    mean = black.mean() - 256
    assert np.abs(light * (WHITE - 256 - mean) / (WHITE - 256) - scene()).max() < TOLERANCE
    assert capture.notes == ()


@pytest.mark.parametrize("repeat", [(1, 1), (1, 2), (2, 1), (2, 2), (4, 4), (3, 5), (8, 1)])
def test_black_repeats_from_the_first_active_pixel_on(tmp_path, repeat):
    values = 200 + 12.0 * np.arange(repeat[0] * repeat[1]).reshape(repeat)
    whole = np.tile(values, (100, 130))[: HEIGHT - 3, : WIDTH - 5]
    black = np.zeros((HEIGHT, WIDTH))
    black[3:, 5:] = whole
    tags = {
        50829: ("long", (3, 5, HEIGHT, WIDTH)),
        50713: ("short", repeat),
        50714: ("long", tuple(int(n) for n in values.ravel())),
    }
    samples = np.rint(black + 3000 * scene()).astype(np.uint16)
    capture, light = read(tmp_path, samples, tags)
    top, left = HEIGHT - capture.height, WIDTH - capture.width
    span = capture.white_level - np.tile(capture.black_level, (60, 70))
    span = span[: capture.height, : capture.width]
    factor = capture.white_level / WHITE
    assert np.abs(light * span / factor - 3000 * scene()[top:, left:]).max() < 1.5
    assert not damage(capture)


@pytest.mark.parametrize(
    "area", [(3, 5, 95, 127), (0, 1, 96, 128), (1, 0, 96, 128), (2, 2, 93, 125)]
)
def test_odd_areas_and_crops_shift_the_pattern_and_are_no_damage(tmp_path, area):
    top, left, bottom, right = area
    colours = np.zeros((HEIGHT, WIDTH))
    colours[top:, left:] = np.tile(CELL, (60, 70))[: HEIGHT - top, : WIDTH - left]
    size = (right - left - 3, bottom - top - 3)
    tags = {50829: ("long", area), 50719: ("long", (1, 1)), 50720: ("long", size)}
    capture, light = read(tmp_path, stored(scene() * colours), tags)
    places = {"R": 0.5, "G": 1.0, "B": 0.7}
    expected = np.array([places[letter] for letter in capture.cfa]).reshape(2, 2)
    found = [[light[y:80:2, x:100:2].mean() for x in (0, 1)] for y in (0, 1)]
    assert np.array(found) / found[0][1] * expected[0, 1] == pytest.approx(expected, rel=0.03)
    assert not damage(capture)


@pytest.mark.parametrize("form", [{}, {"compression": 8, "chunk": (32, 32)}])
@pytest.mark.parametrize("size", [(97, 131), (97, 128), (96, 129), (95, 127)])
def test_odd_sizes_are_no_damage(tmp_path, size, form):
    capture, light = read(tmp_path, stored(scene(*size)), **form)
    assert light == pytest.approx(scene(*size), abs=TOLERANCE)
    assert not damage(capture)


@pytest.mark.parametrize("stated", [0, 1, 3, 6, 8, 9, 16, 255])
def test_an_orientation_that_is_none_turns_nothing(tmp_path, stated):
    capture, _ = read(tmp_path, stored(scene()), {274: ("short", (stated,))})
    assert capture.orientation == (stated if 1 <= stated <= 8 else 1)


MASKS = {
    "left": [(0, 0, 96, 16)],
    "several": [(0, 0, 96, 8), (0, 8, 8, 128)],
    "corner": [(0, 0, 8, 16), (88, 0, 96, 16)],
    "tiny": [(0, 0, 8, 8)],
}


@pytest.mark.parametrize("orientation", [1, 6])
@pytest.mark.parametrize("name", MASKS)
def test_masked_areas_measure_black(tmp_path, name, orientation):
    rng = np.random.default_rng(1)
    levels = np.array([[260.0, 262.0], [264.0, 258.0]])
    black = np.tile(levels, (48, 64))
    light = scene()
    light[:8], light[:, :16] = 0, 0
    samples = stored(light, black + rng.normal(0, 2, light.shape))
    tags = {
        274: ("short", (orientation,)),
        50829: ("long", (8, 16, HEIGHT, WIDTH)),
        50830: ("long", tuple(n for area in MASKS[name] for n in area)),
    }
    capture, _ = read(tmp_path, samples, tags)
    expected = 256 if name == "tiny" else levels
    assert capture.black_level == pytest.approx(expected, abs=0.6)
    assert any("MaskedAreas" in n or "masked areas" in n for n in capture.notes)
    assert not damage(capture)
    told, _ = read(tmp_path, samples, tags, said=MosaicOptions(black_level=250))
    assert (told.black_level == 250).all()


@pytest.mark.parametrize("areas", [(0, 40, 96, 60), (0, 0, 96, 400), (5, 5, 5, 9), (0, 0, 9)])
def test_masked_areas_that_see_light_or_cannot_be_are_named(tmp_path, areas):
    capture, _ = read(tmp_path, stored(scene()), {50830: ("long", areas)})
    assert (capture.black_level == 256).all()
    assert any("MaskedAreas" in note for note in damage(capture))


def test_masked_areas_far_from_the_stated_black_are_measured_and_named(tmp_path):
    light = scene()
    light[:, :16] = 0
    tags = {
        50714: ("long", (600,)),
        50829: ("long", (0, 16, HEIGHT, WIDTH)),
        50830: ("long", (0, 0, HEIGHT, 16)),
    }
    rough = np.random.default_rng(0).normal(256, 2, light.shape)
    capture, _ = read(tmp_path, stored(light, rough), tags)
    assert capture.black_level == pytest.approx(256, abs=1)
    assert any("replaces the stated 600" in note for note in damage(capture))


def shading(v=5, h=7):
    y, x = np.mgrid[:v, :h]
    return 1 + 0.4 * ((x - (h - 1) / 2) ** 2 + (y - (v - 1) / 2) ** 2) / (h * v)


def spread(grid, height, width):
    """Return a grid over a picture by the words of the specification, pixel by pixel."""
    v, h = grid.shape
    out = np.empty((height, width))
    for y in range(height):
        for x in range(width):
            down = min(max((y + 0.5) / height * (v - 1), 0), v - 1)
            across = min(max((x + 0.5) / width * (h - 1), 0), h - 1)
            j, i = min(int(down), v - 2), min(int(across), h - 2)
            f, g = down - j, across - i
            out[y, x] = (
                grid[j, i] * (1 - f) * (1 - g) + grid[j + 1, i] * f * (1 - g)
                + grid[j, i + 1] * (1 - f) * g + grid[j + 1, i + 1] * f * g
            )  # fmt: skip
    return out


def test_four_gain_maps_one_of_each_place_in_the_cell_are_applied(tmp_path):
    gain, maps = np.ones((HEIGHT, WIDTH)), []
    for n, (dy, dx) in enumerate(np.ndindex(2, 2)):
        grid = shading() * (1 + 0.05 * n)
        gain[dy::2, dx::2] = spread(grid, HEIGHT, WIDTH)[dy::2, dx::2]
        maps.append((9, gain_map(grid, (dy, dx, HEIGHT, WIDTH), pitch=(2, 2)), 1))
    capture, light = read(tmp_path, stored(scene() / gain), {51009: opcode_list(*maps)})
    assert light == pytest.approx(scene(), abs=2 * TOLERANCE)
    assert any("GainMap of OpcodeList2 applied" in note for note in capture.notes)


@pytest.mark.parametrize("area", [(10, 20, 70, 100), (0, 0, 96, 128), (0, 0, 500, 500)])
def test_a_gain_map_changes_its_area_alone_also_behind_margins(tmp_path, area):
    gain = np.ones((HEIGHT, WIDTH))
    top, left, bottom, right = area
    gain[top:bottom, left:right] = 1.5
    whole = np.zeros((HEIGHT + 4, WIDTH + 6))
    whole[4:, 6:] = scene() / gain
    tags = {
        50829: ("long", (4, 6, HEIGHT + 4, WIDTH + 6)),
        51009: opcode_list((9, gain_map(np.full((1, 1), 1.5), area))),
    }
    _, light = read(tmp_path, stored(whole), tags)
    assert light == pytest.approx(scene(), abs=2 * TOLERANCE)


@pytest.mark.parametrize("number", [51009, 51022])
@pytest.mark.parametrize("planes", [1, 3])
def test_gain_maps_of_planes_are_applied_to_each(tmp_path, number, planes):
    grid = np.stack([shading() * (1 + 0.1 * p) for p in range(planes)], axis=-1)
    gain = np.stack(
        [spread(grid[..., min(p, planes - 1)], HEIGHT, WIDTH) for p in range(3)], axis=-1
    )
    light = np.stack([scene()] * 3, axis=-1)
    lists = opcode_list((9, gain_map(grid, (0, 0, HEIGHT, WIDTH), plane=(0, 3))))
    _, found = read(tmp_path, stored(light / gain), {number: lists})
    assert np.moveaxis(found, 0, -1) == pytest.approx(light, abs=2 * TOLERANCE)


def test_a_gain_map_behind_the_demosaic_reaches_the_mosaic_by_colour(tmp_path):
    grid = np.stack([shading() * n for n in (1.0, 1.1, 1.3)], axis=-1)
    colours = np.tile([[0, 1], [1, 2]], (HEIGHT // 2, WIDTH // 2))
    fields = np.stack([spread(grid[..., p], HEIGHT, WIDTH) for p in range(3)])
    gain = np.take_along_axis(fields, colours[None], axis=0)[0]
    lists = opcode_list((9, gain_map(grid, (0, 0, HEIGHT, WIDTH), plane=(0, 3))))
    _, light = read(tmp_path, stored(scene() / gain), {51022: lists})
    assert light == pytest.approx(scene(), abs=2 * TOLERANCE)


def test_what_the_sensor_clipped_stays_clipped_behind_a_gain(tmp_path):
    light = scene()
    light[40:60, 40:60] = 2.0
    samples = np.minimum(stored(light / 0.8), WHITE)
    lists = opcode_list((9, gain_map(np.full((1, 1), 0.8), (0, 0, HEIGHT, WIDTH))))
    capture, found = read(tmp_path, samples, {51009: lists})
    assert capture.saturated_rows(0, HEIGHT)[40:60, 40:60].all()
    assert found[:30] == pytest.approx(light[:30], abs=2 * TOLERANCE)


def test_vignetting_of_a_polynomial_is_undone(tmp_path):
    terms, (x0, y0) = (0.5, -0.1, 0.05, 0.0, 0.0), (0.45, 0.55)
    y, x = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    far = max(x0, 1 - x0) ** 2 * WIDTH**2 + max(y0, 1 - y0) ** 2 * HEIGHT**2
    square = ((x - x0 * WIDTH) ** 2 + (y - y0 * HEIGHT) ** 2) / far
    gain = 1 + sum(k * square ** (n + 1) for n, k in enumerate(terms))
    lists = opcode_list((3, struct.pack(">7d", *terms, x0, y0)))
    capture, light = read(tmp_path, stored(scene() / gain), {51022: lists})
    assert light == pytest.approx(scene(), abs=2 * TOLERANCE)
    assert any("FixVignetteRadial of OpcodeList3 applied" in note for note in capture.notes)


OTHERS = [
    (51008, 4, "FixBadPixelsConstant"), (51008, 5, "FixBadPixelsList"), (51008, 9, "GainMap"),
    (51009, 8, "MapPolynomial"), (51009, 10, "DeltaPerRow"), (51009, 13, "ScalePerColumn"),
    (51022, 1, "WarpRectilinear"), (51022, 2, "WarpFisheye"), (51022, 6, "TrimBounds"),
    (51022, 14, "WarpRectilinear2"), (51009, 77, "opcode 77"), (51009, 3, "FixVignetteRadial"),
]  # fmt: skip


@pytest.mark.parametrize(("tag", "number", "name"), OTHERS)
@pytest.mark.parametrize("flags", [0, 1, 3])
def test_an_opcode_that_is_not_applied_is_named(tmp_path, tag, number, name, flags):
    lists = opcode_list((number, bytes(16), flags))
    capture, light = read(tmp_path, stored(scene()), {tag: lists})
    assert any(f"not applied: {name}" in note for note in capture.notes)
    assert light == pytest.approx(scene(), abs=TOLERANCE)
    assert not damage(capture)


GOOD_MAP = gain_map(shading(), (0, 0, HEIGHT, WIDTH))


@pytest.mark.parametrize(
    "data",
    [b"\0\0", struct.pack(">I", 2**31), opcode_list((9, GOOD_MAP[:-4]))[1],
     opcode_list((9, GOOD_MAP))[1][:-9], opcode_list((9, b""))[1],
     opcode_list((9, gain_map(np.full((2, 2), np.nan), (0, 0, 9, 9))))[1],
     opcode_list((9, gain_map(np.full((2, 2), -1.0), (0, 0, 9, 9))))[1],
     opcode_list((9, gain_map(shading(), (0, 0, 9, 9), pitch=(0, 1))))[1]],
)  # fmt: skip
def test_a_list_that_is_damaged_is_named_and_left_out(tmp_path, data):
    capture, light = read(tmp_path, stored(scene()), {51009: ("opaque", data)})
    assert any("OpcodeList2 is not applied" in note for note in damage(capture))
    assert light == pytest.approx(scene(), abs=TOLERANCE)


@pytest.mark.parametrize(
    "blacks", [(100, 200, 300), (256, 300, 200), (300, 90, 0), (0, 64, 64), (256, 256, 256)]
)
@pytest.mark.parametrize("whites", [(4095, 4095, 4095), (4095, 4000, 3800)])
def test_planes_have_their_own_black_and_white(tmp_path, blacks, whites):
    light = np.stack([scene() * n for n in (1, 0.8, 0.6)], axis=-1)
    samples = np.rint(np.array(blacks) + light * (np.array(whites) - blacks)).astype(np.uint16)
    tags = {50714: ("long", blacks), 50717: ("long", whites)}
    capture, found = read(tmp_path, samples, tags)
    assert np.moveaxis(found, 0, -1) == pytest.approx(light, abs=1e-3)
    assert capture.white_balance == pytest.approx((2, 1, 1.6))


def test_a_pattern_of_black_holds_for_each_plane(tmp_path):
    blacks = np.arange(100, 220, 10).reshape(2, 2, 3)
    light = np.stack([scene()] * 3, axis=-1)
    black = np.tile(blacks, (HEIGHT // 2, WIDTH // 2, 1))
    samples = np.rint(black + 3000 * light).astype(np.uint16)
    tags = {50713: ("short", (2, 2)), 50714: ("long", tuple(blacks.ravel().tolist()))}
    capture, found = read(tmp_path, samples, tags)
    span = (capture.white_level - capture.black_level)[:, None, None] / capture.white_level * WHITE
    assert found * span / 3000 == pytest.approx(np.stack([scene()] * 3), abs=1e-3)


@pytest.mark.parametrize(
    ("tags", "message"),
    [
        ({259: ("short", (52546,))}, "JPEG XL"),
        ({259: ("short", (5,))}, "LZW"),
        ({259: ("short", (34925,))}, "LZMA"),
        ({50975: ("long", (2,))}, "RowInterleaveFactor 2"),
        ({52547: ("long", (2,))}, "ColumnInterleaveFactor 2"),
        ({259: ("short", (9,))}, "VC-5"),
        ({259: ("short", (34712,))}, "JPEG 2000"),
        ({259: ("short", (65000,))}, "method 65000"),
        ({50711: ("short", (2,))}, "staggered rows or columns .CFALayout 2"),
        ({258: ("short", (32,))}, "whole samples of 32 bits"),
        ({33421: ("short", (4, 4)), 33422: ("byte", QUAD)}, "CFA of 4x4 pixels .RRGGRRGG"),
        ({33421: ("short", (2, 4)), 33422: ("byte", QUAD[:8])}, "CFA of 2x4 pixels"),
        ({33422: ("byte", (3, 4, 5, 1)), 50710: ("byte", (3, 4, 5, 1))}, "other colours"),
        ({33422: ("byte", (0, 1, 1, 1))}, "CFA of 2x2 pixels .RGGG"),
    ],
)
def test_what_is_not_read_is_refused_by_its_name(tmp_path, tags, message):
    with pytest.raises(DecodeError, match=message) as error:
        read(tmp_path, stored(scene()), tags)
    assert "damage" not in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("planes", [2, 4, 5])
def test_other_numbers_of_planes_are_named(tmp_path, planes):
    with pytest.raises(DecodeError, match=f"holds {planes} planes, which is not read"):
        read(tmp_path, np.stack([stored(scene())] * planes, axis=-1))


@pytest.mark.parametrize("compression", [7, 34892])
def test_packed_planes_that_lie_apart_are_named(tmp_path, compression):
    samples = np.stack([stored(scene())] * 3, axis=-1)
    with pytest.raises(
        DecodeError, match=r"has planes that lie apart, compressed \(.*\), which is not read"
    ):
        read(tmp_path, samples, {284: ("short", (2,))}, compression=compression)


def test_a_third_light_is_noted(tmp_path):
    matrix = ("srational", (1.0, 0, 0, 0, 1, 0, 0, 0, 1))
    capture, _ = read(tmp_path, stored(scene()), {52531: matrix, 52529: ("short", (24,))})
    assert any("ColorMatrix3, of a third light, is not applied" in note for note in capture.notes)


def test_tags_behind_the_demosaic_of_x_trans_are_noted_and_small_ones_named(tmp_path):
    tags = {
        33421: ("short", (6, 6)), 33422: ("byte", X_TRANS),
        50716: ("srational", tuple(8 * np.sin(np.arange(520)))),
        51009: opcode_list((9, gain_map(np.ones((2, 2)), (0, 0, 520, 530)))),
    }  # fmt: skip
    capture, _ = read(tmp_path, stored(scene(520, 530)), tags)
    assert any(
        "demosaicked the file: BlackLevelDeltaV, OpcodeList2" in note for note in capture.notes
    )
    with pytest.raises(DecodeError, match="X-Trans from 512x512 px on; got 128x96"):
        read(tmp_path, stored(scene()), tags)


def test_a_linearization_table_stands_before_black(tmp_path):
    table = np.minimum(np.arange(4096) * 16, 65535)
    tags = {50712: ("short", tuple(int(n) for n in table)), 50714: ("long", (4096,)),
            50717: ("long", (65520,)), 50716: ("srational", tuple(16 * DOWN))}  # fmt: skip
    samples = stored(scene(), 256 + DOWN[:, None])
    for compression in (1, 8):
        _, light = read(tmp_path, samples, tags, compression=compression)
        assert light * (65520 - 4096) == pytest.approx(16 * (WHITE - 256) * scene(), abs=40)


def test_a_deep_baseline_exposure_is_noted(tmp_path):
    capture, _ = read(tmp_path, stored(scene()), {50730: ("srational", (2.5,))})
    assert any("BaselineExposure +2.50 EV is not applied" in note for note in capture.notes)
    capture, _ = read(tmp_path, stored(scene()), {50730: ("srational", (0.3,))})
    assert capture.notes == ()
