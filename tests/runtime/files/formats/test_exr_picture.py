"""EXR files of unusual kinds are read rightly, or refused by the name of their kind."""

import Imath
import numpy as np
import OpenEXR
import pytest

from camkit.colorimetry import D65, REC709_PRIMARIES, rgb_to_xyz
from camkit.errors import DecodeError
from camkit.runtime.files.picture import read_picture, read_scene
from camkit.runtime.raw import read_capture
from tests.data_folder import data_path

HIGH, WIDE = 12, 16
RNG = np.random.default_rng(6)
PLANES = RNG.uniform(0.1, 2, (3, HIGH, WIDE)).astype(np.float32)
XYZ_POINTS = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1 / 3, 1 / 3)


def header(**more):
    return {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage} | more


def window(x0, y0, x1, y1):
    return np.array([x0, y0], np.int32), np.array([x1, y1], np.int32)


def write(path, channels, **more):
    OpenEXR.File(header(**more), channels).write(str(path))
    return path


def rgb(planes=PLANES, names="RGB"):
    return dict(zip(names, planes, strict=True))


@pytest.mark.parametrize("x0", [-7, 0, 5])
@pytest.mark.parametrize("y0", [-3, 0, 9])
def test_windows_are_kept_and_told(tmp_path, x0, y0):
    data = window(x0, y0, x0 + WIDE - 1, y0 + HIGH - 1)
    path = write(tmp_path / "a.exr", rgb(), dataWindow=data, displayWindow=window(0, 0, 39, 29))
    found = read_capture(path)
    assert np.array_equal(found.samples, PLANES)
    assert found.window.data == (x0, y0, x0 + WIDE - 1, y0 + HIGH - 1)
    assert f"from ({x0}, {y0}) of a display window of 40x30 px" in found.notes[0]


def test_wide_pixels_are_told(tmp_path):
    found = read_picture(write(tmp_path / "a.exr", rgb(), pixelAspectRatio=2.0))
    assert found.window.pixel_aspect == 2
    assert found.notes == ("its pixels are 2 times as wide as high: kept in EXR alone",)


def deep(path, kind=OpenEXR.deepscanline):
    cells = np.empty((HIGH, WIDE), dtype=object)
    for at in np.ndindex(cells.shape):
        cells[at] = np.array([0.5, 0.25], np.float32)
    more = {"tiles": OpenEXR.TileDescription()} if kind == OpenEXR.deeptile else {}
    whole = {"compression": OpenEXR.ZIPS_COMPRESSION, "type": kind} | more
    return OpenEXR.Part(whole, dict.fromkeys("RGBZ", cells), name="deep"), path


@pytest.mark.parametrize("kind", [OpenEXR.deepscanline])
def test_deep_files_are_refused_by_name_and_flat_parts_of_them_read(tmp_path, kind):
    part, path = deep(tmp_path / "a.exr", kind)
    OpenEXR.File([part]).write(str(path))
    for read in (read_picture, read_scene):
        with pytest.raises(DecodeError, match="a deep EXR has many samples per pixel"):
            read(path)
    flat = OpenEXR.Part(header(), rgb(), name="flat")
    OpenEXR.File([part, flat]).write(str(path))
    found = read_picture(path)
    assert np.array_equal(found.samples, PLANES)
    assert found.notes == ("parts not read: deep",)


def test_the_deep_file_of_reports_is_refused_in_one_line():
    with pytest.raises(DecodeError, match="a deep EXR") as raised:
        read_capture(data_path("reports/exr_deep.exr"))
    assert "\n" not in str(raised.value)
    assert read_capture(data_path("reports/exr_good.exr")).notes == ()


@pytest.mark.parametrize("first", ["colour", "depth"])
def test_parts_that_are_not_read_are_named(tmp_path, first):
    colour = OpenEXR.Part(header(), rgb(), name="colour")
    depth = OpenEXR.Part(header(), {"Z": PLANES[0]}, name="depth")
    parts = [colour, depth] if first == "colour" else [depth, colour]
    OpenEXR.File(parts).write(str(tmp_path / "a.exr"))
    found = read_picture(tmp_path / "a.exr")
    assert np.array_equal(found.samples, PLANES)
    assert found.notes == ("parts not read: depth",)


@pytest.mark.parametrize(
    "more",
    [
        {"type": OpenEXR.tiledimage, "tiles": OpenEXR.TileDescription()},
        {"lineOrder": OpenEXR.DECREASING_Y},
        {"compression": OpenEXR.NO_COMPRESSION},
        {"compression": OpenEXR.PIZ_COMPRESSION},
        {"compression": OpenEXR.RLE_COMPRESSION},
    ],
    ids=["tiled", "decreasing", "none", "piz", "rle"],
)
@pytest.mark.parametrize("dtype", [np.float16, np.float32])
def test_layouts_and_types_are_read(tmp_path, more, dtype):
    planes = PLANES.astype(dtype)
    found = read_picture(write(tmp_path / "a.exr", rgb(planes), **more))
    assert np.array_equal(found.samples, planes.astype(np.float32))


