"""Accuracy: captures of both sorts, scores by the protocol, the input by the same pipeline."""

import math
from dataclasses import replace
from itertools import islice
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE, GoldenArrays, golden_to_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError
from camkit.report.bench.accuracy import (
    INPUT,
    SUPPLIED,
    Restorers,
    Scores,
    mean_and_spread,
    measure_accuracy,
    standard_error_of_gain,
)
from camkit.report.bench.known_captures import golden_captures, picture_captures, psf_source
from camkit.report.bench.metric import Column, Metric
from camkit.report.bench.metrics.picture import METRIC
from camkit.report.bench.trial import Trial
from camkit.report.quality import Shot, judge
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle
from tools.comparison.photograph import bundle_restorer, finish_planes, photograph


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_wide_bundle(tmp_path_factory.mktemp("wide"))


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sharp")
    for number, name in enumerate(("a", "b")):
        values = np.rint(texture(112, 128, seed=number) * 255).astype(np.uint8)
        cv2.imwrite(str(folder / f"{name}.png"), values[::-1].transpose(1, 2, 0))
    return folder


def make_trial(bundle: Bundle, method: str, size: str | None = None) -> Trial:
    return Trial(
        camera="wide",
        bundle="wide",
        path=bundle.path,
        maker="k",
        method=method,
        size=size,
        threads=1,
        base_threads=1,
    )


def test_scores_are_those_of_the_protocol(bundle: Bundle, pictures: Path, tmp_path: Path) -> None:
    trials = [make_trial(bundle, "wiener"), make_trial(bundle, "net", "M")]
    scores = measure_accuracy(
        trials,
        picture_captures(bundle, pictures, 1, tmp_path),
        Restorers(bundle, threads=1),
        (METRIC,),
    )
    shot = Shot(
        set_name=pictures.name,
        picture=pictures / "a.png",
        number=0,
        position=1,
        iso=1600.0,
        psf="bundle",
    )
    scene = cv2.imread(str(shot.picture))[..., ::-1].transpose(2, 0, 1) / np.float32(255)
    taken = photograph(shot, decode_srgb(np.ascontiguousarray(scene)), bundle, bundle.frozen_optics)
    wanted = {
        INPUT: finish_planes(taken.local.planes, taken, bundle),
        trials[0].accuracy_key: bundle_restorer(bundle, method="wiener")(taken),
        trials[1].accuracy_key: bundle_restorer(bundle, size="M")(taken),
    }
    for key, restored in wanted.items():
        found = scores[key].by_picture["a.png"]
        assert len(found["psnr_db"]) == 10  # five places, two sensitivities
        score = judge(restored, taken.sharp)
        assert found["psnr_db"][3] == pytest.approx(score.psnr_db, abs=1e-3)
        assert found["ssim"][3] == pytest.approx(score.ssim, abs=1e-4)
        fourth = scores[key].captures[3]
        assert (fourth.iso, fourth.field_share) == (1600.0, 0.25)
        assert fourth.values["psnr_db"] == found["psnr_db"][3]
        away_mm = [t.field_mm for t in scores[key].captures]
        assert away_mm == sorted(away_mm)
        assert away_mm[0] < 0.01 < away_mm[-1]
    assert scores[INPUT].psf == {"bundle"}


def test_without_a_prescription_the_lens_is_the_bundle_s_own(bundle: Bundle) -> None:
    assert psf_source(bundle) == "bundle"


def test_a_method_that_fails_says_why_and_the_others_go_on(
    bundle: Bundle, pictures: Path, tmp_path: Path
) -> None:
    trials = [make_trial(bundle, "net", "L"), make_trial(bundle, "wiener")]
    scores = measure_accuracy(
        trials,
        islice(picture_captures(bundle, pictures, 1, tmp_path), 2),
        Restorers(bundle, threads=1),
        (METRIC,),
    )
    assert "holds size" in str(scores[trials[0].accuracy_key].error)
    assert scores[trials[1].accuracy_key].error is None


