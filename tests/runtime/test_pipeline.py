"""The pipeline as an application uses it: same bits however it runs, clear refusals."""

import pickle
import shutil
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle, built_in_bundles, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import BundleError, ContractError
from camkit.runtime.batch import process
from camkit.runtime.cancel import Cancelled
from camkit.runtime.capture import MosaicOptions
from camkit.runtime.network import graph
from camkit.runtime.options import Options
from camkit.runtime.output.dng import DngTags, write_bayer_dng
from camkit.runtime.pipeline import Pipeline, load
from camkit.runtime.twin.simulate import Simulation, SimulationOptions, simulate
from tests.bundle_factory import tiny_manifest, tiny_members, write_tiny_bundle
from tests.capture_factory import write_tiny_captures
from tests.data_folder import data_path
from tests.decoded_here import decoded_here  # noqa: F401
from tests.deep_bundle import write_deep_bundle
from tests.psf_factory import psnr_db, texture


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_bundle(tmp_path_factory.mktemp("bundle"))


@pytest.fixture(scope="module")
def mosaic() -> np.ndarray:
    rng = np.random.default_rng(2)
    smooth = np.add.outer(np.linspace(100, 700, 64), np.linspace(0, 200, 96))
    return (smooth + rng.normal(0, 5, smooth.shape)).clip(0, 1023).astype(np.uint16)


def _run(bundle: Path, mosaic: np.ndarray, **choices: object) -> FloatArray:
    return load(bundle, **choices).process_array(mosaic, iso=100.0)


def test_the_picture_has_the_size_of_the_capture_and_is_finite(
    bundle: Path, mosaic: np.ndarray
) -> None:
    image = _run(bundle, mosaic)
    assert (image.shape, image.dtype) == ((3, 64, 96), np.float32)
    assert np.isfinite(image).all()


@pytest.mark.parametrize(
    "choice", [{"tile_px": 16}, {"tile_px": 30, "threads": 1}, {"threads": 2}, {"mode": "whole"}]
)
def test_tiles_and_threads_do_not_change_a_bit(
    bundle: Path, mosaic: np.ndarray, choice: dict[str, object]
) -> None:
    np.testing.assert_array_equal(_run(bundle, mosaic, **choice), _run(bundle, mosaic))


def test_one_pipeline_serves_many_threads_with_equal_bits(bundle: Path, mosaic: np.ndarray) -> None:
    pipeline = load(bundle)
    with ThreadPoolExecutor(4) as pool:
        images = list(pool.map(lambda _: pipeline.process_array(mosaic, iso=100.0), range(6)))
    for image in images[1:]:
        np.testing.assert_array_equal(image, images[0])


def test_out_is_filled_and_returned(bundle: Path, mosaic: np.ndarray) -> None:
    out = np.empty((3, 64, 96), dtype=np.float32)
    assert load(bundle).process_array(mosaic, iso=100.0, out=out) is out
    np.testing.assert_array_equal(out, _run(bundle, mosaic))


def test_out_of_the_wrong_shape_is_refused(bundle: Path, mosaic: np.ndarray) -> None:
    with pytest.raises(ContractError, match=r"out must be float32"):
        load(bundle).process_array(mosaic, out=np.empty((3, 64, 95), dtype=np.float32))


@pytest.mark.parametrize("method", ["net", "wiener", "develop"])
def test_progress_rises_over_all_stages_to_the_whole(
    bundle: Path, mosaic: np.ndarray, method: str
) -> None:
    seen: list[tuple[int, int]] = []
    pipeline = load(bundle, method=method)
    pipeline.process_array(mosaic, iso=100.0, progress=lambda *ticks: seen.append(ticks))
    done, totals = zip(*seen, strict=True)
    assert len(set(totals)) == 1
    assert list(done) == sorted(set(done))
    assert done[-1] == totals[0]
    assert len(done) > 3


@pytest.mark.parametrize("asked", [1, 2, 5, 9])
def test_cancel_stops_wherever_it_is_asked(bundle: Path, mosaic: np.ndarray, asked: int) -> None:
    times = iter(range(1000))
    with pytest.raises(Cancelled):
        load(bundle).process_array(mosaic, iso=100.0, cancel=lambda: next(times) >= asked)


