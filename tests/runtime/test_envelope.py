"""What can be seen of a capture, and what happens outside the measured ranges."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.manifest import Range
from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.batch import process
from camkit.runtime.capture import Capture
from camkit.runtime.envelope import QUANTITIES, findings, grey_noise, observe, verdict
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.bundle_factory import tiny_manifest, tiny_members, write_tiny_bundle
from tests.capture_factory import write_tiny_captures

NOISE = NoiseModel(shot=(1e-4,) * 3, read_variance=(1e-6,) * 3)


def _capture(samples: np.ndarray, *, planes: bool = False) -> Capture:
    black = np.zeros(3, np.float32) if planes else np.full((2, 2), 64, np.float32)
    return Capture(
        samples=samples,
        cfa=None if planes else "RGGB",
        black_level=black,
        white_level=1.0 if planes else 1087.0,
    )


def test_the_noise_at_grey_is_shot_and_read_noise_together() -> None:
    assert grey_noise(NOISE) == pytest.approx(np.sqrt(0.18e-4 + 1e-6), rel=1e-12)
    for channels, seen in ((1, 0), (2, 1), (3, 1), (5, 2)):
        noise = NoiseModel(
            shot=tuple(1e-4 * (c + 1) for c in range(channels)), read_variance=(0.0,) * channels
        )
        expected = np.sqrt(0.18e-4 * (seen + 1))
        assert grey_noise(noise) == pytest.approx(expected), "the middle one, green of three"


@pytest.mark.parametrize("channels", [1, 5])
def test_planes_of_any_number_of_channels_are_seen(channels: int) -> None:
    capture = Capture(
        samples=np.full((channels, 40, 50), 0.4, np.float32),
        cfa=None,
        black_level=np.zeros(channels, np.float32),
        white_level=1.0,
    )
    noise = NoiseModel(shot=(1e-4,) * channels, read_variance=(1e-6,) * channels)
    seen = observe(capture, noise)
    assert seen["signal_level"] == pytest.approx(0.4)
    assert seen["grey_noise"] == pytest.approx(grey_noise(noise))


@pytest.mark.parametrize("height", [1, 7, 40, 900])
def test_a_flat_capture_is_seen_as_it_is(height: int) -> None:
    capture = _capture(np.full((height, 50), 64 + 256, np.uint16))
    seen = observe(capture, NOISE)
    assert list(seen) == list(QUANTITIES)
    assert seen["signal_level"] == pytest.approx(256 / 1023, rel=1e-5)
    assert seen["clipped_fraction"] == seen["broken_fraction"] == 0
    assert seen["bit_depth"] == 10
    assert seen["side_px"] == min(height, 50)


def test_clipped_and_broken_samples_are_counted_as_shares() -> None:
    samples = np.full((384, 64), 300, np.uint16)
    samples[:, 32:] = 1087
    samples[2::12, 8] = 64 + 1000
    seen = observe(_capture(samples), NOISE)
    assert seen["clipped_fraction"] == pytest.approx(0.5)
    assert seen["broken_fraction"] == pytest.approx(1 / (12 * 64))


def test_planes_with_nan_are_seen_and_have_no_bit_depth() -> None:
    planes = np.full((3, 24, 24), 0.4, np.float32)
    planes[1, 3, 4] = np.nan
    seen = observe(_capture(planes, planes=True), NOISE)
    assert "bit_depth" not in seen
    assert seen["broken_fraction"] == pytest.approx(1 / (3 * 24 * 24))
    assert seen["signal_level"] == pytest.approx(0.4, rel=1e-6)


def test_looking_at_bands_agrees_with_looking_at_all_of_a_large_capture() -> None:
    rng = np.random.default_rng(1)
    samples = rng.integers(64, 1088, (2000, 40)).astype(np.uint16)
    seen = observe(_capture(samples), NOISE)
    exact = (samples.astype(float) - 64) / 1023
    assert seen["signal_level"] == pytest.approx(exact.mean(), rel=0.02)


def test_only_what_lies_outside_is_found_and_the_ends_belong_to_the_range() -> None:
    envelope = {
        "grey_noise": Range(low=0.001, high=0.004),
        "side_px": Range(low=16, high=1e6),
        "of_a_later_version": Range(low=0, high=1),
    }
    assert findings(envelope, {"grey_noise": 0.004, "side_px": 16}) == ()
    (found,) = findings(envelope, {"grey_noise": 0.04, "side_px": 16, "bit_depth": 3})
    assert "grey_noise" in found
    assert "0.04, outside 0.001 to 0.004" in found


def test_the_verdict_follows_the_choice() -> None:
    assert verdict((), "duet", "fail") is None
    for choice, words in (
        ("warn", 'on_unsafe="fallback"'),
        ("fallback", "the network is left out"),
    ):
        text = verdict(("it is dark",), "duet", choice)  # type: ignore[arg-type]
        assert text is not None
        assert "duet" in text
        assert words in text
    with pytest.raises(ContractError, match="it is dark"):
        verdict(("it is dark",), "duet", "fail")


@pytest.fixture
def narrow(tmp_path: Path) -> Path:
    """A bundle that was only shown to help at a noise that no capture here has."""
    path = tmp_path / "narrow.camkit"
    envelope = {"grey_noise": Range(low=1e-6, high=1e-5)}
    manifest = tiny_manifest().model_copy(update={"envelope": envelope})
    write_bundle(path, manifest, tiny_members())
    return path


def _mosaic() -> np.ndarray:
    return np.random.default_rng(3).integers(100, 800, (64, 96)).astype(np.uint16)


def test_outside_the_envelope_fallback_is_the_wiener_result_bit_for_bit(narrow: Path) -> None:
    bundle, mosaic = open_bundle(narrow), _mosaic()
    options = Options(threads=1)
    wiener = Pipeline(bundle, replace(options, method="wiener")).process_array(mosaic, iso=100)
    net = Pipeline(bundle, options).process_array(mosaic, iso=100)
    fallen = Pipeline(bundle, replace(options, on_unsafe="fallback")).process_array(mosaic, iso=100)
    np.testing.assert_array_equal(fallen, wiener)
    assert np.abs(net - wiener).max() > 1e-4


def test_outside_the_envelope_fail_is_an_error_before_work(narrow: Path) -> None:
    pipeline = Pipeline(open_bundle(narrow), Options(on_unsafe="fail", threads=1))
    capture = pipeline.capture_of(_mosaic(), iso=100, white_balance=None, origin_px=None)
    with pytest.raises(ContractError, match="grey_noise"):
        pipeline.start(capture)


def test_classical_methods_and_bundles_without_envelope_are_not_judged(
    narrow: Path, tmp_path: Path
) -> None:
    inside = write_tiny_bundle(tmp_path)
    for path, method in ((narrow, "wiener"), (inside, "net")):
        pipeline = Pipeline(open_bundle(path), Options(method=method, on_unsafe="fail", threads=1))
        assert np.isfinite(pipeline.process_array(_mosaic(), iso=100)).all()


@pytest.mark.parametrize("choice", ["warn", "fallback"])
def test_warning_and_reason_stand_in_the_sidecar(narrow: Path, tmp_path: Path, choice: str) -> None:
    write_tiny_captures(tmp_path, ["a"])
    (source,) = sorted(tmp_path.glob("*.dng"))[:1]
    out = tmp_path / "out"
    (result,) = process(source, bundle=narrow, out_dir=out, on_unsafe=choice)
    assert any("grey_noise" in warning for warning in result.warnings)
    record = json.loads((out / f"{source.stem}.camkit.json").read_text())
    plan = record["plan"]["envelope"]
    assert plan["fallback"] is (choice == "fallback")
    assert "grey_noise" in plan["outside"][0]
    assert plan["seen"]["grey_noise"] > 1e-5
    assert record["warnings"] == list(result.warnings)
