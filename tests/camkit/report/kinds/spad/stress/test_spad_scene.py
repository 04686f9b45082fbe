"""Scenes of single photons lie on the fine grid, drawn or of a folder."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.report.kinds.spad.stress.spad_scene import spad_scenes
from tests.spad_bundle import HEIGHT, SCALE, WIDTH


def test_drawn_scenes_are_as_fine_as_the_pictures_of_the_bundle(bundle: Bundle) -> None:
    first, second = spad_scenes(bundle, 2)
    assert first.light.shape == (SCALE * HEIGHT, SCALE * WIDTH)
    assert first.name != second.name
    assert 0 <= first.light.min() < first.light.max() <= 1


def test_pictures_of_a_folder_are_their_coded_luminance(bundle: Bundle, tmp_path: Path) -> None:
    grey = np.full((100, 150, 3), 128, np.uint8)
    assert cv2.imwrite(str(tmp_path / "grey.png"), grey)
    (scene,) = spad_scenes(bundle, 1, tmp_path)
    assert scene.name == "grey.png"
    np.testing.assert_allclose(scene.light, 128 / 255, atol=0.01)


def test_too_few_pictures_and_no_scene_are_refused(bundle: Bundle, tmp_path: Path) -> None:
    assert cv2.imwrite(str(tmp_path / "grey.png"), np.zeros((100, 150, 3), np.uint8))
    with pytest.raises(ContractError, match=r"holds 1 picture\(s\), 3 are needed"):
        spad_scenes(bundle, 3, tmp_path)
    with pytest.raises(ContractError, match="at least one scene"):
        spad_scenes(bundle, 0)