def test_a_pipeline_is_pickled_by_what_it_was_made_from(bundle: Path, mosaic: np.ndarray) -> None:
    pipeline = load(bundle, exposure_ev=0.5)
    packed = pickle.dumps(pipeline)
    assert len(packed) < 5000
    again = pickle.loads(packed)
    assert again.options == pipeline.options
    np.testing.assert_array_equal(
        again.process_array(mosaic, iso=100.0), pipeline.process_array(mosaic, iso=100.0)
    )
    assert pickle.loads(pickle.dumps(load(None))).bundle is None


def test_a_pickled_pipeline_refuses_another_bundle(bundle: Path, tmp_path: Path) -> None:
    moved = tmp_path / bundle.name
    moved.write_bytes(bundle.read_bytes())
    packed = pickle.dumps(load(moved))
    other = tiny_manifest().model_copy(update={"freeze": {"other": 1.0}})
    write_bundle(moved, other, tiny_members())
    with pytest.raises(BundleError, match="not the bundle tiny that was pickled"):
        pickle.loads(packed)


def test_a_crop_with_its_origin_keeps_place_and_vignetting(bundle: Path) -> None:
    """Blocks lie elsewhere in a crop, so means over areas of a smooth scene are compared."""
    smooth = np.add.outer(np.linspace(300, 500, 64), np.linspace(0, 200, 96)).astype(np.uint16)
    options = {"undistort": False, "method": "wiener", "color": "camera"}
    whole = load(bundle, **options).process_array(smooth, iso=100.0)
    crop = load(bundle, **options).process_array(
        np.ascontiguousarray(smooth[16:48, 20:84]), iso=100.0, origin_px=(20, 16)
    )

    def areas(image: FloatArray) -> FloatArray:
        return image.reshape(3, 2, 8, 6, 8).mean(axis=(2, 4))

    np.testing.assert_allclose(areas(crop[:, 8:-8, 8:-8]), areas(whole[:, 24:40, 28:76]), rtol=0.03)


def test_white_balance_gains_scale_the_colours(bundle: Path, mosaic: np.ndarray) -> None:
    grey = np.full_like(mosaic, 500)
    options = {"color": "camera", "method": "wiener", "vignetting": False}
    plain = load(bundle, white_balance=(1.0, 1.0, 1.0), **options).process_array(grey, iso=100.0)
    red = load(bundle, white_balance=(2.0, 1.0, 1.0), **options).process_array(grey, iso=100.0)
    centre = np.s_[:, 28:36, 40:56]
    np.testing.assert_allclose(red[centre][0], 2 * plain[centre][0], rtol=2e-3)
    np.testing.assert_allclose(red[centre][1], plain[centre][1], rtol=2e-3)


def test_exposure_doubles_per_ev(bundle: Path, mosaic: np.ndarray) -> None:
    np.testing.assert_allclose(
        _run(bundle, mosaic, exposure_ev=1.0), 2 * _run(bundle, mosaic), rtol=1e-5, atol=1e-6
    )


def test_a_dead_pixel_is_repaired_and_reported(bundle: Path, mosaic: np.ndarray) -> None:
    broken = mosaic.copy()
    broken[31, 47] = 1023
    pipeline = load(bundle)
    work = pipeline.start(
        pipeline.capture_of(broken, iso=100.0, white_balance=None, origin_px=None)
    )
    image = work.fill()
    assert any("repaired" in warning for warning in work.warnings)
    np.testing.assert_allclose(image, _run(bundle, mosaic), atol=0.1)


def test_the_plan_is_known_before_any_work(bundle: Path, mosaic: np.ndarray) -> None:
    pipeline = load(bundle)
    work = pipeline.start(
        pipeline.capture_of(mosaic, iso=100.0, white_balance=None, origin_px=None)
    )
    assert work.record["noise"]["source"] == "bundle"
    assert work.record["tiles"]["mode"] == "exact"
    assert set(work.seconds) <= {"noise"}


