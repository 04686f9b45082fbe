"""One edge for every camera: MTF of capture and pictures, at frequencies of the picture."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle, open_bundle
from camkit.report.bench import edge
from camkit.report.bench.accuracy import INPUT, Restorers, score_key
from camkit.report.bench.edge import CAPTURE, COLUMNS, SCENE, Edges, measure_edges
from camkit.report.bench.line_up import make_trials
from camkit.report.bench.output import flatten
from camkit.report.bench.row import make_row
from camkit.report.bench.trial import Axes, Entrant, Ground, Trial
from camkit.runtime.twin.light import lens_of
from camkit.runtime.twin.truth import light_sensor
from camkit.scenes.slanted_edge import ANGLE_RAD
from tests.bench_factory import make_facts, make_run, make_trial
from tests.bundle_factory import tiny_manifest, tiny_members, tiny_sensor, write_bundle
from tests.glare_bundle import write_glare_bundle
from tests.hdr_bundle import write_hdr_bundle
from tests.toy_camera.bundle import write_toy_bundle
from tests.toy_camera.install import toy_installed  # noqa: F401

TOLERANCE = 0.015
"""A hundredth of the measurement, and what the noise of one capture adds."""


def trials_of(bundle: Bundle, methods: Sequence[str] | None = None) -> list[Trial]:
    name = bundle.manifest.name
    ground = Ground(threads=1, providers=("cpu",), free_bytes=None)
    axes = Axes(methods=None if methods is None else tuple(methods), vary=False)
    return make_trials([Entrant(label=name, bundle=bundle, camera=name)], axes, ground)[0]


def measured(bundle: Bundle, methods: Sequence[str] | None = None) -> Edges:
    return measure_edges(bundle, trials_of(bundle, methods), Restorers(bundle, threads=1))


def otf_of(bundle: Bundle, cycles_per_px: np.ndarray, *, level: bool = False) -> np.ndarray:
    """Give |OTF| of the middle kernel across the edge."""
    sensor = light_sensor(bundle.manifest)
    kernels = lens_of(bundle.psf, sensor, depth_mm=bundle.reference_depth_mm).kernels_at(0.0, 0.0)
    kernel = kernels[len(kernels) // 2].T if level else kernels[len(kernels) // 2]
    y, x = (np.arange(n) - n // 2 for n in kernel.shape)
    far = x[None] * np.cos(ANGLE_RAD) - y[:, None] * np.sin(ANGLE_RAD)
    waves = np.exp(-2j * np.pi * np.multiply.outer(cycles_per_px, far))
    return np.abs((waves * kernel).sum((1, 2)))


def test_a_capture_has_the_mtf_of_the_scene_times_that_of_the_kernels(tmp_path: Path) -> None:
    """The streak camera: the same everywhere, wider than high, so that the edge is level."""
    bundle = write_hdr_bundle(tmp_path)
    edges = measured(bundle)
    found = edges.columns(INPUT)
    assert edges.skips == ()
    scene = np.array([found[f"{SCENE}{name}"] for name in COLUMNS])
    expected = scene * otf_of(bundle, np.array(edge.CYCLES_PER_PX), level=True)
    seen = [found[f"{CAPTURE}{name}"] for name in COLUMNS]
    np.testing.assert_allclose(seen, expected, rtol=0, atol=TOLERANCE)
    assert found["mtf_025"] == pytest.approx(seen[0], abs=TOLERANCE)
    (row,) = {score_key(trial) for trial in trials_of(bundle)} - {INPUT}
    assert edges.columns(row)["mtf_025"] > found["mtf_025"]


@pytest.mark.usefixtures("toy_installed")
def test_frequencies_are_those_of_a_picture_finer_than_the_sensor(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Twice as fine: a fifth of a cycle per pixel of the sensor is a tenth of the picture's."""
    monkeypatch.setattr(edge, "CYCLES_PER_PX", (0.05, 0.1))
    bundle = write_toy_bundle(tmp_path)
    edges = measured(bundle, ("net",))
    (row,) = (key for key in edges.by_method if key != INPUT)
    found = edges.columns(row)
    assert found[f"{SCENE}mtf_050"] == pytest.approx(np.sinc(0.1), abs=TOLERANCE)
    of_sensor = np.array([0.1, 0.2])
    expected = otf_of(bundle, of_sensor) * np.sinc(of_sensor)
    seen = [found[f"{CAPTURE}{name}"] for name in COLUMNS]
    np.testing.assert_allclose(seen, expected, rtol=0, atol=TOLERANCE)
    assert found["mtf_025"] is not None
    # nothing of the right size stands for its picture
    assert edges.columns(INPUT)["mtf_025"] is None
    assert edges.skips == ()


def test_a_camera_that_states_no_optics_has_no_mtf(tmp_path: Path) -> None:
    bundle = open_bundle(write_glare_bundle(tmp_path))
    assert bundle.manifest.optics is None
    edges = measured(bundle)
    assert edges == Edges()
    assert set(edges.columns(INPUT).values()) == {None}


def test_a_sensor_too_small_for_an_edge_says_so(tmp_path: Path) -> None:
    path = tmp_path / "small.camkit"
    write_bundle(path, tiny_manifest(sensor=tiny_sensor(32, 16)), tiny_members())
    (skip,) = measured(open_bundle(path), ("net",)).skips
    assert skip.what == "MTF of tiny"
    assert "\n" not in skip.reason


def test_rows_hold_the_columns_of_their_method() -> None:
    trial = make_trial()
    edges = Edges(shared={"scene_mtf_025": 0.9}, by_method={trial.accuracy_key: {"mtf_025": 0.7}})
    row = make_row(trial, [make_run(1.0)], replace(make_facts(), edges=edges))
    assert (row["mtf_025"], row["mtf_050"]) == (0.7, None)
    assert (row["scene_mtf_025"], row["capture_mtf_025"]) == (0.9, None)
    assert flatten(row)["mtf_025"] == 0.7
