"""What other calibrations wrote is read back, undone exactly, or refused in words."""

import numpy as np
import pytest

from camkit.calibration.display.camera_file import Illumination, Lens, Tone
from camkit.calibration.display.targets import Targets
from camkit.calibration.geometry.camera_model import MODELS, Camera, project
from camkit.errors import DecodeError
from tests.camkit.calibration.display.screen_factory import DARK, Booth, luminance

UNDONE_PX = 1e-3
TONE = 2e-4
SIZE = (300, 200)
EVERY = {
    "pinhole": (),
    "radial_1": (-0.1,),
    "radial_2": (-0.2, 0.05),
    "radial_3": (0.1, -0.02, 0.003),
    "fisheye": (0.02, -0.01, 0.001, 0.0),
    "brown": (-0.1, 0.02, 1e-3, -2e-3, 0.0),
    "rational": (0.1, 0.01, 1e-3, 1e-3, 0.0, 0.2, 0.02, 0.0),
}


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_the_distortion_of_every_model_is_undone(model):
    camera = Camera(model=model, intrinsics=np.array([280.0, 153.0, 97.0, *EVERY[model.name]]))
    lens = Lens(camera=camera, size=SIZE, covered_px=200.0)
    x, y = np.arange(0.0, SIZE[0], 7), np.arange(0.0, SIZE[1], 7)
    ideal = lens.lattice(x, y).reshape(-1, 2)
    rays = np.column_stack([(ideal - camera.centre_px) / camera.focal_px, np.ones(len(ideal))])
    seen, _ = project(camera, np.zeros(6), rays)
    wanted = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    assert np.abs(seen - wanted).max() < UNDONE_PX


def test_a_distortion_that_folds_is_refused():
    model = next(m for m in MODELS if m.name == "radial_1")
    camera = Camera(model=model, intrinsics=np.array([150.0, 150.0, 100.0, -0.9]))
    with pytest.raises(DecodeError, match="cannot be undone"):
        Lens(camera=camera, size=SIZE, covered_px=50.0).without_distortion(np.array([[0.0, 0.0]]))


def test_a_tone_curve_gives_light_above_black(tmp_path):
    tone = Tone.read(Booth(screen=(640, 400)).write_tone(tmp_path / "tone.toml"))
    wanted = (luminance(np.arange(256)) - DARK) / (1 - DARK)
    assert tone.measured
    assert np.abs(tone.light - wanted).max() < TONE
    assert not Tone.read(None).measured


TONE_TEXT = "levels = [0, 128, 255]\nluminance = [0.0, 0.2, 1.0]\n"
FLAT_TEXT = (
    "heights_mm = [0.0, 1.0]\nrelative_illumination = [1.0, 0.5]\npixel_pitch_um = 10.0\n"
    "width_px = 300\nheight_px = 200\ncentre_px = [10.0, 20.0]\n"
    "centre_found = true\nseparated = true\n"
)


def _geometry(tmp_path):
    return Booth(screen=(640, 400), size=SIZE).write_geometry(tmp_path / "g.toml").read_text()


READERS = {
    "geometry": Lens.read,
    "tone": Tone.read,
    "flat": lambda path: Illumination.read(path, SIZE),
}


def test_what_is_sound_is_read(tmp_path):
    path = tmp_path / "x.toml"
    for name, text in (("geometry", _geometry(tmp_path)), ("tone", TONE_TEXT), ("flat", FLAT_TEXT)):
        path.write_text(text)
        READERS[name](path)


@pytest.mark.parametrize(
    "text",
    ["", "= 3", "x = " + "[" * 2000 + "]" * 2000, "x = " + "1" * 5000, 'levels = "a"'],
    ids=["empty", "no key", "deep", "long", "text"],
)
def test_broken_files_are_refused(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    for read in READERS.values():
        with pytest.raises(DecodeError, match=r"x\.toml"):
            read(path)
    path.rename(tmp_path / "targets.toml")
    with pytest.raises(DecodeError, match=r"targets\.toml"):
        Targets.read(tmp_path)


@pytest.mark.parametrize(
    ("name", "before", "now"),
    [
        ("geometry", "width_px = 300", "width_px = inf"),
        ("geometry", "radial_2", "radial_9"),
        ("geometry", "radial_2", "fisheye"),
        ("geometry", "focal_px = 330", "focal_px = 0.330"),
        ("tone", "1.0]", "inf]"),
        ("tone", "0.2, 1.0]", "0.2]"),
        ("tone", "0.2, 1.0]", "1.2, 1.0]"),
        ("tone", "255", "1023"),
        ("tone", "[0, ", "[1, "),
        ("flat", "um = 10.0", "um = 0"),
        ("flat", "[0.0, 1.0]", "[]"),
        ("flat", "[0.0, 1.0]", "[0.5, 1.0]"),
        ("flat", "width_px = 300", "width_px = 600"),
    ],
)
def test_numbers_that_cannot_be_are_refused(tmp_path, name, before, now):
    text = {"geometry": _geometry(tmp_path), "tone": TONE_TEXT, "flat": FLAT_TEXT}[name]
    assert before in text
    path = tmp_path / "x.toml"
    path.write_text(text.replace(before, now))
    with pytest.raises(DecodeError, match=r"x\.toml"):
        READERS[name](path)


def test_illumination_is_linear_in_the_square_of_the_height_as_in_bundles(tmp_path):
    path = tmp_path / "flat.toml"
    path.write_text(FLAT_TEXT)
    found = Illumination.read(path, SIZE)
    places = np.array([[10.0, 20.0], [60.0, 20.0], [110.0, 20.0], [10.0, 190.0]])
    assert found.at(places) == pytest.approx([1.0, 0.875, 0.5, 0.5])
    assert Illumination.read(None, SIZE).at(places).tolist() == [1, 1, 1, 1]