def test_noise_is_measured_where_no_iso_is_known(bundle: Path, mosaic: np.ndarray) -> None:
    pipeline = load(bundle)
    work = pipeline.start(pipeline.capture_of(mosaic, iso=None, white_balance=None, origin_px=None))
    assert work.record["noise"]["source"] == "measured"


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.zeros((64, 96), np.float64), "uint8, uint16 or float32"),
        (np.zeros((4, 64, 96), np.float32), r"\(h, w\) or \(3, h, w\); got \(4, 64, 96\)"),
        (np.zeros((60, 96), np.uint16), "96x60"),
    ],
)
def test_a_wrong_array_is_refused(bundle: Path, image: np.ndarray, message: str) -> None:
    with pytest.raises(ContractError, match=message):
        load(bundle).process_array(image)


def test_linear_planes_are_taken_with_a_note(bundle: Path) -> None:
    pipeline = load(bundle)
    planes = np.full((3, 64, 96), 0.25, dtype=np.float32)
    work = pipeline.start(
        pipeline.capture_of(planes, iso=100.0, white_balance=None, origin_px=None)
    )
    assert any("instead of a mosaic" in warning for warning in work.warnings)
    assert np.isfinite(work.fill()).all()


def test_a_size_the_bundle_lacks_is_refused(bundle: Path) -> None:
    with pytest.raises(ContractError, match=r"holds size\(s\) M"):
        load(bundle, size="L")


def test_an_unknown_option_names_the_known_ones(bundle: Path) -> None:
    with pytest.raises(ContractError, match=r"unknown option.*tile_px"):
        load(bundle, tiles=3)


def test_arrays_need_a_bundle(mosaic: np.ndarray) -> None:
    with pytest.raises(ContractError, match="needs a bundle"):
        Pipeline(None, Options()).process_array(mosaic)


@pytest.mark.parametrize("method", ["wiener", "rl", "admm-tv"])
def test_classical_methods_need_no_network(bundle: Path, mosaic: np.ndarray, method: str) -> None:
    pipeline = load(bundle, method=method)
    assert pipeline.size is None
    assert pipeline._engines == {}
    assert np.isfinite(pipeline.process_array(mosaic, iso=100.0)).all()


def test_streamed_bands_are_the_rows_of_the_picture(tmp_path: Path) -> None:
    path = write_tiny_captures(tmp_path, ["a"])
    bands: list[tuple[int, FloatArray]] = []
    pipeline = load(path)
    summary = pipeline.stream(tmp_path / "a.dng", lambda top, band: bands.append((top, band)))
    picture = pipeline.process(tmp_path / "a.dng")
    np.testing.assert_array_equal(np.concatenate([b for _, b in bands], axis=1), picture.image)
    assert next(top for top, _ in bands) == 0
    assert summary.shape == picture.image.shape
    assert set(summary.seconds) == set(picture.seconds)


