"""What other calibrations wrote is read back, undone exactly, or refused in words."""

import numpy as np
import pytest

from camkit.errors import DecodeError
from camkit.runtime.calibration.display.camera_file import Illumination, Lens, Tone
from camkit.runtime.calibration.display.targets import Targets
from camkit.runtime.calibration.geometry.camera import MODELS, Camera, project
from tests.runtime.calibration.display.screen_factory import DARK, Booth, luminance

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


@pytest.mark.parametrize(
    "text",
    [
        "",
        "= 3",
        'levels = "a"',
        "levels = [0, 255]\nluminance = [1, 0]",
        "levels=[9]\nluminance=[1]",
    ],
)
def test_broken_files_are_refused(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    for read in (lambda: Tone.read(path), lambda: Lens.read(path)):
        with pytest.raises(DecodeError, match=r"x\.toml"):
            read()
    with pytest.raises(DecodeError, match=r"x\.toml"):
        Illumination.read(path, 5.0)
    path.rename(tmp_path / "targets.toml")
    with pytest.raises(DecodeError, match=r"targets\.toml"):
        Targets.read(tmp_path)


def test_illumination_is_read_over_the_height(tmp_path):
    path = tmp_path / "flat.toml"
    path.write_text(
        "heights_mm = [0, 1]\nrelative_illumination = [1, 0.5]\ncentre_px = [10.0, 20.0]\n"
    )
    found = Illumination.read(path, 10.0)
    assert found.at(np.array([[10.0, 20.0], [60.0, 20.0]])) == pytest.approx([1.0, 0.75])
    with pytest.raises(DecodeError, match="no pixel pitch"):
        Illumination.read(path, None)
    path.write_text(path.read_text() + "pixel_pitch_um = 10.0\n")
    stated = Illumination.read(path, None)  # as `calibrate flat` writes it
    assert stated.at(np.array([60.0, 20.0])) == pytest.approx(0.75)
