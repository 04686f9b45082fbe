"""What is decided before the first row: whose white balance, matrix, place and noise, and why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import open_bundle
from camkit.colorimetry import camera_from_rec709
from camkit.contracts import NoiseModel
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.job.preparation import Preparation
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tests.bundle_factory import tiny_camera, write_tiny_bundle
from tests.deep_bundle import write_deep_bundle

OWN_BALANCE = (2.0, 1.0, 1.5)
OWN_MATRIX = np.diag([0.8, 1.0, 0.6])
SHAPE = (64, 96)


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_bundle(tmp_path_factory.mktemp("bundle"))


def _mosaic(**facts: object) -> Capture:
    rng = np.random.default_rng(3)
    sound = {
        "samples": rng.integers(100, 900, SHAPE, dtype=np.uint16),
        "cfa": "RGGB",
        "black_level": np.full((2, 2), 64, np.float32),
        "white_level": 1023.0,
        "white_balance": OWN_BALANCE,
        "color_matrix": OWN_MATRIX,
        "iso": 100.0,
    }
    return Capture(**(sound | facts))  # type: ignore[arg-type]


def _planes(**facts: object) -> Capture:
    black = {"cfa": None, "black_level": np.zeros(3, np.float32), "white_level": 1.0}
    own = {"white_balance": None, "color_matrix": None, "samples": np.full((3, *SHAPE), 0.3, "f4")}
    return _mosaic(**(black | own | facts))


def _prepare(bundle: Path | None, capture: Capture, **choices: object) -> Preparation:
    opened = None if bundle is None else open_bundle(bundle)
    return Pipeline(opened, Options(**choices)).start(capture).prepared  # type: ignore[arg-type]


def test_a_capture_that_states_everything_leaves_nothing_to_note(bundle: Path) -> None:
    made = _prepare(bundle, _mosaic())
    assert made.notes == []
    assert made.white_balance == OWN_BALANCE


def test_the_callers_white_balance_wins_over_the_captures(bundle: Path) -> None:
    assert _prepare(bundle, _mosaic(), white_balance=(3.0, 1.0, 3.0)).white_balance == (3, 1, 3)


def test_a_silent_capture_gets_the_white_balance_of_the_bundles_light(bundle: Path) -> None:
    made = _prepare(bundle, _mosaic(white_balance=None))
    camera = tiny_camera()
    expected = camera_from_rec709(np.array(camera.color_matrix))[1]
    np.testing.assert_allclose(made.white_balance, expected)
    assert made.white_balance != (1.0, 1.0, 1.0)
    assert made.notes == [
        f"the capture states no white balance: that of {camera.illuminant} is used"
    ]


def test_without_bundle_and_statements_gains_are_1_and_colours_rec709_and_both_are_said() -> None:
    made = _prepare(None, _mosaic(white_balance=None, color_matrix=None))
    assert made.white_balance == (1.0, 1.0, 1.0)
    assert [note.split(":")[0] for note in made.notes] == [
        "the file states no white balance",
        "the file states no colour matrix",
    ]
    assert made.placement is made.noise is made.decided is made.network is None


def test_the_files_own_matrix_wins_over_the_bundles(bundle: Path) -> None:
    own, bundles = (
        _prepare(bundle, capture).color.matrix
        for capture in (_mosaic(), _mosaic(color_matrix=None))
    )
    stated = _mosaic(color_matrix=np.array(tiny_camera().color_matrix))
    np.testing.assert_array_equal(bundles, _prepare(bundle, stated).color.matrix)
    assert (own != bundles).any()


def test_planes_are_taken_as_they_are_and_noted(bundle: Path) -> None:
    made = _prepare(bundle, _planes())
    assert made.white_balance == (1.0, 1.0, 1.0)
    assert made.notes == ["a linear RGB capture in a raw_bayer_v1 bundle: not demosaicked"]


def test_an_assumed_place_is_noted_and_a_wrong_size_is_refused(bundle: Path) -> None:
    small = _mosaic(samples=np.full((32, 48), 500, np.uint16))
    centred = _prepare(bundle, small, assume="centre")
    assert centred.placement is not None
    assert centred.placement.window.origin_px == (24.0, 16.0)
    assert centred.notes == [centred.placement.note]
    with pytest.raises(ContractError, match="48x32 pixels, the bundle's sensor 96x64"):
        _prepare(bundle, small)


def test_notes_of_the_decode_come_first(bundle: Path) -> None:
    made = _prepare(bundle, _mosaic(notes=("half of it is missing",), white_balance=None))
    assert made.notes[0] == "half of it is missing"
    assert len(made.notes) == 2


def test_noise_is_the_files_before_the_bundles_before_a_measured_one(bundle: Path) -> None:
    stated = NoiseModel(shot=(1e-3,) * 3, read_variance=(1e-6,) * 3)
    cases = {
        "file": _mosaic(noise=stated),
        "bundle": _mosaic(),
        "measured": _mosaic(iso=None),
    }
    for source, capture in cases.items():
        assert _prepare(bundle, capture).record["noise"]["source"] == source
    made = _prepare(bundle, cases["file"])
    assert made.record["noise"]["shot"] == stated.shot, "before white balance"
    assert made.noise == stated.with_gains(OWN_BALANCE)
    at_iso = tiny_camera().noise_at(400).with_gains(OWN_BALANCE)
    assert _prepare(bundle, replace(cases["bundle"], iso=400.0)).noise == at_iso


def test_a_classical_method_plans_no_windows_and_the_network_does(bundle: Path) -> None:
    assert _prepare(bundle, _mosaic(), method="wiener").network is None
    made = _prepare(bundle, _mosaic())
    assert made.network is not None
    assert made.record["tiles"] == made.network.to_json()
    assert made.record["quality"] == "exact"
    assert made.explain() is not None
    assert made.record["estimate"]["peak_mb"] > 260


@pytest.mark.parametrize(
    ("depth_m", "kernels"), [(None, "mean of 0.5 m, 1 m, 2 m"), (0.7, "0.7 m")]
)
def test_the_plan_says_whose_kernels_the_bank_has(
    depth_m: float | None, kernels: str, tmp_path: Path
) -> None:
    deep = write_deep_bundle(tmp_path)
    made = _prepare(
        deep.path, _mosaic(origin_px=(0, 0), sensor_size_px=(320, 240)), depth_m=depth_m
    )
    assert made.record["depth"] == kernels


def test_the_plan_of_one_depth_does_not_speak_of_it(bundle: Path) -> None:
    assert "depth" not in _prepare(bundle, _mosaic()).record
