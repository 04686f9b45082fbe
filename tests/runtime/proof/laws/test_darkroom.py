"""The darkroom: the bundle's own twin, its networks and its front end, on the same capture."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.runtime.proof.laws.darkroom import PLACES, Darkroom, reason_not_judged
from camkit.runtime.proof.laws.photographs import picture_laws
from camkit.runtime.twin.exposure import Setting
from camkit.scenes.procedural import procedural_scene
from tests.bundle_factory import tiny_manifest, tiny_members, write_tiny_bundle


@pytest.fixture(scope="module")
def room() -> Darkroom:
    return Darkroom(bundle=open_bundle(find_bundle(Path("duet"))), size="S", threads=1)


def test_places_go_from_the_middle_of_the_sensor_to_its_corner(room: Darkroom) -> None:
    places = [room.origin_px(place, (256, 320)) for place in PLACES]
    assert places[0] == (2840, 1872)
    assert places[-1] == (6000 - 320, 4000 - 256)
    assert all(x % 2 == 0 and y % 2 == 0 for x, y in places)
    assert room.isos == (100.0, 6400.0)


def test_both_pictures_are_of_one_capture_and_lie_where_the_scene_does(room: Darkroom) -> None:
    scene = procedural_scene(5_300_009, 256, 320)
    (seen,) = room.expose(scene, "corner", [Setting(seed=1)])

    def off(picture: np.ndarray) -> float:
        gap = np.clip(picture, 0, 1) - np.clip(seen.truth, 0, 1)
        return float(np.sqrt(np.mean(np.square(gap[:, 32:-32, 32:-32]))))

    assert seen.truth.shape == seen.network.shape == seen.front.shape == (3, 256, 320)
    np.testing.assert_allclose(seen.truth, scene, atol=1e-4)
    assert off(seen.network) < off(seen.front) < 0.2
    assert not np.array_equal(seen.light, seen.front_light)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("spad-sr", "it makes no photographs"),
        ("deglare", "no network"),
        ("duet", None),
        ("streak-hdr", None),
    ],
)
def test_what_cannot_be_judged_says_why(name: str, reason: str | None) -> None:
    assert reason_not_judged(open_bundle(find_bundle(Path(name)))) == reason


def test_random_weights_are_not_judged(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    write_bundle(path, tiny_manifest(training_data="not trained"), tiny_members())
    assert picture_laws(open_bundle(path), "M", 1) == "its weights are random"


@pytest.mark.slow
@pytest.mark.parametrize("size", ["S", "M"])
def test_duet_keeps_what_it_states(size: str) -> None:
    bundle = open_bundle(find_bundle(Path("duet")))
    laws = picture_laws(bundle, size, 1)
    assert not isinstance(laws, str)
    stated = (bundle.manifest.laws or {})[size]
    assert {law.name for law in laws} == set(stated)
    broken = {law.name for law in laws if not law.is_kept}
    assert broken <= {name for name, law in stated.items() if not law.kept}
    assert "flat" not in broken