def test_whole_numbers_are_told(tmp_path):
    planes = np.rint(PLANES * 10).astype(np.uint32)
    found = read_picture(write(tmp_path / "a.exr", rgb(planes)))
    assert np.array_equal(found.samples, planes.astype(np.float32))
    assert "UINT" in found.notes[0]


@pytest.mark.parametrize(
    "names", [("r", "g", "b"), ("beauty.R", "beauty.G", "beauty.B"), ("a.b.r", "a.b.g", "a.b.b")]
)
def test_lower_case_and_layers_are_read(tmp_path, names):
    path = write(tmp_path / "a.exr", rgb(names=names) | {"depth.Z": PLANES[0]})
    assert np.array_equal(read_picture(path).samples, PLANES)
    assert "depth.Z" in read_picture(path).notes[0]


def test_of_several_layers_the_plain_or_the_beauty_is_read_and_others_are_asked_about(tmp_path):
    glow = {f"glow.{name}": PLANES[0] for name in "RGB"}
    haze = {f"haze.{name}": PLANES[1] for name in "RGB"}
    beauty = {f"view.Combined.{name}": plane for name, plane in rgb().items()}
    for more in (rgb(), beauty):
        found = read_picture(write(tmp_path / "a.exr", glow | haze | more))
        assert np.array_equal(found.samples, PLANES)
    with pytest.raises(DecodeError, match=r"2 layers \(glow, haze\)"):
        read_picture(write(tmp_path / "a.exr", glow | haze))


def test_primaries_of_xyz_itself_are_believed(tmp_path):
    to_xyz = rgb_to_xyz(REC709_PRIMARIES, D65)
    grey = np.full((3, 4, 4), 0.5, np.float32)
    path = write(tmp_path / "a.exr", rgb(grey), chromaticities=XYZ_POINTS)
    assert np.allclose(read_scene(path), 0.5, atol=1e-4)
    assert "not Rec.709" in read_picture(path).notes[0]
    points = (*XYZ_POINTS[:6], *D65)
    xyz = np.tensordot(to_xyz / to_xyz.sum(axis=1, keepdims=True), PLANES, 1).astype(np.float32)
    path = write(tmp_path / "b.exr", rgb(xyz), chromaticities=points)
    assert np.abs(read_scene(path) - PLANES).max() < 1e-4


@pytest.mark.parametrize("green_y", [0.0, 1.0], ids=["acescg", "aces-2065-1"])
def test_chromaticities_that_were_cut_to_whole_numbers_are_told(tmp_path, green_y):
    """OpenEXR.OutputFile 3.5.3 cuts them (findings/openexr_written_numbers.sh)."""
    points = (0.0, 0.0, 0.0, green_y, 0.0, 0.0, 0.0, 0.0)
    path = write(tmp_path / "a.exr", rgb(), chromaticities=points)
    assert "cut to whole numbers" in read_picture(path).notes[0]
    assert np.array_equal(read_scene(path), PLANES)


@pytest.mark.parametrize(
    "points", [(0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.0), (0.3, 0.3) * 4]
)
def test_chromaticities_that_cannot_be_are_refused(tmp_path, points):
    path = write(tmp_path / "a.exr", rgb(), chromaticities=points)
    with pytest.raises(DecodeError, match="not believable"):
        read_scene(path)


@pytest.mark.parametrize("origin", [(0, 0), (-4, 6)])
@pytest.mark.parametrize("step", [1, 2])
def test_luminance_and_chroma_become_colour(tmp_path, origin, step):
    """Light that varies slowly comes back whole, since chroma is filled in linearly."""
    ramp = np.linspace(0.4, 1.2, WIDE)[None, :] * np.linspace(0.7, 1, HIGH)[:, None]
    colour = np.array([0.9, 1.0, 0.7])[:, None, None] * np.ones((3, HIGH, WIDE))
    planes = (ramp * colour).astype(np.float32)
    y = np.tensordot(rgb_to_xyz(REC709_PRIMARIES, D65)[1], planes, 1).astype(np.float32)
    chroma = {"RY": (planes[0] - y) / y, "BY": (planes[2] - y) / y}
    (x0, y0), float_ = origin, Imath.PixelType(Imath.PixelType.FLOAT)
    head = OpenEXR.Header(WIDE, HIGH)
    head["dataWindow"] = Imath.Box2i(Imath.V2i(x0, y0), Imath.V2i(x0 + WIDE - 1, y0 + HIGH - 1))
    head["channels"] = {"Y": Imath.Channel(float_)} | {
        name: Imath.Channel(float_, step, step) for name in chroma
    }
    file = OpenEXR.OutputFile(str(tmp_path / "a.exr"), head)
    # of more rows at once OutputFile takes every second one of such channels
    for top in range(0, HIGH, step):
        rows = {n: np.ascontiguousarray(c[top : top + 1, ::step]) for n, c in chroma.items()}
        rows["Y"] = y[top : top + step]
        file.writePixels({n: part.tobytes() for n, part in rows.items()}, step)
    file.close()
    found = read_picture(tmp_path / "a.exr")
    assert np.abs(found.samples - planes).max() < 1e-5
    assert "luminance and subsampled chroma" in found.notes[0]
    assert np.array_equal(read_scene(tmp_path / "a.exr"), found.samples)
