"""What the built-in thin plate brings, and what it was trained for."""

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, find_bundle, open_bundle
from camkit.report.analysis.recovery import restored
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions, photograph
from camkit.scenes import named_scene

LAMP = 6.0
"""Of the scene, in units of white."""


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    return open_bundle(find_bundle("thin-plate"))


def test_it_knows_its_haze_at_other_distances_its_plan_and_its_envelope(bundle: Bundle) -> None:
    manifest = bundle.manifest
    assert manifest.has_haze
    assert {"stress_psf.safetensors", "stress_haze.safetensors"} <= set(bundle.names)
    assert manifest.sizes == ("S", "M")
    assert manifest.plan
    assert manifest.envelope


@pytest.mark.parametrize("size", ["S", "M"])
def test_lamps_that_clip_stay_bright(bundle: Bundle, size: str) -> None:
    scene = named_scene("procedural:7", 640, 960)
    made = photograph(scene, bundle, SimulationOptions(iso=100, distort=False, vignette=False))
    options = Options(size=size, undistort=False, vignetting=False)
    picture = restored(Pipeline(bundle, options), made)
    lamps = scene.max(axis=0) > LAMP
    assert lamps.sum() > 100
    bright = picture.min(axis=0)[lamps] > 1  # in every colour: nobody knows which they had
    assert np.mean(bright) > 0.8  # 0.04 where samples leave such places out
