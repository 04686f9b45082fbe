"""A scene through `camkit simulate` into every type of file, and back by `camkit process`."""

import io
import json
import zipfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io

import camkit
from camkit.bundle.reader import Bundle, built_in_bundles, open_bundle
from camkit.bundle.sensor import SpadSensor
from camkit.bundle.stages import Correct, Sharpen, SuperResolve
from camkit.cli.app import run
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.files.bundle_name import named_bundle
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.golden_captures import stage_set
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.photon_twin import record, times_of
from camkit.runtime.kinds.spad.twin.recording import PhotonOptions
from camkit.runtime.kinds.spad.twin.scene import light_in_flight, light_of_depth
from camkit.runtime.kinds.spad.twin.working import GATE_WIDTH_PS, STEP_PS, WORKING_POINTS
from tests.spad_bundle import BINS, HEIGHT, SCALE, TIMES, WIDTH, write_spad_bundle

FINE = (SCALE * HEIGHT, SCALE * WIDTH)


@pytest.fixture
def scene(tmp_path: Path, camera: FineCamera) -> Path:
    path = tmp_path / "scene.npz"
    albedo = np.full(FINE, 0.8)
    np.savez(path, depth_m=stage_set(camera, 5), albedo=albedo)
    return path


def _simulate(*words: object) -> int:
    return run(["simulate", *map(str, words)])


@pytest.mark.parametrize("suffix", ["npz", "h5", "tif", "mat", "ptu"])
def test_times_come_back_from_every_type_of_file(
    scene: Path,
    bundle: Bundle,
    camera: FineCamera,
    tmp_path: Path,
    suffix: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / f"scan.{suffix}"
    words = (scene, "--bundle", bundle.path, "-o", out, "--photons", 400, "--sbr", 10, "--json")
    assert _simulate(*words) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["array"], said["shape"]) == ("histogram", [BINS, HEIGHT, WIDTH])
    chosen = {"timing": said["files"][1]} if len(said["files"]) > 1 else {}
    made = camkit.load(str(bundle.path), **chosen).make(out)
    depth = stage_set(camera, 5)
    error = np.abs(made.arrays["depth_m"] - depth)
    assert made.arrays["depth_m"].shape == FINE
    assert np.nanmedian(error) < 0.003
    assert made.record["finer"] == "net"


