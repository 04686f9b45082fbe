"""`camkit calibrate pairs` writes what `camkit train --pairs` reads, and both lay it alike."""

import cv2
import numpy as np
import pytest

from camkit.cli.app import run
from camkit.colorimetry import encode_srgb
from camkit.models_def.kinds.bayer.fine_tuning.homography import map_points
from camkit.models_def.kinds.bayer.fine_tuning.pairs import read_pairs
from camkit.scenes import procedural_scene
from tests.bayer_recipe import *  # noqa: F403
from tests.camkit.calibration.display.screen_factory import Booth

PLACED_PX = 0.1
"""Between the homography of training and the place that the reference was cut from."""


@pytest.fixture(name="folder")
def written_pairs(tmp_path):
    scene = np.clip(procedural_scene(5, 240, 360), 0, 1)
    codes = np.rint(255 * encode_srgb(scene)).astype(np.uint8).transpose(1, 2, 0)
    cv2.imwrite(str(tmp_path / "one.png"), codes[..., ::-1])
    ask = [
        "calibrate",
        "targets",
        tmp_path / "one.png",
        "-o",
        tmp_path / "t",
        "--screen",
        "960x600",
    ]
    assert run([str(part) for part in [*ask, "--levels", "0"]]) == 0
    booth = Booth(screen=(960, 600), size=(600, 400), lens=(0.0, 0.0), corner=1.0)
    shown = cv2.imread(str(tmp_path / "t" / "010-one.png"))[..., ::-1]
    capture = booth.write(tmp_path / "c.dng", shown)
    geometry, tone = (
        booth.write_geometry(tmp_path / "g.toml"),
        booth.write_tone(tmp_path / "tone.toml"),
    )
    ask = ["calibrate", "pairs", capture, "--targets", tmp_path / "t", "--geometry", geometry]
    assert run([str(part) for part in [*ask, "--tone", tone, "-o", tmp_path / "pairs"]]) == 0
    return tmp_path / "pairs"


def test_training_reads_the_pairs_and_finds_them_where_they_were_cut(folder, recipe, bank):
    import tomllib

    told = tomllib.loads((folder / "registration.toml").read_text())["pairs"][0]
    samples = read_pairs(folder, recipe, bank, None, seed=1)
    x, y, width, height = told["reference_px"]
    corners = np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1.0]])
    gap = map_points(samples.alignments["one"].matrix, corners) - (corners + [x, y])  # noqa: RUF005
    assert np.linalg.norm(gap, axis=1).max() < PLACED_PX
    assert (samples.targets >= 0).mean() > 0.5