@pytest.fixture(scope="module")
def deep(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_deep_bundle(tmp_path_factory.mktemp("deep"))


@pytest.fixture(scope="module")
def near(deep: Bundle) -> Simulation:
    """A capture of a scene half as far as the focus."""
    scene = texture(96, 96)
    options = SimulationOptions(depth_mm=500.0, origin_px=(80, 40), distort=False)
    return simulate(scene, deep.manifest.sensor, deep.psf, options)


@pytest.mark.parametrize("method", ["wiener", "rl", "admm-tv"])
def test_every_method_restores_best_with_the_kernels_of_the_depth(
    method: str, deep: Bundle, near: Simulation
) -> None:
    found = {}
    for depth_m in (0.5, None, 1.0):
        chosen = Options(method=method, depth_m=depth_m, color="camera", undistort=False)
        image = Pipeline(deep, chosen).process_array(
            near.samples, iso=100.0, white_balance=near.white_balance, origin_px=(80, 40)
        )
        found[depth_m] = psnr_db(image, near.clean, cut_px=16)
    assert found[0.5] > found[None] + 0.1
    assert found[None] > found[1.0]


def test_without_a_depth_the_bank_has_the_mean_kernel(deep: Bundle, near: Simulation) -> None:
    mean = np.stack([deep.psf.kernels.mean(axis=1)], axis=1)
    shallow = replace(deep.psf, kernels=mean, depths_mm=np.array([1000.0]))
    images = []
    for bundle in (deep, replace(deep, _optics=FrozenOptics(psf=shallow))):
        pipeline = Pipeline(bundle, Options(method="wiener"))
        images.append(pipeline.process_array(near.samples, iso=100.0, origin_px=(80, 40)))
    np.testing.assert_allclose(images[0], images[1], atol=2e-5)


def test_a_depth_without_kernels_is_refused_before_any_work(bundle: Path, deep: Bundle) -> None:
    with pytest.raises(ContractError, match=r"0\.5 m to 2 m .*; got 3 m"):
        Pipeline(deep, Options(depth_m=3.0))
    with pytest.raises(ContractError, match="the one depth infinity; got 3 m"):
        load(bundle, depth_m=3.0)
    with pytest.raises(ContractError, match="depth_m does not apply without a bundle"):
        load(None, depth_m=3.0)


def test_the_only_depth_may_be_named(bundle: Path, mosaic: np.ndarray) -> None:
    np.testing.assert_array_equal(_run(bundle, mosaic, depth_m=np.inf), _run(bundle, mosaic))


@pytest.mark.parametrize("origin", [(4, 4), (5, 4), (4, 7), (9, 7)])
def test_an_odd_origin_begins_with_the_pixel_that_the_sensor_has_there(
    bundle: Path, mosaic: np.ndarray, origin: tuple[int, int]
) -> None:
    red_is_darker = mosaic.copy()
    red_is_darker[::2, ::2] //= 2
    pipeline, (x, y) = load(bundle, method="wiener", undistort=False, vignetting=False), origin
    crop = np.ascontiguousarray(red_is_darker[y : y + 40, x : x + 60])
    found = pipeline.process_array(crop, iso=100.0, origin_px=origin)
    whole = pipeline.process_array(red_is_darker, iso=100.0)[:, y : y + 40, x : x + 60]
    inner = np.s_[:, 12:28, 18:42]
    np.testing.assert_allclose(found[inner].mean((1, 2)), whole[inner].mean((1, 2)), rtol=0.03)


@pytest.mark.parametrize("origin", [(1.5, 2), (-2, 0), (1,), "ab"])
def test_an_origin_that_is_no_place_is_refused(
    bundle: Path, mosaic: np.ndarray, origin: object
) -> None:
    with pytest.raises(ContractError, match="origin_px must be two whole numbers"):
        load(bundle).process_array(mosaic[:20, :32], iso=100.0, origin_px=origin)  # type: ignore[arg-type]


def test_a_crop_without_a_place_is_taken_where_the_caller_says(tmp_path: Path) -> None:
    path = write_tiny_captures(tmp_path, ["a"])
    whole = load(path, method="wiener")
    capture = whole.read(tmp_path / "a.dng")
    dng = tmp_path / "crop.dng"
    tags = DngTags(
        cfa="RGGB",
        black=64,
        white=1023,
        color_matrix=None,
        as_shot_neutral=(0.5, 1.0, 0.6),
        camera_model="another camera",
    )
    write_bayer_dng(dng, np.array(capture.samples[8:48, 10:70]), tags=tags)
    with pytest.raises(ContractError, match="add its position"):
        whole.process(dng)
    once = whole.process(dng, origin_px=(10, 8)).image
    always = load(path, method="wiener", origin_px=(10, 8)).process(dng).image
    assert once.shape == (3, 40, 60)
    np.testing.assert_array_equal(once, always)
    with pytest.raises(ContractError, match=r"begins with RGGB.*has GRBG at \(11, 8\)"):
        whole.process(dng, origin_px=(11, 8))
    with pytest.raises(ContractError, match="needs a bundle"):
        load(None).process(dng, origin_px=(10, 8))
    with pytest.raises(ContractError, match="choose"):
        Options(origin_px=(10, 8), assume="centre")


def test_a_capture_in_memory_gives_the_picture_of_its_file(tmp_path: Path) -> None:
    pipeline = load(write_tiny_captures(tmp_path, ["a"]), method="wiener")
    known = pipeline.process(tmp_path / "a.dng").image
    data = (tmp_path / "a.dng").read_bytes()
    np.testing.assert_array_equal(pipeline.process(data).image, known)
    with (tmp_path / "a.dng").open("rb") as file:
        np.testing.assert_array_equal(pipeline.process(file).image, known)
    with pytest.raises(ContractError, match=r"Pipeline\.process"):
        process(data, bundle="none", out_dir=tmp_path)


def test_an_array_that_cannot_be_filled_is_refused_before_work(
    bundle: Path, mosaic: np.ndarray, tmp_path: Path
) -> None:
    pipeline = load(bundle)
    fixed = np.empty((3, 64, 96), np.float32)
    fixed.flags.writeable = False
    for out, message in ((fixed, "read-only"), ([1.0], "got list"), (mosaic, "got uint16")):
        with pytest.raises(ContractError, match=message):
            pipeline.process(tmp_path / "none.dng", out=out)  # type: ignore[arg-type]
        with pytest.raises(ContractError, match=message):
            pipeline.process_array(mosaic, iso=100.0, out=out)  # type: ignore[arg-type]
    planes = np.full((3, 64, 96), 0.25, np.float32)
    with pytest.raises(ContractError, match="shares memory"):
        pipeline.process_array(planes, iso=100.0, out=planes)


@pytest.mark.parametrize("iso", [1e300, 10**400, float("nan"), 0, -1, "100"])
def test_a_sensitivity_that_no_camera_has_is_refused(
    bundle: Path, mosaic: np.ndarray, iso: object
) -> None:
    with pytest.raises(ContractError, match="iso must be a number in"):
        load(bundle).process_array(mosaic, iso=iso)  # type: ignore[arg-type]


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 3e38, -3e38, -500.0])
@pytest.mark.parametrize("iso", [100.0, None])
def test_samples_that_are_no_light_give_a_finite_picture_without_a_warning(
    bundle: Path, mosaic: np.ndarray, value: float, iso: float | None
) -> None:
    broken = mosaic.astype(np.float32)
    broken.ravel()[np.random.default_rng(0).choice(broken.size, 300, replace=False)] = value
    assert np.isfinite(load(bundle).process_array(broken, iso=iso)).all()
    assert np.isfinite(load(bundle).process_array(np.stack([broken / 1023] * 3), iso=iso)).all()


