"""The focus of a camera body comes back from captures of a target; what shows none is refused."""

import math
from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.calibration.edges import find_edges
from camkit.calibration.focus import (
    EdgeCamera,
    edge_rises,
    measure_focus,
    rise_places,
)
from camkit.errors import ContractError
from camkit.runtime.capture import Capture
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.scenes.squares import squares_scene
from tests.focus_bundle import SIDE_PX, focus_psf, write_focus_bundle
from tests.psf_factory import gaussian_kernel
from tools.capture.simulated import captured

TOLERANCE_UM = 0.6


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_focus_bundle(tmp_path_factory.mktemp("focus"))


def taken(bundle: Bundle, focus_um: float, *, seed: int = 1, **options: float) -> Capture:
    pipeline = Pipeline(bundle, Options(method="wiener", threads=1))
    chosen = SimulationOptions(**({"focus_um": focus_um, "iso": 100.0} | options))  # type: ignore[arg-type]
    scene = squares_scene(seed, SIDE_PX, SIDE_PX)
    return captured(pipeline, simulate(scene, bundle.manifest.sensor, bundle.psf, chosen))


def camera(bundle: Bundle) -> EdgeCamera:
    sensor = bundle.manifest.sensor
    assert sensor.type == "bayer"
    return EdgeCamera(psf=bundle.psf, sensor=sensor)


@pytest.mark.parametrize("angle_deg", [0.0, 7.0, 45.0, 100.0])
def test_an_edge_seen_through_a_gaussian_rises_as_its_integral(angle_deg: float) -> None:
    """A pixel's own area adds a twelfth of a square pixel to the variance."""
    angle = math.radians(angle_deg)
    kernels = gaussian_kernel(2.0, radius_px=12)
    rises = edge_rises(kernels, (math.sin(angle), math.cos(angle)))
    at = rise_places(25, 25)
    wide = math.sqrt(2 * (2.0**2 + 1 / 12))
    wanted = [0.5 * (1 + math.erf(x / wide)) for x in at]
    np.testing.assert_allclose(rises[1], wanted, atol=5e-3)


@pytest.mark.parametrize("focus_um", [-31.0, -8.0, 17.0])
def test_the_focus_of_a_unit_comes_back(bundle: Bundle, focus_um: float) -> None:
    found = measure_focus([("target", taken(bundle, focus_um))], camera(bundle))
    assert found.focus_um == pytest.approx(focus_um, abs=TOLERANCE_UM)
    assert 0 < found.standard_error_um < 1
    assert found.misfit < 0.6 * found.misfit_nominal
    assert (found.captures, found.edges > 8) == (1, True)


def test_several_captures_count_each(bundle: Bundle) -> None:
    captures = [(f"{seed}", taken(bundle, 20.0, seed=seed, iso=400.0)) for seed in (1, 2)]
    found = measure_focus(captures, camera(bundle))
    assert found.captures == 2
    assert found.focus_um == pytest.approx(20.0, abs=2)
    said = found.to_json()
    assert said["focus_um"] == round(found.focus_um, 2)


def test_edges_are_found_in_planes_too(bundle: Bundle) -> None:
    mosaic = taken(bundle, 20.0)
    linear = mosaic.linear_rows(0, mosaic.height)
    cells = np.stack([linear[::2, ::2], linear[::2, 1::2], linear[1::2, 1::2]])
    planes = Capture(
        samples=np.repeat(np.repeat(cells, 2, axis=1), 2, axis=2),
        cfa=None,
        black_level=np.zeros(3, np.float32),
        white_level=1.0,
    )
    assert len(find_edges(planes).edges) > 8


def test_a_body_in_focus_needs_no_file(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match="from the nominal one: omit unit"):
        measure_focus([("target", taken(bundle, 0.0, iso=400.0))], camera(bundle))


def test_a_focus_at_the_end_of_the_kernels_is_refused(bundle: Bundle) -> None:
    near = replace(
        camera(bundle),
        psf=replace(
            bundle.psf,
            focus_um=np.array([-10.0, 10.0]),
            focus_kernels=np.stack(
                [0.75 * bundle.psf.kernels + 0.25 * k for k in bundle.psf.focus_kernels]  # type: ignore[union-attr]
            ),
        ),
    )
    with pytest.raises(ContractError, match=r"at or beyond 10 um, where the kernels end"):
        measure_focus([("target", taken(bundle, 30.0))], near)


def test_clipped_and_empty_targets_are_refused(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match=r"show 0 straight edges.* more are clipped: expose"):
        measure_focus([("target", taken(bundle, 20.0, exposure=4.0))], camera(bundle))
    grey = replace(taken(bundle, 20.0), samples=np.full((SIDE_PX, SIDE_PX), 500, np.uint16))
    with pytest.raises(ContractError, match="photograph dark squares on white"):
        measure_focus([("grey", grey)], camera(bundle))


def test_noise_alone_shows_no_edges(bundle: Bundle) -> None:
    noise = np.random.default_rng(1).integers(64, 1000, (SIDE_PX, SIDE_PX)).astype(np.uint16)
    grain = replace(taken(bundle, 20.0), samples=noise)
    assert not find_edges(grain).edges
    with pytest.raises(ContractError, match="show 0 straight edges"):
        measure_focus([("noise", grain)], camera(bundle))


def test_captures_of_another_sensor_are_refused_by_name(bundle: Bundle) -> None:
    other = replace(taken(bundle, 20.0), sensor_size_px=(100, 100), origin_px=None)
    small = replace(other, samples=other.samples[:600], sensor_size_px=None)
    with pytest.raises(ContractError, match=r"small: the capture has 704x600 pixels"):
        measure_focus([("small", small)], camera(bundle))


def test_a_capture_of_other_colours_is_refused(bundle: Bundle) -> None:
    grey = Capture(
        samples=np.zeros((1, SIDE_PX, SIDE_PX), np.float32),
        cfa=None,
        black_level=np.zeros(1, np.float32),
        white_level=1.0,
    )
    with pytest.raises(ContractError, match="grey has 1 colours, the sensor 3"):
        measure_focus([("grey", grey)], camera(bundle))


def test_edges_of_another_lens_are_refused(bundle: Bundle) -> None:
    wider = replace(camera(bundle), psf=focus_psf(scale=2.0))
    with pytest.raises(ContractError, match="another lens or distance"):
        measure_focus([("target", taken(bundle, 10.0))], wider)


def test_a_psf_of_the_nominal_focus_alone_measures_nothing(bundle: Bundle) -> None:
    plain = replace(camera(bundle), psf=focus_psf(moved=False))
    with pytest.raises(ContractError, match="has the nominal focus alone"):
        measure_focus([], plain)
