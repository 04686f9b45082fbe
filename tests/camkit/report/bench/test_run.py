"""The whole bench on a tiny camera, and what it refuses before any work."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.manifest import NOT_TRAINED
from camkit.bundle.reader import Bundle
from camkit.bundle.writer import write_bundle
from camkit.cli.judge.bench import _lines
from camkit.errors import BundleError, ContractError, DecodeError
from camkit.kinds import find_kind
from camkit.report.bench import known_captures, line_up, run
from camkit.report.bench.known_captures import bench_scene, drawn_scene, picture_captures
from camkit.report.bench.metrics import hdr
from camkit.report.bench.output import write_bench
from camkit.report.bench.part import BenchPart
from camkit.report.bench.run import open_entrants, run_bench
from camkit.report.bench.settings import Settings
from camkit.report.bench.timed.capture import timed_capture
from camkit.report.bench.trial import Axes
from camkit.report.quality import Exposed, Shot, expose
from camkit.runtime.twin.saturation import saturation_of
from camkit.runtime.twin.truth import light_sensor, true_picture
from camkit.scenes.saturation import CEILING
from tests.bundle_factory import write_tiny_bundle
from tests.glare_bundle import write_glare_bundle
from tests.hdr_bundle import write_hdr_bundle
from tests.hdr_pictures import hdr_pair
from tests.psf_factory import texture
from tests.wide_bundle import write_wide_bundle


def test_a_bench_measures_seconds_and_accuracy_of_every_row(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    sharp = tmp_path / "sharp"
    sharp.mkdir()
    values = np.rint(texture(100, 120) * 255).astype(np.uint8)
    cv2.imwrite(str(sharp / "a.png"), values[::-1].transpose(1, 2, 0))
    told: list[str] = []
    result = run_bench(
        Settings(
            bundles=(str(bundle.path),),
            references=(str(_copy(bundle.path, tmp_path / "rival.camkit")),),
            axes=Axes(methods=("net",), modes=("exact",), threads=(1,)),
            repeat=1,
            data=sharp,
            work_dir=tmp_path / "work",
            gemm_s=0.01,
        ),
        told.append,
    )
    own, rival = result.report["rows"]
    assert (own["label"], rival["label"]) == ("M", "rival M")
    for row in (own, rival):
        assert row["error"] is None
        assert row["n"] == row["steady_n"] == 1
        assert (row["width"], row["height"]) == (320, 240)
        assert 0 < row["share_of_gemm_peak"] < 1
        assert (row["psf"], row["images"], row["captures"]) == ("bundle", 1, 10)
        assert row["psnr_db"] != row["input_psnr_db"]
        assert [cell["captures"] for cell in row["by_iso"]] == [5, 5]
        assert [cell["field_share"] for cell in row["by_field"]] == [0, 0.25, 0.5, 0.75, 1]
        assert len(row["by_iso_and_field"]) == 10
    assert own["psnr_db"] == rival["psnr_db"]  # the same network
    assert {(t["bundle"], t["captures"]) for t in result.report["tuning"]} == {
        ("tiny", "untrained"),
        ("rival", "untrained"),
    }
    assert len(result.patches["tiny"]) == 4
    assert result.report["machine"]["gemm_gmac_per_s"]["1"] > 0
    assert "tiny: timing M" in told


def test_seconds_stand_where_the_accuracy_cannot_be_measured(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    sharp = tmp_path / "sharp"
    sharp.mkdir()
    cv2.imwrite(str(sharp / "a.png"), np.zeros((20, 20, 3), np.uint8))
    result = run_bench(
        Settings(
            bundles=(str(bundle.path),),
            axes=Axes(methods=("net",), modes=("exact",), threads=(1,)),
            repeat=1,
            data=sharp,
            work_dir=tmp_path / "work",
            gemm_s=0.01,
        )
    )
    (row,) = result.report["rows"]
    assert row["n"] == 1
    assert row["seconds_median"] > 0
    assert row["psnr_db"] is None
    assert row["images"] == 0
    (camera,) = result.report["cameras"].values()
    assert camera["accuracy"].startswith("not measured: ")
    assert "20x20" in camera["accuracy"]
    (skip,) = (s for s in result.report["skipped"] if s["what"].startswith("accuracy of "))
    assert "20x20" in skip["reason"]
    write_bench(result, tmp_path / "out")
    assert "not measured" in (tmp_path / "out" / "bench.html").read_text(encoding="utf-8")


def test_networks_that_were_not_trained_are_timed_and_not_judged(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    idle, sharp = tmp_path / "random.camkit", tmp_path / "sharp"
    sharp.mkdir()
    values = np.rint(texture(100, 120) * 255).astype(np.uint8)
    cv2.imwrite(str(sharp / "a.png"), values[::-1].transpose(1, 2, 0))
    members = {name: bundle.member(name) for name in bundle.names}
    said = {"training_data": NOT_TRAINED}
    write_bundle(idle, bundle.manifest.model_copy(update=said), members)
    result = run_bench(
        Settings(
            bundles=(str(bundle.path),),
            references=(str(idle),),
            axes=Axes(methods=("net",), modes=("exact",), threads=(1,)),
            repeat=1,
            data=sharp,
            work_dir=tmp_path / "work",
            gemm_s=0.01,
        )
    )
    own, random = result.report["rows"]
    assert own["psnr_db"] is not None
    assert random["seconds_median"] > 0
    assert random["error"] is random["psnr_db"] is random["mtf_025"] is None
    assert random["images"] == 0
    skip = {"what": "accuracy of tiny random M", "reason": NOT_TRAINED}
    assert skip in result.report["skipped"]
    assert NOT_TRAINED in {entry["captures"] for entry in result.report["tuning"]}


def test_a_folder_without_pictures_is_an_error_before_the_timing(tmp_path: Path) -> None:
    told: list[str] = []
    settings = Settings(
        bundles=(str(write_tiny_bundle(tmp_path)),), data=tmp_path / "none", work_dir=tmp_path
    )
    with pytest.raises(ContractError, match="no folder"):
        run_bench(settings, told.append)
    assert told == []


def test_a_scene_that_is_not_finite_is_an_error_before_the_timing(tmp_path: Path) -> None:
    told: list[str] = []
    light = np.full((120, 120, 3), 0.5, np.float32)
    light[3, 4] = np.inf
    _write_light(tmp_path / "data" / "bad.exr", light)
    settings = Settings(
        bundles=(str(write_tiny_bundle(tmp_path)),), data=tmp_path / "data", work_dir=tmp_path
    )
    with pytest.raises(DecodeError, match=r"bad\.exr: 3 samples are NaN or infinite"):
        run_bench(settings, told.append)
    assert told == []


def _write_light(path: Path, light: FloatArray) -> None:
    path.parent.mkdir(exist_ok=True)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGB": np.ascontiguousarray(light)}).write(str(path))


def test_scenes_are_exposed_for_a_share_and_captures_clip_there(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    rng = np.random.default_rng(5)
    lights = np.kron(rng.random((10, 10)) ** 8, np.ones((12, 13)))  # wider than the blur
    lights += 1e-6 * rng.random(lights.shape)
    light = (lights[..., None] * np.full(3, 1e-3)).astype(np.float32)
    _write_light(tmp_path / "data" / "night.exr", light)
    path = tmp_path / "data" / "night.exr"
    plain, saturated = (bench_scene(path, bundle, share) for share in (None, 0.1))
    np.testing.assert_array_equal(plain, light.transpose(2, 0, 1))
    sensor = light_sensor(bundle.manifest)
    found = saturation_of(saturated, sensor, 1.0)
    assert found.saturated_fraction == pytest.approx(0.1, abs=1 / (120 * 130))
    known, *_ = picture_captures(bundle, path.parent, 1, tmp_path, 0.1)
    assert known.capture.max() == sensor.white_level
    dim, *_ = picture_captures(bundle, path.parent, 1, tmp_path)
    assert dim.capture.max() < 0.2 * sensor.white_level


def _expose_hdr(shot: Shot, scene: FloatArray, bundle: Bundle, lens: FrozenOptics) -> Exposed:
    """Photograph a scene as a kind does that is judged by high dynamic range."""
    exposed = expose(shot, scene, bundle, lens)
    sensor = light_sensor(bundle.manifest)
    linear = true_picture(exposed.simulation.clean, sensor)
    clipped = np.broadcast_to(exposed.simulation.samples >= sensor.white_level, linear.shape)
    bare = np.where(clipped, np.minimum(linear, 1), linear)
    extras = {"linear": linear, "clipped": clipped, "input": bare}
    return replace(exposed, extras=extras)


def test_a_camera_judged_by_high_dynamic_range_gets_its_numbers_in_every_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_wide_bundle(tmp_path)
    kind = replace(find_kind("bayer"), metrics=("picture", "hdr"))
    part = BenchPart(photograph=_expose_hdr, positions=(0,), isos=(100.0,))
    monkeypatch.setattr(line_up, "find_kind", lambda _name: kind)
    for module in (line_up, known_captures, run):
        monkeypatch.setattr(module, "find_part", lambda *_: part)
    monkeypatch.setattr(hdr, "obstacle", lambda: "not here")
    _write_light(tmp_path / "data" / "night.exr", hdr_pair(128)[1].transpose(1, 2, 0))
    settings = Settings(
        bundles=(str(bundle.path),),
        axes=Axes(methods=("net", "develop"), modes=("exact",), threads=(1,)),
        repeat=1,
        data=tmp_path / "data",
        saturate=0.2,
        constants={"nits_per_unit": 100.0},
        work_dir=tmp_path / "work",
        gemm_s=0.01,
    )
    result = run_bench(settings)
    (camera,) = result.report["cameras"].values()
    assert camera["accuracy"].endswith("1 field positions, ISO 100, 20.000% of the scene saturated")
    developed, restored = result.report["rows"]
    assert (restored["nits_per_unit"], restored["captures"]) == (100, 1)
    for row in (developed, restored):
        assert row["input_unclipped_psnr_db"] > row["unclipped_psnr_db"]  # the input has no blur
        assert row["stops_rmse_guess"] > 0
        assert row["pictures"]["night.exr"]["hdr_psnr_db"] == row["hdr_psnr_db"]
    assert developed["hdr_psnr_db"] != restored["hdr_psnr_db"] != restored["input_hdr_psnr_db"]
    files = {path.suffix: path for path in write_bench(result, tmp_path / "out")}
    assert json.loads(files[".json"].read_text(encoding="utf-8"))["rows"] == [developed, restored]
    head = files[".csv"].read_text(encoding="utf-8").splitlines()[0].split(",")
    assert {"pu21_ssim_aligned", "jod_display"} <= set(head)
    assert "pictures" not in head
    assert ">HDR dB</th>" in files[".html"].read_text(encoding="utf-8")
    assert _lines(result.report["rows"])[0].split()[5:8] == ["HDR", "dB", "stops"]


def test_a_scene_that_cannot_saturate_is_an_error_before_the_timing(tmp_path: Path) -> None:
    told: list[str] = []
    _write_light(tmp_path / "data" / "flat.exr", np.full((120, 120, 3), 0.5, np.float32))
    settings = Settings(
        bundles=(str(write_wide_bundle(tmp_path).path),),
        data=tmp_path / "data",
        saturate=0.015,
        work_dir=tmp_path,
    )
    with pytest.raises(ContractError, match=r"flat\.exr: no exposure saturates 1\.500%"):
        run_bench(settings, told.append)
    assert told == []


def test_a_share_to_saturate_needs_pictures_or_a_kind_with_scenes(tmp_path: Path) -> None:
    settings = Settings(bundles=(str(write_tiny_bundle(tmp_path)),), saturate=0.015)
    with pytest.raises(ContractError, match="give their folder as data"):
        run_bench(settings)


def test_a_kind_that_names_scenes_is_judged_on_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bundle = write_hdr_bundle(tmp_path)
    monkeypatch.setattr(hdr, "obstacle", lambda: "not here")
    told: list[str] = []
    settings = Settings(
        bundles=(str(bundle.path),),
        axes=Axes(methods=("physics",), threads=(1,)),
        repeat=1,
        images=2,
        saturate=0.02,
        work_dir=tmp_path / "work",
        gemm_s=0.01,
    )
    report = run_bench(settings, told.append).report
    (camera,) = report["cameras"].values()
    assert camera["accuracy"].startswith("scenes night:0 to night:1, 1 field positions, ISO 100")
    (row,) = report["rows"]
    assert (row["error"], row["captures"], set(row["pictures"])) == (
        None,
        2,
        {"night:0", "night:1"},
    )
    assert row["hdr_psnr_db"] != row["input_hdr_psnr_db"]
    assert any("judging night:1, 0% of the way" in line for line in told)


def test_scenes_of_a_source_fill_a_small_sensor_and_saturate_their_share(tmp_path: Path) -> None:
    bundle = write_hdr_bundle(tmp_path)
    sensor = light_sensor(bundle.manifest)
    scene = drawn_scene("night:2", bundle, 0.03)
    assert scene.shape == (3, sensor.height_px, sensor.width_px)
    found = saturation_of(scene, sensor, 1.0)
    assert found.saturated_fraction == pytest.approx(0.03, rel=0.1)
    assert found.peak <= CEILING
    with pytest.raises(ContractError, match=r"night:2: .* less than one"):
        drawn_scene("night:2", bundle, 1e-6)


def test_a_setting_that_no_metric_takes_is_refused(tmp_path: Path) -> None:
    bundle = write_wide_bundle(tmp_path)
    settings = Settings(bundles=(str(bundle.path),), constants={"nits_per_unit": 100.0})
    with pytest.raises(ContractError, match="metric that takes nits_per_unit"):
        run_bench(settings)


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"saturate": 1.0, "data": Path()}, "between 0 and 1; got 1"),
        ({"saturate": float("nan"), "data": Path()}, "between 0 and 1; got nan"),
        ({"constants": {"nits_per_unit": 0.0}}, "nits_per_unit must be > 0; got 0"),
        ({"constants": {"nits_per_unit": float("inf")}}, "nits_per_unit must be > 0; got inf"),
    ],
)
def test_settings_of_the_accuracy_are_checked(fields: dict[str, Any], words: str) -> None:
    with pytest.raises(ContractError, match=words):
        Settings(bundles=("duet",), **fields)


def _copy(source: Path, target: Path) -> Path:
    target.write_bytes(source.read_bytes())
    return target


def test_the_timed_capture_is_made_once_and_has_no_clipped_lights(tmp_path: Path) -> None:
    from camkit.runtime.raw import read_capture

    bundle = write_wide_bundle(tmp_path)
    path, size = timed_capture(bundle, None, None, tmp_path)
    assert size == (320, 240)
    written = path.stat().st_mtime_ns
    assert timed_capture(bundle, None, None, tmp_path)[0].stat().st_mtime_ns == written
    other, size = timed_capture(bundle, 160, None, tmp_path)
    assert (other != path, size) == (True, (160, 240))
    capture = read_capture(path)
    assert capture.samples.max() < capture.white_level
    with pytest.raises(ContractError, match="sensor of 320x240"):
        timed_capture(bundle, 322, None, tmp_path)


def test_a_photo_is_taken_by_the_camera_in_place_of_the_scene(tmp_path: Path) -> None:
    from camkit.runtime.raw import read_capture

    bundle = write_wide_bundle(tmp_path)
    pixels = np.zeros((250, 340, 3), np.uint8)
    pixels[:, 170:] = 200
    photo = tmp_path / "photo.png"
    cv2.imwrite(str(photo), pixels)
    path, size = timed_capture(bundle, None, None, tmp_path, photo)
    assert size == (320, 240)
    samples = read_capture(path).samples
    assert samples[:, 240:].mean() > 1.5 * samples[:, :80].mean()
    assert path != timed_capture(bundle, None, None, tmp_path)[0]
    cv2.imwrite(str(photo), pixels[:200])
    with pytest.raises(ContractError, match="at least 320x240 px; it has 340x200"):
        timed_capture(bundle, None, None, tmp_path, photo)
    with pytest.raises(ContractError, match="not both"):
        Settings(bundles=("duet",), capture=photo, photo=photo)
    with pytest.raises(ContractError, match="no photo"):
        Settings(bundles=("duet",), photo=tmp_path / "none.png")


def test_a_reference_must_be_of_one_of_the_cameras(tmp_path: Path) -> None:
    wide = write_wide_bundle(tmp_path)
    tiny = write_tiny_bundle(tmp_path)
    with pytest.raises(ContractError, match="camera of none"):
        open_entrants([str(wide.path)], [str(tiny)])


def test_two_bundles_of_one_name_are_refused(tmp_path: Path) -> None:
    wide, tiny = write_wide_bundle(tmp_path), write_tiny_bundle(tmp_path)
    with pytest.raises(ContractError, match="one name"):
        open_entrants([str(wide.path), str(tiny)], [])


def test_a_bundle_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="no bundle file"):
        open_entrants([str(tmp_path / "no.camkit")], [])


def test_nothing_to_measure_is_an_error_with_the_reasons(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    settings = Settings(
        bundles=(str(path),), axes=Axes(methods=("net",), sizes=("L",)), work_dir=tmp_path
    )
    with pytest.raises(ContractError, match="tiny L: the bundle holds M"):
        run_bench(settings)


def test_methods_that_no_bundle_has_are_answered_with_those_it_has(tmp_path: Path) -> None:
    path = write_glare_bundle(tmp_path)
    quick = Settings(bundles=(str(path),), axes=Axes(methods=("net", "wiener")), work_dir=tmp_path)
    with pytest.raises(ContractError, match=r"deglare has .*deglare.* \(--methods\)$"):
        run_bench(quick)


@pytest.mark.parametrize(
    ("changes", "instead"),
    [
        ({}, "give a capture to time with --capture FILE"),
        ({"small": True}, "give a capture to time with --capture FILE"),
        ({"data": Path("pictures")}, "leave out --data and --saturate"),
        ({"saturate": 0.015}, "leave out --data and --saturate"),
    ],
)
def test_a_bundle_without_optics_photographs_nothing(
    changes: dict[str, Any], instead: str, tmp_path: Path
) -> None:
    path = write_glare_bundle(tmp_path)
    settings = Settings(bundles=(str(path),), work_dir=tmp_path / "kept", **changes)
    with pytest.raises(ContractError, match=f"deglare states no optics, .*; {instead}"):
        run_bench(settings)
    assert list((tmp_path / "kept").glob("*")) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"bundles": ()}, "at least one bundle"),
        ({"repeat": 0}, "repeat must be >= 1"),
        ({"images": 0}, "images must be >= 1"),
        ({"width_px": 33}, "width must be even"),
        ({"capture": Path("no.dng")}, "no capture"),
    ],
)
def test_settings_that_make_no_sense_are_refused(changes: dict[str, object], words: str) -> None:
    with pytest.raises(ContractError, match=words):
        Settings(**({"bundles": ("duet",)} | changes))  # type: ignore[arg-type]


def test_the_working_folder_is_the_user_s_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("tempfile.gettempdir", lambda: str(tmp_path))
    folder = Settings(bundles=("duet",)).folder()
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o077 == 0
    assert Settings(bundles=("duet",), work_dir=tmp_path / "w").folder().is_dir()