@pytest.mark.parametrize("suffix", ["tif", "mat", "ptu"])
def test_what_lies_beside_a_capture_is_taken_without_being_named(
    scene: Path,
    bundle: Bundle,
    camera: FineCamera,
    tmp_path: Path,
    suffix: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / f"scan.{suffix}"
    assert _simulate(scene, "--bundle", bundle.path, "-o", out, "--photons", 400) == 0
    assert named_bundle(out) == "tiny-spad"
    made = camkit.load(str(bundle.path)).make(out)
    assert np.nanmedian(np.abs(made.arrays["depth_m"] - stage_set(camera, 5))) < 0.003
    assert (made.record["timing"], made.record["orientation"]) == (f"scan.{suffix}.toml", "gate")
    assert not any("is taken as" in told for told in made.warnings)
    capsys.readouterr()
    assert run(["plan", str(out), "--bundle", str(bundle.path), "--product", "depth"]) == 0
    assert f"timing: scan.{suffix}.toml (lies beside the capture)" in capsys.readouterr().out


def test_a_bundle_goes_before_what_is_usual_of_a_type_of_file(
    scene: Path, bundle: Bundle, camera: FineCamera, tmp_path: Path
) -> None:
    """A PTU is mostly a histogram of arrivals, but the array behind the plate has a gate."""
    out = tmp_path / "scan.ptu"
    assert _simulate(scene, "--bundle", bundle.path, "-o", out, "--photons", 400) == 0
    beside = out.with_name("scan.ptu.toml")
    beside.unlink()
    made = camkit.load(str(bundle.path)).make(out)
    assert np.nanmedian(np.abs(made.arrays["depth_m"] - stage_set(camera, 5))) < 0.003
    told = " ".join(made.warnings)
    assert "scan.ptu is taken as a scan with a gate, as bundle tiny-spad states" in told
    beside.write_text('[timing]\norientation = "histogram"\n', encoding="utf-8")
    stated = camkit.load(str(bundle.path)).make(out)
    assert stated.record["orientation"] == "histogram"
    assert not any("is taken as" in told for told in stated.warnings)


def test_what_is_stated_leaves_the_rest_of_the_bundle(
    scene: Path, bundle: Bundle, camera: FineCamera, tmp_path: Path
) -> None:
    """Another laser is no other gate, and another width of bins no other beginning."""
    out, timing = tmp_path / "scan.mat", tmp_path / "t.toml"
    assert _simulate(scene, "--bundle", bundle.path, "-o", out, "--photons", 400) == 0
    text = '[array]\naxes = "yxt"\n[timing]\ntime_bin_ps = 20\n'
    timing.write_text(text + "[laser]\nfwhm_ps = 90\n", encoding="utf-8")
    made = camkit.load(str(bundle.path), timing=timing).make(out)
    told = dict(made.record["pulse"])
    assert told.pop("sigma_ps") == pytest.approx(np.hypot(42.5, 90 / 2.3548))
    assert told == {"width_ps": 200.0, "rc_ps": 60.0, "guessed": False}
    assert np.nanmedian(np.abs(made.arrays["depth_m"] - stage_set(camera, 5))) < 0.003
    (tmp_path / "irf.csv").write_text("-40 0\n0 1\n40 0\n", encoding="utf-8")
    timing.write_text(text + '[irf]\nfile = "irf.csv"\n', encoding="utf-8")
    measured = camkit.load(str(bundle.path), timing=timing).make(out)
    assert measured.record["pulse"]["measured_to_ps"] == pytest.approx(40)


@pytest.mark.parametrize("suffix", ["mat", "h5"])
def test_axes_in_another_order_are_named_where_they_would_fit(
    bundle: Bundle, tmp_path: Path, suffix: str
) -> None:
    path, cube = tmp_path / f"a.{suffix}", np.ones((HEIGHT, WIDTH, BINS), np.uint16)
    if suffix == "mat":
        scipy.io.savemat(path, {"histogram": cube})
    else:
        with h5py.File(path, "w") as file:
            file["histogram"] = cube
    with pytest.raises(ContractError, match=rf"has {BINS}x{WIDTH} pixels.*axes = \"yxt\" in a"):
        camkit.load(str(bundle.path)).make(path)
    np.savez(tmp_path / "b.npz", histogram=np.ones((BINS, 9, 9), np.uint16))
    with pytest.raises(ContractError, match=r"has 9x9 pixels.*use bundle=.none.$"):
        camkit.load(str(bundle.path)).make(tmp_path / "b.npz")


def test_a_picture_gives_counts_that_name_their_bundle(
    bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for suffix in ("npz", "h5"):
        out = tmp_path / f"counts.{suffix}"
        words = ("procedural:3", "--bundle", bundle.path, "-o", out, "--photons", 900)
        assert _simulate(*words) == 0
        assert "counts 16x24" in capsys.readouterr().out
        assert named_bundle(out) == "tiny-spad"
    made = camkit.load(str(bundle.path)).make(tmp_path / "counts.npz")
    with np.load(tmp_path / "counts.npz") as file:
        counts = file["counts"]
    assert made.arrays["intensity"].shape == FINE
    assert made.arrays["intensity"].mean() == pytest.approx(counts.mean(), rel=0.05)
    linear = camkit.load(str(bundle.path), method="linear").make(tmp_path / "counts.npz")
    assert (linear.record["finer"], made.record["size"]) == ("linear", "S")


def test_the_same_seed_gives_the_same_counts(bundle: Bundle) -> None:
    picture = np.random.default_rng(0).random((3, *FINE)).astype(np.float32)
    first, again, other = (
        record(picture, bundle, PhotonOptions(photons=50, seed=seed)).values for seed in (1, 1, 2)
    )
    assert (first == again).all()
    assert (first != other).any()
    assert first.mean() == pytest.approx(25.0, rel=0.1)


def _even_counts(folder: Path, photons: float, **changes: Any) -> np.ndarray:
    """Count even white with the array of a bundle that is changed."""
    options = PhotonOptions(photons=photons, seed=3)
    white = np.ones((3, *FINE), np.float32)
    return record(white, write_spad_bundle(folder, **changes), options).values


def test_pixels_that_see_all_of_themselves_collect_the_light_of_all_sub_pixels(
    scene: Path, tmp_path: Path
) -> None:
    stages = (Correct(), SuperResolve(sampling="full_fill"), TIMES)
    counts = _even_counts(tmp_path, 40, stages=stages)
    assert counts.mean() == pytest.approx(16 * 40, rel=0.02)
    full = write_spad_bundle(tmp_path, stages=stages)
    cube = record(scene, full, PhotonOptions(photons=20, sbr=1, seed=3)).values
    assert cube.sum(axis=0).mean() == pytest.approx(16 * 40, rel=0.02)


def test_a_diode_that_is_blind_after_a_photon_loses_counts(bundle: Bundle, tmp_path: Path) -> None:
    sensor = bundle.manifest.sensor
    half = WORKING_POINTS["intensity"].time_s * 1e12 / 5000
    blind = sensor.model_copy(update={"dead_time_ps": half})
    assert _even_counts(tmp_path, 5000, sensor=blind).mean() == pytest.approx(2500, rel=0.01)


def test_photons_are_those_counted_whatever_the_detection_efficiency(
    bundle: Bundle, tmp_path: Path
) -> None:
    poor = bundle.manifest.sensor.model_copy(update={"detection_efficiency": 0.12})
    counts, all_of_them = _even_counts(tmp_path, 900, sensor=poor), _even_counts(tmp_path, 900)
    np.testing.assert_array_equal(counts, all_of_them)


def test_light_in_flight_becomes_frames(bundle: Bundle, tmp_path: Path) -> None:
    frames = np.zeros((BINS, *FINE), np.float32)
    for t in range(BINS):
        frames[t, :, t] = 1.0
    np.savez(tmp_path / "light.npz", transient=frames)
    out = tmp_path / "flight.npz"
    words = (tmp_path / "light.npz", "--bundle", bundle.path, "-o", out, "--photons", 300)
    assert _simulate(*words) == 0
    made = camkit.load(str(bundle.path), product="transient").make(out)
    film = made.arrays["transient"]
    assert film.shape == (BINS, *FINE)
    brightest = film.sum(axis=1).argmax(axis=1)
    np.testing.assert_allclose(brightest[8:72], np.arange(8, 72), atol=2)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("-o", "x.png"), "is a file in .npz, .h5, .tif, .mat, .ptu"),
        (("-o", "x.npz", "--iso", "200"), "--iso does not apply to bundle tiny-spad"),
        (("-o", "x.npz", "--photons", "0"), "photons must be a number > 0"),
        (("-o", "x.ptu"), "a PTU holds times of photons"),
        (("-o", "x.npz", "--photons", "1e10"), "captures hold at most 16777216; take fewer"),
        (("-o", "x.npz", "--photons", "1e20"), "captures hold at most 16777216; take fewer"),
    ],
)
def test_what_cannot_be_recorded_is_said_in_one_line(
    bundle: Bundle,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _simulate("procedural:1", "--bundle", bundle.path, *words) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_photons_are_stored_one_by_one_only_where_they_are_few(
    scene: Path, bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scan.ptu"
    assert _simulate(scene, "--bundle", bundle.path, "-o", out, "--photons", 1e6) == 2
    assert "more than 50000000; write the histogram as .npz or .h5" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["scene.npz"]


def test_files_that_exist_are_kept(
    bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "c.tif"
    (tmp_path / "c.tif.toml").write_text("mine", encoding="utf-8")
    assert _simulate("procedural:1", "--bundle", bundle.path, "-o", out) == 2
    assert "c.tif.toml exists; add --overwrite" in capsys.readouterr().err
    assert _simulate("procedural:1", "--bundle", bundle.path, "-o", out, "--overwrite") == 0


def test_photons_mean_nothing_to_a_camera_of_photographs(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    words = ("procedural:1", "--bundle", "duet", "-o", tmp_path / "a.dng", "--photons", "9")
    assert _simulate(*words) == 2
    assert "--photons does not apply to bundle duet" in capsys.readouterr().err


def test_scenes_of_another_array_or_of_nothing_are_refused(bundle: Bundle, tmp_path: Path) -> None:
    options = PhotonOptions(photons=10)
    small = tmp_path / "small.npz"
    np.savez(small, depth_m=np.full((8, 8), 0.1), albedo=np.ones((8, 8)))
    with pytest.raises(ContractError, match="has 96x64 sub-pixels; got 8x8"):
        record(small, bundle, options)
    other = tmp_path / "other.npz"
    np.savez(other, depth=np.ones((8, 8)))
    with pytest.raises(ContractError, match="holds depth; a scene has depth_m and albedo"):
        record(other, bundle, options)
    (tmp_path / "broken.npz").write_bytes(b"PK\x03\x04nothing")
    with pytest.raises(DecodeError, match="cannot read the scene"):
        record(tmp_path / "broken.npz", bundle, options)


@pytest.mark.parametrize(
    "changes",
    [
        {"depth_m": np.full(FINE, "far")},
        {"albedo": np.full(FINE, 1 + 2j)},
        {"transient": np.full((BINS, 8, 8), "light")},
    ],
)
def test_scenes_of_what_is_no_number_are_refused(
    bundle: Bundle, tmp_path: Path, changes: dict[str, np.ndarray]
) -> None:
    path = tmp_path / "scene.npz"
    np.savez(path, **{"depth_m": np.ones(FINE), "albedo": np.ones(FINE), **changes})
    (name,) = changes
    with pytest.raises(DecodeError, match=rf"scene.npz: {name} holds .*; expected real numbers"):
        record(path, bundle, PhotonOptions(photons=10))


def test_a_scene_that_announces_more_than_it_holds_is_refused(
    bundle: Bundle, tmp_path: Path
) -> None:
    header = io.BytesIO()
    facts = {"descr": "<f8", "fortran_order": False, "shape": (10**7, 10**7)}
    np.lib.format.write_array_header_1_0(header, facts)
    with zipfile.ZipFile(tmp_path / "scene.npz", "w") as archive:
        archive.writestr("depth_m.npy", header.getvalue() + bytes(800))
    with pytest.raises(DecodeError, match=r"cannot read the scene .*has only \d+ bytes"):
        record(tmp_path / "scene.npz", bundle, PhotonOptions(photons=10))


def test_a_scene_beyond_the_time_axis_is_told(
    bundle: Bundle, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, depth = tmp_path / "scene.npz", np.full(FINE, 0.15)
    depth[:, : FINE[1] // 4] = 3.0
    depth[:, -FINE[1] // 2 :] = np.nan  # no surface is no part of the scene
    np.savez(path, depth_m=depth, albedo=np.ones(FINE))
    words = (path, "--bundle", bundle.path, "-o", tmp_path / "scan.npz", "--overwrite")
    assert _simulate(*words) == 0
    told = "50.0% of the scene lies outside the time axis, 80 x 20 ps (0.24 m deep)"
    assert told in capsys.readouterr().err
    assert _simulate(*words, "--json") == 0
    assert json.loads(capsys.readouterr().out)["notes"] == [told]
    np.savez(path, depth_m=np.full(FINE, 0.15), albedo=np.ones(FINE))
    assert _simulate(*words) == 0
    assert "outside" not in capsys.readouterr().err


def test_light_of_a_surface_is_its_albedo_at_its_time(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    depth = np.array([[0.10, 0.12], [np.nan, 0.14]])
    light = light_of_depth(depth, np.array([[1.0, 0.5], [1.0, 2.0]]), axis, pulse)
    np.testing.assert_allclose(light.sum(axis=0), [[1.0, 0.5], [0.0, 2.0]], rtol=1e-3)
    late = (light[:, 1, 1] * axis.centres_ps).sum() / light[:, 1, 1].sum()
    early = (light[:, 0, 0] * axis.centres_ps).sum() / light[:, 0, 0].sum()
    assert late - early == pytest.approx(0.08 / LIGHT_M_PER_PS, abs=0.5)


@pytest.mark.parametrize(
    ("depth", "albedo", "message"),
    [
        (np.ones((2, 2)), np.ones((2, 3)), "one .h, w."),
        (np.ones((2, 2)), -np.ones((2, 2)), "albedo must be finite and >= 0"),
        (-np.ones((2, 2)), np.ones((2, 2)), "depth_m must be >= 0"),
    ],
)
def test_surfaces_that_cannot_be_are_refused(
    camera: FineCamera, depth: np.ndarray, albedo: np.ndarray, message: str
) -> None:
    axis, pulse = times_of(camera)
    with pytest.raises(ContractError, match=message):
        light_of_depth(depth, albedo, axis, pulse)


def test_light_in_flight_of_other_times_is_refused() -> None:
    with pytest.raises(ContractError, match=r"with 5 frames; got \(4, 2, 2\)"):
        light_in_flight(np.ones((4, 2, 2)), 5)
    with pytest.raises(ContractError, match="finite and >= 0"):
        light_in_flight(-np.ones((5, 2, 2)), 5)


def test_the_working_points_are_those_of_the_prototype() -> None:
    assert WORKING_POINTS["high_speed"].time_s == pytest.approx(1 / 1250)
    assert WORKING_POINTS["intensity"].time_s == pytest.approx(5.2e-3)
    assert WORKING_POINTS["depth"].time_s == pytest.approx(0.078)


def test_the_shipped_array_scans_and_detects_as_the_prototype_does() -> None:
    manifest = open_bundle(built_in_bundles()["spad-sr"]).manifest
    sensor, usual = manifest.sensor, manifest.stage(Sharpen)
    assert isinstance(sensor, SpadSensor)
    assert usual is not None
    assert (sensor.time_bin_ps, usual.gate_width_ps) == (STEP_PS, GATE_WIDTH_PS) == (20, 200)
    assert sensor.detection_efficiency == 0.12
