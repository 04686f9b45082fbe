"""A haze, kernels of one distance and single photons as graphs give what camkit gives."""

from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest

from camkit.bundle.golden import golden_from_bytes
from camkit.bundle.reader import GOLDEN, Bundle, built_in_bundles, open_bundle
from camkit.runtime.bank.cell_means import cell_means
from camkit.runtime.bank.haze import solve_coarse
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.portable.facts import facts_of
from camkit.runtime.portable.graph_builder import GraphBuilder
from camkit.runtime.portable.haze_graph import HazeFacts, cells_graph, haze_graph
from camkit.runtime.portable.package import write_portable
from camkit.runtime.rows import ArrayRows
from camkit.runtime.signal.demosaic import apply_gains
from tests.runtime.portable.beside_camkit import camkit_light, decibels
from tools.portable_table import load_example

LEAST_DB = 100.0
DEPTH_M = 1.0
BLACK, WHITE, CLIP = 256.0, 4095.0, 4057
GAINS = (2.7, 1.0, 1.37)
PITCH_UM = 5.96


@pytest.fixture(scope="module")
def bundle() -> Bundle:
    """Return a camera with a haze."""
    return open_bundle(built_in_bundles()["thin-plate"])


@pytest.fixture(scope="module")
def haze(bundle: Bundle) -> HazeFacts:
    """Return its haze."""
    facts = facts_of(bundle)
    assert facts.haze is not None
    return facts.haze


def _run(graph: GraphBuilder, values: dict[str, Any]) -> dict[str, Any]:
    session = onnxruntime.InferenceSession(graph.to_bytes())
    outputs = session.run(graph.outputs, values | graph.tables)
    return dict(zip(graph.outputs, outputs, strict=True))


@pytest.mark.parametrize(
    ("shape", "red", "cfa"), [((203, 331), (1, 0), "GRBG"), ((72, 23), (0, 1), "GBRG")]
)
def test_cells_are_exact_where_the_last_ones_are_cut_or_merged(
    haze: HazeFacts, shape: tuple[int, int], red: tuple[int, int], cfa: Any
) -> None:
    mosaic = np.random.default_rng(1).integers(BLACK, WHITE, shape, endpoint=True)
    levels = np.array([BLACK, WHITE, CLIP], np.float32)
    values = {"mosaic": mosaic.astype(np.float32), "levels": levels, "red_px": np.array(red)}
    cells = _run(cells_graph(haze), values | {"gains": np.array(GAINS, np.float32)})
    light = ((mosaic - BLACK) / (WHITE - BLACK)).astype(np.float32)
    apply_gains(light, cfa, GAINS)
    clipped_samples = ArrayRows((mosaic >= CLIP)[None])
    means, clipped = cell_means(ArrayRows(light[None]), clipped_samples, cfa, haze.kernels.cell_px)
    np.testing.assert_allclose(cells["means"], means, rtol=1e-6)
    assert np.array_equal(cells["clipped"] == 1, clipped)


def test_gain_and_veil_are_those_of_camkit_off_the_axis_and_beside_clipped_cells(
    haze: HazeFacts,
) -> None:
    size_px, origin_px = (1000, 771), (2500, 1700)
    window = SensorWindow(
        size_px=size_px, origin_px=origin_px, sensor_size_px=(6000, 4000), pitch_um=PITCH_UM
    )
    means = np.random.default_rng(2).uniform(0, 1, (3, 48, 63)).astype(np.float32)
    clipped = means > 0.9
    terms, rounds = haze.stage.terms, haze.stage.rounds
    band = solve_coarse(means, clipped, haze.kernels, window, terms=terms, rounds=rounds)
    values = {"means": means, "clipped": clipped.astype(np.float32)}
    axis = np.subtract(window.known_axis_px, origin_px)
    found = _run(haze_graph(haze), values | {"axis_px": axis})
    assert decibels(found["clear"], np.concatenate([band.gain, band.veil])) >= LEAST_DB
    np.testing.assert_allclose(found["noise_rise"], band.noise_rise, rtol=1e-5)


def test_a_reader_removes_the_haze(bundle: Bundle, tmp_path: Path) -> None:
    write_portable(bundle, tmp_path / "out", ("S",))
    camera = load_example("portable_camera").PortableCamera(tmp_path / "out", "S")
    _check_dark_case(bundle, camera)


def test_kernels_of_a_stated_distance_are_those_of_camkit_told_so(tmp_path: Path) -> None:
    bundle = open_bundle(built_in_bundles()["trio-edof"])
    write_portable(bundle, tmp_path / "out", ("S",), depth_mm=1000 * DEPTH_M)
    camera = load_example("portable_camera").PortableCamera(tmp_path / "out", "S")
    assert camera.bank["distance"] == "1 m"
    _check_dark_case(bundle, camera, depth_m=DEPTH_M)


def _check_dark_case(bundle: Bundle, camera: Any, **options: Any) -> None:
    """Compare the case that needs none of the rules of other readers before undistortion."""
    case = next(case for case in bundle.manifest.golden if case.name == "very_dark")
    capture = golden_from_bytes(bundle.member(GOLDEN))[case.name].capture
    facts = capture, case.iso, case.white_balance, case.origin_px
    even = camkit_light(bundle, capture, case, undistort=False, color="camera", **options)
    assert decibels(camera.develop(*facts, straight=False), even) >= LEAST_DB


def test_pictures_of_photons_meet_their_golden_cases(tmp_path: Path) -> None:
    bundle = open_bundle(built_in_bundles()["spad-sr"])
    write_portable(bundle, tmp_path / "out", ("S",))
    array = load_example("portable_frames").PortableArray(tmp_path / "out", "S")
    golden, seen = golden_from_bytes(bundle.member(GOLDEN)), []
    for case in bundle.manifest.golden:
        stored = golden[case.name].output("image", "S")
        if stored is not None:
            picture = array.develop(golden[case.name].capture[None])
            np.testing.assert_allclose(picture, stored, rtol=case.rtol, atol=case.atol)
            seen.append(case.name)
    assert seen == ["dim", "typical", "bright"]


def test_frames_without_photons_stay_dark_and_dark_counts_are_no_light(tmp_path: Path) -> None:
    write_portable(open_bundle(built_in_bundles()["spad-sr"]), tmp_path / "out", ("S",))
    array = load_example("portable_frames").PortableArray(tmp_path / "out", "S")
    counts = np.full((2, 8, 12), 3.0)
    counts[1] += 40
    pictures = array.develop(counts, dark=3.0)
    assert not pictures[0].any()
    assert pictures[1].mean() == pytest.approx(40, rel=0.1)