def test_graphs_of_built_in_bundles_are_sound_so_that_no_process_looks_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for path in built_in_bundles().values():
        known = open_bundle(path)
        for role, sizes in known.manifest.networks.items():
            for size, facts in sizes.items():
                graph.check_graph(known.network_bytes(role, size), facts)
    looked: list[object] = []
    check = graph.check_graph

    def noted(*told: Any) -> Any:
        looked.append(told)
        return check(*told)

    monkeypatch.setattr(graph, "check_graph", noted)
    for path in built_in_bundles().values():
        load(path)
    assert looked == []
    load(shutil.copy(built_in_bundles()["duet"], tmp_path))
    assert len(looked) == 1


LEVELS = MosaicOptions(cfa="RGGB", black_level=256.0, white_level=4095.0)


def _even(folder: Path, level: float) -> Path:
    """Write a noisy even mosaic that lies at a share of white."""
    rng = np.random.default_rng(0)
    codes = rng.normal(256 + 3839 * level, 20 * level**0.5, (256, 256))
    path = folder / "even.png"
    assert cv2.imwrite(str(path), np.clip(np.rint(codes), 0, 4095).astype(np.uint16))
    return path


@pytest.mark.parametrize("gains", [(1.0, 1.0, 1.0), (2.0, 1.0, 1.6), (0.7, 1.0, 0.8)])
@pytest.mark.parametrize("level", [0.1, 0.4, 0.8])
def test_even_light_stays_whatever_its_level_and_white_balance(
    tmp_path: Path, level: float, gains: tuple[float, float, float]
) -> None:
    pipeline = load("trio-edof", assume="centre", color="camera", white_balance=gains, threads=1)
    made = pipeline.process(_even(tmp_path, level), mosaic=LEVELS).image
    np.testing.assert_allclose(made.mean(axis=(1, 2)), level * np.array(gains), rtol=0.01)


def test_the_even_mosaic_of_a_report_keeps_its_light() -> None:
    pipeline = load(
        "trio-edof", assume="centre", color="camera", white_balance=(1.0, 1.0, 1.0), threads=1
    )
    made = pipeline.process(data_path("reports/flat_grey_wb111.png"), mosaic=LEVELS).image
    np.testing.assert_allclose(made.mean(axis=(1, 2)), 0.4, rtol=0.01)
