"""Golden cases are photographed at the depth that the camera is focused on."""

from pathlib import Path

import numpy as np

from camkit.export.card import card_text
from camkit.export.golden_cases import CaseRecipe, photograph
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.scenes import procedural_scene
from tests.deep_bundle import FOCUS_MM, write_deep_bundle

RECIPE = CaseRecipe(scene_seed=4, exposure=0.7, iso=100.0, field=0.5, size_px=48)


def test_a_case_of_several_depths_lies_at_the_focus(tmp_path: Path) -> None:
    deep = write_deep_bundle(tmp_path)
    case, capture, reference = photograph("case", RECIPE, deep)
    options = SimulationOptions(
        iso=100.0, seed=4, origin_px=case.origin_px, exposure=0.7, depth_mm=FOCUS_MM
    )
    scene = procedural_scene(4, 48, 48)
    sensor = deep.manifest.sensor
    expected = simulate(scene, sensor, deep.psf, options)
    np.testing.assert_array_equal(capture, expected.samples)
    assert reference.shape == (3, 48, 48)


def test_the_card_names_the_depths(tmp_path: Path) -> None:
    text = card_text(write_deep_bundle(tmp_path), {})
    assert "for objects at 0.5 m, 1 m, 2 m." in text
    assert "Depths other than 0.5 m, 1 m, 2 m" in text
    assert "mean of the depths" in text