def test_a_metric_gets_what_the_capture_brings_and_the_settings_say(
    bundle: Bundle, pictures: Path, tmp_path: Path
) -> None:
    def measure(result: FloatArray, _truth: FloatArray, **beside: FloatArray) -> dict[str, float]:
        assert set(beside) == {"linear", "nits"}
        return {"level": float(result.mean()), "nits": float(beside["nits"])}

    wanting = Metric(
        name="m",
        columns=(Column(name="level"), Column(name="nits")),
        measure=measure,
        needs=("linear",),
        takes=("nits", "absent"),
    )
    plain, *_ = picture_captures(bundle, pictures, 1, tmp_path)
    grey = np.full_like(plain.truths[IMAGE], 0.25)
    known = replace(plain, extras={"linear": grey, "input": grey})
    scores = measure_accuracy(
        [], [plain, known], Restorers(bundle, threads=1), (wanting,), constants={"nits": 3.0}
    )
    assert scores[SUPPLIED].by_picture == {"a.png": {"level": [0.25], "nits": [3.0]}}
    (level,) = scores[INPUT].by_picture["a.png"]["level"]  # of one capture: the other lacks a need
    assert level != 0.25


def test_a_result_that_a_metric_refuses_fails_its_method_alone(
    bundle: Bundle, pictures: Path, tmp_path: Path
) -> None:
    def measure(_result: FloatArray, _truth: FloatArray) -> dict[str, float]:
        raise ContractError("a result must be finite")

    metric = Metric(name="m", columns=(Column(name="m"),), measure=measure)
    captures = islice(picture_captures(bundle, pictures, 1, tmp_path), 2)
    scores = measure_accuracy([], captures, Restorers(bundle, threads=1), (metric,))
    assert scores == {INPUT: Scores(error="a result must be finite")}


def test_golden_cases_are_judged_against_their_stored_truth(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    arrays = GoldenArrays(
        capture=rng.integers(64, 1024, (96, 128), dtype=np.uint16),
        reference=rng.random((3, 96, 128), dtype=np.float32),
    )
    small = GoldenArrays(
        capture=rng.integers(64, 1024, (32, 32), dtype=np.uint16),
        reference=rng.random((3, 32, 32), dtype=np.float32),
    )
    cases = (
        GoldenCase(name="large", iso=100, origin_px=(8, 6)),
        GoldenCase(name="small", iso=100),
    )
    members = tiny_members() | {
        "golden.safetensors": golden_to_bytes({"large": arrays, "small": small})
    }
    path = tmp_path / "g.camkit"
    manifest = tiny_manifest(sensor=tiny_sensor(320, 240), golden=cases)
    write_bundle(path, manifest, members)
    bundle = open_bundle(path)
    (known,) = golden_captures(bundle)
    assert (known.picture, known.origin_px, known.undistort) == ("large", (8, 6), True)
    assert known.field_share is not None
    assert known.field_mm is not None
    assert 0 < known.field_share < 1
    assert known.field_mm > 0
    stored = arrays.reference.astype(np.float16).astype(np.float32)  # as bundles store it
    np.testing.assert_allclose(decode_srgb(known.truths[IMAGE]), stored, atol=1e-5)
    np.testing.assert_array_equal(known.extras["linear"], stored)
    restored = Restorers(bundle, threads=1).restore(None, known)
    assert restored[IMAGE].shape == (3, 96, 128)


def test_a_picture_too_small_to_be_judged_is_refused(bundle: Bundle, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "small.png"), np.zeros((64, 200, 3), np.uint8))
    with pytest.raises(ContractError, match="200x64 pixels"):
        list(picture_captures(bundle, tmp_path, None, tmp_path))


def make_scores(means: dict[str, list[float]]) -> Scores:
    return Scores(by_picture={name: {"psnr_db": values} for name, values in means.items()})


def test_the_error_of_the_gain_is_that_of_paired_differences() -> None:
    base = make_scores({"a": [10.0], "b": [20.0], "c": [30.0, 32.0]})
    better = make_scores({"a": [12.0], "b": [21.0], "c": [34.0]})  # gains 2, 1, 3
    assert standard_error_of_gain(better, base, "psnr_db") == pytest.approx(1 / math.sqrt(3))
    assert standard_error_of_gain(make_scores({"a": [12.0]}), base, "psnr_db") is None


def test_spread_is_that_of_the_pictures_and_unknown_for_one() -> None:
    assert mean_and_spread([1.0, 3.0]) == (2.0, pytest.approx(math.sqrt(2)))
    assert mean_and_spread([1.0]) == (1.0, None)
    assert mean_and_spread([]) == (None, None)
