"""Laws of pictures of photons: an array without a floor paints black beside bright points."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, bundle_from_bytes, find_bundle, open_bundle
from camkit.bundle.stages import SuperResolve
from camkit.bundle.writer import bundle_to_bytes
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.pictures import least_light
from camkit.runtime.kinds.spad.twin.laws import LAWS
from camkit.runtime.proof.laws.law import Law


def _with_floor(floor: float) -> Bundle:
    bundle = open_bundle(find_bundle(Path("spad-sr")))
    stages = tuple(
        stage.model_copy(update={"floor": floor}) if isinstance(stage, SuperResolve) else stage
        for stage in bundle.manifest.stages
    )
    manifest = bundle.manifest.model_copy(update={"stages": stages})
    members = {name: bundle.member(name) for name in bundle.names}
    return bundle_from_bytes(bundle_to_bytes(manifest, members), path=bundle.path)


def _laws(bundle: Bundle, size: str | None = "S") -> dict[str, Law]:
    found = LAWS(bundle, size, 1)
    assert not isinstance(found, str), found
    return {law.name: law for law in found}


def test_the_built_in_array_keeps_every_law() -> None:
    laws = _laws(open_bundle(find_bundle(Path("spad-sr"))))
    assert all(law.is_kept for law in laws.values()), laws
    assert set(laws) == {"even_mean", "even_spread", "black", "double"}


def test_without_a_floor_there_is_black_where_light_was_counted() -> None:
    black = _laws(_with_floor(0.0))["black"]
    assert not black.is_kept
    assert black.worst > 0.05


def test_a_network_that_is_not_held_is_named() -> None:
    assert LAWS(_with_floor(0.5), "XL", 1) == "it holds no network of size XL"


@pytest.mark.parametrize("dark", [0.0, 5.0])
def test_the_least_light_is_a_share_of_what_all_around_counted_for_sure(dark: float) -> None:
    camera = FineCamera.of(_with_floor(0.5))
    frame = np.full((8, 8), 100.0, np.float32)
    frame[4, 4] = 20.0
    least = least_light(camera, frame, dark)
    scale = camera.scale
    assert least.shape == (8 * scale, 8 * scale)
    for y, x, darkest in ((0, 0, 100.0), (3, 3, 20.0), (4, 4, 20.0), (6, 6, 100.0)):
        wanted = 0.5 * max(darkest - 2 * np.sqrt(darkest + dark + 1), 0)
        np.testing.assert_allclose(least[scale * y, scale * x], wanted, rtol=1e-5)
    assert least_light(camera, np.zeros((8, 8), np.float32), dark).max() == 0
