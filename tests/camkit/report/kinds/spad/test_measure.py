"""Arrays of single photons measure themselves: rows of pictures and of seconds."""

import json
import math
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from camkit.bundle.manifest import planes_of
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent, SpadSensor
from camkit.bundle.stages import Correct, Parts, SuperResolve
from camkit.errors import BundleError, ContractError, DecodeError
from camkit.report.bench.part import OwnSettings
from camkit.report.kinds.spad import seconds, timing, ways
from camkit.report.kinds.spad.measure import measure
from camkit.report.kinds.spad.pictures import count_picture, picture_rows
from camkit.report.kinds.spad.scenes import drawn_pictures, read_pictures
from camkit.report.kinds.spad.ways import NET, Way, read_baselines, ways_of
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from tests.spad_bundle import HEIGHT, PHASE, SCALE, WIDTH, write_spad_bundle

ROLES = ("low_fill", "gaussian", "srcnn", "vdsr")
SIGMA = 1.5


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_spad_bundle(tmp_path_factory.mktemp("spad"))


@pytest.fixture(scope="module")
def baselines(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Give the network of the tiny bundle in all roles but full_fill."""
    folder = tmp_path_factory.mktemp("baselines")
    one = write_spad_bundle(folder).manifest
    stages = (
        Correct(),
        SuperResolve(role="low_fill", gives=("low_fill",), sampling="low_fill"),
        SuperResolve(role="gaussian", gives=("gaussian",), sampling="gaussian", sigma=SIGMA),
        SuperResolve(role="srcnn", gives=("srcnn",)),
        SuperResolve(role="vdsr", gives=("vdsr",)),
    )
    networks = dict.fromkeys(ROLES, one.networks["upscale"])
    parts = Parts(sensor=one.sensor, optics=one.optics, networks=networks)
    return write_spad_bundle(
        folder,
        name=ways.BASELINES,
        stages=stages,
        networks=networks,
        planes=planes_of(stages, parts),
        products={role: role for role in ROLES},
    )


@pytest.fixture
def built_in(baselines: Bundle, monkeypatch: pytest.MonkeyPatch) -> Bundle:
    monkeypatch.setattr(ways, "built_in_bundles", lambda: {ways.BASELINES: baselines.path})
    return baselines


@pytest.fixture
def quick_seconds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(seconds, "FRAMES", 1)
    monkeypatch.setattr(timing, "SHAPE", (4, 64))
    monkeypatch.setattr(timing, "FITTED", 4)
    for name, values in {"PHOTONS": (100.0,), "SBRS": (np.inf, 1.0)}.items():
        monkeypatch.setattr(timing, name, values)


def _picture_rows(bundle: Bundle, names: dict[str, FineCamera]) -> list[dict[str, Any]]:
    camera = FineCamera.of(bundle)
    found = ways_of(bundle, ("S",), names)
    return list(picture_rows(drawn_pictures(camera, 2), found, camera.grid, (None, 500.0), print))


def test_every_method_is_judged_behind_every_sampling(bundle: Bundle, built_in: Bundle) -> None:
    del built_in
    found = read_baselines(FineCamera.of(bundle))
    assert [skip.what for skip in found.skips] == ["network full_fill"]
    rows = _picture_rows(bundle, dict(found.cameras))
    methods = {(row["sampling"], row["method"], row["size"]) for row in rows}
    assert methods == {
        *(("learned", name, None) for name in ("linear", "bicubic", "srcnn", "vdsr")),
        *(
            (s, m, None)
            for s in ("low_fill", "gaussian", "full_fill")
            for m in ("linear", "bicubic")
        ),
        *((s, NET, "S") for s in ("learned", "low_fill", "gaussian", "gaussian_untrained")),
    }
    assert {row["images"] for row in rows} == {2}
    sigmas = {row["sampling"]: row["sigma"] for row in rows}
    assert sigmas["gaussian"] == SIGMA
    assert sigmas["gaussian_untrained"] == pytest.approx(1.836, abs=1e-3)
    assert sigmas["learned"] is None
    for row in rows:
        assert 5 < row["psnr_db"] < 60
        assert 0 < row["ssim"] < 1
    json.dumps(rows, allow_nan=False)


def test_a_full_pixel_is_judged_by_its_own_light_and_at_equal_counts(bundle: Bundle) -> None:
    rows = _picture_rows(bundle, {})
    full = [r for r in rows if r["sampling"] == "full_fill" and r["method"] == "linear"]
    assert [(r["photons"], r["light"]) for r in full] == [(None, 16), (500, 16), (500, 1)]
    free, own, equal = (row["psnr_db"] for row in full)
    assert free > own > equal


def test_a_network_that_is_bicubic_interpolation_scores_as_that(bundle: Bundle) -> None:
    by = {(r["sampling"], r["method"], r["photons"]): r for r in _picture_rows(bundle, {})}
    for photons in (None, 500.0):
        net, own = by["learned", NET, photons], by["learned", "bicubic", photons]
        # its borders are filled with zeros
        assert net["psnr_db"] == pytest.approx(own["psnr_db"], abs=1.5)


def test_the_same_noise_falls_on_every_method_and_another_on_every_picture(
    bundle: Bundle,
) -> None:
    camera = FineCamera.of(bundle)
    (picture,) = drawn_pictures(camera, 1)
    way = Way(sampling="learned", kernel=camera.kernel)
    first, again, other = (
        count_picture(picture, way, camera.grid, 100.0, (1, i)).planes for i in (0, 0, 1)
    )
    assert (first == again).all()
    assert (first != other).any()
    free = count_picture(picture, way, camera.grid, None, (1, 0))
    assert math.isinf(free.photons)
    assert not free.planes[1].any()


def test_pictures_of_a_folder_are_cut_to_whole_pixels(tmp_path: Path) -> None:
    values = np.zeros((21, 30, 3), np.uint8)
    values[..., 1] = 255
    assert cv2.imwrite(str(tmp_path / "green.png"), values)
    (found,) = read_pictures(tmp_path, None, SCALE)
    assert found.shape == (20, 28)
    assert found == pytest.approx(0.587, abs=1e-5)
    (tmp_path / "torn.png").write_bytes(b"no picture")
    with pytest.raises(DecodeError, match=r"torn\.png"):
        read_pictures(tmp_path, None, SCALE)
    with pytest.raises(ContractError, match="no folder"):
        read_pictures(tmp_path / "none", None, SCALE)


def test_a_bundle_is_measured_with_seconds_and_what_is_missing_is_said(
    bundle: Bundle, quick_seconds: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ways, "built_in_bundles", dict)
    told: list[str] = []
    settings = OwnSettings(images=1, sizes=("S", "L"), repeat=1)
    found = measure(bundle, settings, told.append)
    reasons = {skip.what: skip.reason for skip in found.skips}
    assert reasons == {
        "tiny-spad L": "the bundle holds S",
        f"networks of {ways.BASELINES}": "it is not built in",
    }
    times = [r for r in found.rows if r["sort"] == "timing"]
    assert [r["method"] for r in times] == 2 * list(timing.METHODS)
    assert [r["sbr"] for r in times] == 4 * [None] + 4 * [1]
    for row in times[::4]:
        assert 0.7 < row["rmse_over_crb"] < 1.3
    timed = {(r["what"], r["method"]): r for r in found.rows if r["sort"] == "seconds"}
    works = ("frame", "transient", "depth")
    assert timed.keys() == {
        ("depth_cube", "default"),
        *((what, method) for what in works for method in ("linear", "net")),
    }
    assert all(row["cpu_seconds"] > 0 for row in timed.values())
    cube = timed["depth_cube", "default"]
    assert cube["cpu_seconds"] > timed["depth", "linear"]["cpu_seconds"]
    assert 50 < cube["peak_rss_mb"] < 2000
    assert "tiny-spad: seconds of a process" in told


def test_a_size_that_is_not_there_ends_the_bench(bundle: Bundle) -> None:
    with pytest.raises(ContractError, match=r"tiny-spad holds size\(s\) S; got M"):
        measure(bundle, OwnSettings(sizes=("M",)), print)


def test_baselines_of_another_array_are_left_out(
    bundle: Bundle, tmp_path: Path, built_in: Bundle
) -> None:
    del built_in
    sensor = SpadSensor(
        extent=Extent(width_px=WIDTH, height_px=HEIGHT, pixel_pitch_um=150.0),
        time_bins=80,
        time_bin_ps=20.0,
        sub_pixels=SCALE,
        phase=PHASE - 1,
    )
    stages = bundle.manifest.stages
    optics, networks = bundle.manifest.optics, bundle.manifest.networks
    planes = planes_of(stages, Parts(sensor=sensor, optics=optics, networks=networks))
    other = write_spad_bundle(tmp_path, sensor=sensor, planes=planes)
    (skip,) = read_baselines(FineCamera.of(other)).skips
    assert "another sub-pixel" in skip.reason


def test_a_role_that_is_not_there_is_named(baselines: Bundle) -> None:
    held = "low_fill, gaussian, srcnn, vdsr"
    with pytest.raises(BundleError, match=f"no role 'full_fill'; it has {held}"):
        FineCamera.of(baselines, role="full_fill")


def test_baselines_themselves_are_not_benched(baselines: Bundle) -> None:
    with pytest.raises(ContractError, match="spad-sr-baselines sees through no plate"):
        measure(baselines, OwnSettings(), print)


def test_an_array_that_only_counts_has_no_times(
    bundle: Bundle, tmp_path: Path, quick_seconds: None
) -> None:
    sensor = SpadSensor(
        extent=Extent(width_px=WIDTH, height_px=HEIGHT, pixel_pitch_um=150.0),
        sub_pixels=SCALE,
        phase=PHASE,
    )
    stages = (Correct(), SuperResolve())
    optics, networks = bundle.manifest.optics, bundle.manifest.networks
    planes = planes_of(stages, Parts(sensor=sensor, optics=optics, networks=networks))
    products = {"image": "fine"}
    counting = write_spad_bundle(
        tmp_path, sensor=sensor, stages=stages, planes=planes, products=products
    )
    found = measure(counting, OwnSettings(images=1, quick=True, repeat=1), print)
    assert {row.get("what") for row in found.rows if row["sort"] != "picture"} == {"frame"}
    assert [skip.what for skip in found.skips][-1] == "times of flight"
