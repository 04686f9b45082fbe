"""Scenes of the proof: finite, even-sided, the same for a seed, five and more of each kind."""

from collections import Counter
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.errors import ContractError
from tools.plan.scenes import GENERATORS, PER_SUBJECT, SEED, proof_scenes


@pytest.mark.parametrize("kind", list(GENERATORS))
def test_a_scene_is_light_that_its_seed_decides(kind: str) -> None:
    scene = GENERATORS[kind](SEED, 96, 128)
    assert scene.shape == (3, 96, 128)
    assert scene.dtype == np.float32
    assert np.isfinite(scene).all()
    assert scene.min() >= 0
    np.testing.assert_array_equal(scene, GENERATORS[kind](SEED, 96, 128))
    if kind != "text":
        assert (scene != GENERATORS[kind](SEED + 1, 96, 128)).any()


def test_night_is_mostly_dark_and_sky_mostly_smooth() -> None:
    night, sky = GENERATORS["night"](SEED, 128, 192), GENERATORS["sky"](SEED, 128, 192)
    assert np.median(night) < 0.01
    assert np.abs(np.diff(sky[:, :48], axis=2)).max() < 1e-6


def test_every_kind_has_its_scenes_and_pictures_are_cut_to_even_sides(tmp_path: Path) -> None:
    for name in ("coast_07_a", "city_09_b", "landscape_03_c"):
        (tmp_path / "valid_open").mkdir(exist_ok=True)
        path = tmp_path / "valid_open" / f"{name}.png"
        cv2.imwrite(str(path), np.full((41, 61, 3), 90, np.uint8))
    scenes = list(proof_scenes(64, 64, tmp_path, ("sky",)))
    assert len(scenes) == PER_SUBJECT + 3
    assert scenes[-1].make().shape == (3, 40, 60)
    assert Counter(s.subject for s in proof_scenes(64, 64)) == dict.fromkeys(
        GENERATORS, PER_SUBJECT
    )


def test_a_folder_without_the_pictures_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ContractError, match="night_02_"):
        list(proof_scenes(64, 64, tmp_path))
