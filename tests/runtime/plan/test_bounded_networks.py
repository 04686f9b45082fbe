"""Which networks are bounded, by format and by what the caller chose."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.light_bound import BOUND_REACH_PX, USUAL_BOUND, LightBound
from camkit.bundle.manifest import LIGHT_VERSION, Manifest, planes_of
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.stages import Network, Undistort
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.plan.bounded_networks import bounded_stages
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_network, tiny_stages
from tests.job_factory import made_mosaic

NEW = ".".join(map(str, LIGHT_VERSION))
BOUND = LightBound(spread=0.2)


def _manifest(light: LightBound | None, version: str) -> Manifest:
    stages = tuple(
        stage.model_copy(update={"light": light, "takes": (*stage.takes, "unknown")})
        if isinstance(stage, Network) and light is not None
        else stage
        for stage in tiny_stages()
    )
    plain = tiny_manifest()
    planes = planes_of(stages, plain.parts)
    return tiny_manifest(stages=stages, planes=planes, format_version=version)


def _bundle(folder: Path, light: LightBound | None, version: str, *, scale: float = 1.0) -> Bundle:
    path = folder / "tiny.camkit"
    members = tiny_members() | {"network_m.onnx": tiny_network(scale=scale)}
    write_bundle(path, _manifest(light, version), members)
    return open_bundle(path)


def _bounds(manifest: Manifest, laws: str) -> list[LightBound | None]:
    stages = bounded_stages(manifest, laws)  # type: ignore[arg-type]
    return [stage.light for stage in stages if isinstance(stage, Network)]


def test_older_bundles_are_bounded_only_where_the_caller_says_so() -> None:
    older = _manifest(None, "2.4")
    assert _bounds(older, "stated") == [None]
    assert _bounds(older, "enforce") == [USUAL_BOUND]
    (network,) = [s for s in bounded_stages(older, "enforce") if isinstance(s, Network)]
    assert network.takes[-1] == "unknown", "the mask of the bank"
    assert network.extra_reach_px == BOUND_REACH_PX


def test_from_the_new_format_on_every_network_behind_a_bank_is_bounded() -> None:
    assert _bounds(_manifest(None, NEW), "stated") == [USUAL_BOUND]
    assert _bounds(_manifest(BOUND, NEW), "stated") == [BOUND]
    assert _bounds(_manifest(BOUND, NEW), "enforce") == [BOUND]


def test_a_bound_in_an_older_format_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"light that a stage makes is bounded, which format 2.8"):
        _bundle(tmp_path, BOUND, "2.7")
    stages = tuple(
        stage.model_copy(update={"overshoot": "limited"}) if isinstance(stage, Undistort) else stage
        for stage in tiny_stages()
    )
    with pytest.raises(BundleError, match=r"light that a stage makes is bounded, which format 2.8"):
        write_bundle(
            tmp_path / "limited.camkit",
            tiny_manifest(stages=stages, format_version="2.7"),
            tiny_members(),
        )


@pytest.mark.parametrize(("light", "version"), [(None, "2.4"), (None, NEW), (BOUND, NEW)])
@pytest.mark.parametrize("size", [(64, 96), (61, 83)])
def test_tiles_equal_the_whole_behind_any_bound(
    tmp_path: Path, light: LightBound | None, version: str, size: tuple[int, int]
) -> None:
    bundle = _bundle(tmp_path, light, version)
    rng = np.random.default_rng(2)
    samples = rng.integers(64, 900, size).astype("u2")
    samples[20:23, 30:34] = 1023  # a clipped lamp
    pictures, fractions = [], []
    for tile in (None, 8, 20):
        pipeline = Pipeline(
            bundle, Options(tile_px=tile, laws="enforce", threads=1, assume="centre")
        )
        work = pipeline.start(made_mosaic(samples=samples))
        pictures.append(work.fill())
        fractions.append(work.sections["laws"]["fallback_fraction"])
    np.testing.assert_array_equal(pictures[1], pictures[0])
    np.testing.assert_array_equal(pictures[2], pictures[0])
    assert len(set(fractions)) == 1


def test_no_lamp_becomes_dark_where_the_front_end_has_it_bright(tmp_path: Path) -> None:
    """Behind a network that changes any pixel, and a bound that admits that."""
    samples = np.full((64, 96), 980, "u2")  # nearly white, not clipped
    samples[:, ::7] = 600
    wide = LightBound(noise=1000, light=1000)
    bank, *made = (
        Pipeline(_bundle(tmp_path, bound, NEW, scale=-8), Options(threads=1, method=method))
        .start(made_mosaic(samples=samples))
        .fill()
        for method, bound in (
            ("wiener", wide),
            ("net", wide),
            ("net", wide.model_copy(update={"keeps_bright": True})),
        )
    )
    bright = bank.min(axis=0) > 1
    darker = [(picture.sum(0) < 0.8 * bank.sum(0))[bright].mean() for picture in made]
    assert bright.mean() > 0.1
    assert darker[0] > 0.2
    assert darker[1] < 1e-3


def test_older_bundles_keep_their_bits_and_are_measured(tmp_path: Path) -> None:
    older = _bundle(tmp_path, None, "2.4")
    capture = made_mosaic(samples=np.random.default_rng(2).integers(64, 900, (64, 96)).astype("u2"))
    plain = Pipeline(older, Options(threads=1)).start(capture)
    enforced = Pipeline(older, Options(threads=1, laws="enforce")).start(capture)
    assert not np.array_equal(plain.fill(), enforced.fill())
    assert plain.sections["laws"]["enforced"] is False
    assert enforced.sections["laws"]["enforced"] is True
    assert plain.sections["laws"]["fallback_fraction"] > 0.5


def test_strength_goes_from_the_front_end_to_the_network(tmp_path: Path) -> None:
    bundle = _bundle(tmp_path, None, "2.4")
    capture = made_mosaic(
        samples=np.random.default_rng(2).integers(490, 510, (64, 96)).astype("u2")
    )
    made = {
        strength: Pipeline(bundle, Options(threads=1, strength=strength)).start(capture).fill()
        for strength in (0.0, 0.5, 1.0)
    }
    bank = Pipeline(bundle, Options(threads=1, method="wiener")).start(capture).fill()
    np.testing.assert_allclose(made[0.0], bank, atol=1e-4)
    assert np.abs(made[0.5] - made[0.0]).max() < np.abs(made[1.0] - made[0.0]).max()
    np.testing.assert_array_equal(
        Pipeline(bundle, Options(threads=1)).start(capture).fill(), made[1.0]
    )


@pytest.mark.parametrize("value", [-0.1, 1.1, float("nan")])
def test_a_strength_beyond_all_and_nothing_is_refused(value: float) -> None:
    with pytest.raises(ContractError, match=r"strength must lie in 0..1"):
        Options(strength=value)
