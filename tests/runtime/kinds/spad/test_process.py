"""Captures of single photons by the ordinary commands: products, sidecar, refusals."""

import json
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import h5py
import numpy as np
import pytest
import scipy.io
import tifffile

import camkit
from camkit.cli.app import run
from camkit.errors import ContractError, DecodeError
from camkit.runtime.kinds.spad.pulse import GatedPulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from tests import spad_bundle
from tests.data_folder import data_path
from tests.spad_files import WRITERS, small_cube, write_cells5, write_sdt_zip

HEIGHT, WIDTH = 12, 16
TIMING = """
[timing]
orientation = "gate"
time_bin_ps = 20
[gate]
width_ps = 200
rc_ps = 60
jitter_ps = 42.5
[array]
pitch_um = 150
focal_length_mm = 10
"""
Draw = Callable[..., np.ndarray]


def _times() -> np.ndarray:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    return np.asarray(900.0 + 20 * y + 10 * x)


@pytest.fixture
def scan(tmp_path: Path, axis: TimeAxis, draw: Draw) -> Path:
    counts = draw(axis, _times().ravel(), 300, 0.1).reshape(HEIGHT, WIDTH, axis.bins)
    counts[3, 4] = 0
    path = tmp_path / "in" / "scan.npz"
    path.parent.mkdir()
    np.savez(path, histogram=counts.transpose(2, 0, 1).astype(np.uint16))
    return path


@pytest.fixture
def timing(tmp_path: Path) -> Path:
    path = tmp_path / "t.toml"
    path.write_text(TIMING, encoding="utf-8")
    return path


def _command(*arguments: object) -> int:
    return run([str(argument) for argument in arguments])


def test_a_scan_becomes_depth_points_and_preview(
    scan: Path, timing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    made = _command(
        *("process", scan, "--bundle", "none", "--timing", timing, "--out-dir", out),
        *("--format", "tiff", "--json"),
    )
    assert made == 0
    record = json.loads(capsys.readouterr().out)
    assert record["output"] == str(out / "scan.npz")
    assert [Path(name).suffix for name in record["beside"]] == [".ply", ".png", ".tif"]
    assert record["warnings"] == []
    found = np.load(out / "scan.npz", allow_pickle=False)
    assert {name: str(found[name].dtype) for name in found} == {
        **dict.fromkeys(("depth_m", "time_of_flight_ps"), "float64"),
        **dict.fromkeys(
            ("amplitude", "background", "sigma_ps", "evidence", "intensity"), "float32"
        ),
        "valid": "bool",
        "pooled": "uint8",
    }
    assert {found[name].shape for name in found} == {(HEIGHT, WIDTH)}
    np.testing.assert_array_equal(np.isnan(found["depth_m"]), ~found["valid"])
    for name in found:
        if name != "depth_m":
            assert np.isfinite(found[name]).all()
    sound = found["valid"]
    assert sound.mean() > 0.98
    errors = (found["time_of_flight_ps"] - _times())[sound]
    assert np.abs(errors).max() < 60
    # light goes there and back
    expected = 299792458 * found["time_of_flight_ps"][sound] * 1e-12 / 2
    np.testing.assert_allclose(found["depth_m"][sound], expected)
    np.testing.assert_array_equal(tifffile.imread(out / "scan.tif")[sound].shape, expected.shape)
    assert cv2.imread(str(out / "scan.png")).shape == (16 * HEIGHT, 16 * WIDTH, 3)
    assert (out / "scan.ply").read_bytes().startswith(b"ply\nformat binary_little_endian 1.0\n")
    sidecar = json.loads((out / "scan.camkit.json").read_text(encoding="utf-8"))
    assert sidecar["plan"]["product"] == "depth"
    assert sidecar["plan"]["pulse"] == {
        "width_ps": 200.0,
        "rc_ps": 60.0,
        "sigma_ps": 42.5,
        "guessed": False,
    }
    assert sidecar["spad"]["valid"] == [int(sound.sum())]
    assert set(sidecar["beside_sha256"]) == {".ply", ".png", ".tif"}


def test_products_are_not_streamed_but_refused_by_name(scan: Path, timing: Path) -> None:
    pipeline = camkit.load(None, kind="spad", timing=timing)
    with pytest.raises(camkit.ContractError, match="whole products, not bands of a picture: use"):
        pipeline.stream(scan, lambda *_: None)


def test_photons_are_those_of_the_capture_on_a_finer_grid_too(tmp_path: Path) -> None:
    counts = np.random.default_rng(3).poisson(20, (spad_bundle.HEIGHT, spad_bundle.WIDTH))
    np.savez(tmp_path / "counts.npz", counts=counts.astype(np.uint16))
    bundle = spad_bundle.write_spad_bundle(tmp_path)
    result = camkit.load(bundle.path, method="linear").run(tmp_path / "counts.npz")
    assert result.arrays["intensity"].shape == (4 * counts.shape[0], 4 * counts.shape[1])
    assert result.sections["spad"]["photons"] == pytest.approx(counts.sum(), rel=0.2)


def test_from_python_nothing_is_written(scan: Path, timing: Path, tmp_path: Path) -> None:
    pipeline = camkit.load(None, kind="spad", timing=timing, returns="2", method="lsq")
    made = pickle.loads(pickle.dumps(pipeline)).make(scan)
    assert made.arrays["depth_m"].shape == (2, HEIGHT, WIDTH)
    assert made.arrays["valid"][1].mean() < 0.03
    assert sorted(path.name for path in tmp_path.iterdir()) == ["in", "t.toml"]
    again = pipeline.make(scan)
    np.testing.assert_array_equal(again.arrays["depth_m"], made.arrays["depth_m"])


def test_other_products_of_a_scan(scan: Path, timing: Path, tmp_path: Path) -> None:
    cube = np.load(scan)["histogram"]
    for product, format_ in (("intensity", "exr"), ("transient", "tiff")):
        (result,) = camkit.process(
            *(scan,),
            bundle="none",
            out_dir=tmp_path / product,
            timing=timing,
            product=product,
            format=format_,
        )
        assert result.status == "ok", result.error
    found = np.load(tmp_path / "intensity" / "scan.npz")
    assert found.files == ["intensity"]
    np.testing.assert_array_equal(found["intensity"], cube.sum(axis=0))
    found = np.load(tmp_path / "transient" / "scan.npz")
    np.testing.assert_array_equal(found["transient"], cube)
    np.testing.assert_array_equal(found["time_ps"], np.arange(len(cube)) * 20.0)
    np.testing.assert_array_equal(tifffile.imread(tmp_path / "transient" / "scan.tif"), cube)
    film = cv2.VideoCapture(str(tmp_path / "transient" / "scan.mp4"))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == len(cube)


def test_counts_become_pictures_and_films(tmp_path: Path) -> None:
    frames = np.random.default_rng(0).poisson(20, (7, 8, 10)).astype(np.uint16)
    hot = np.zeros((8, 10), bool)
    hot[2, 3] = True
    frames[:, 2, 3] = 5000
    np.save(tmp_path / "hot.npy", hot)
    (tmp_path / "t.toml").write_text("[correction]\nhot = 'hot.npy'\ndark = 2\n", encoding="utf-8")
    np.savez(tmp_path / "one.npz", counts=frames[0])
    np.savez(tmp_path / "many.npz", counts=frames)
    results = camkit.process(
        [tmp_path / "one.npz", tmp_path / "many.npz"],
        bundle="none",
        out_dir=tmp_path / "out",
        timing=tmp_path / "t.toml",
    )
    assert [r.status for r in results] == ["ok", "ok"]
    assert [[p.suffix for p in r.beside] for r in results] == [[".png"], [".png", ".mp4"]]
    one = np.load(tmp_path / "out" / "one.npz")["intensity"]
    many = np.load(tmp_path / "out" / "many.npz")["frames"]
    np.testing.assert_array_equal(many[:, ~hot], frames[:, ~hot] - 2.0)
    np.testing.assert_array_equal(one, many[0])
    around = frames[0, 1:4, 2:5].sum() - 5000.0
    assert one[2, 3] == pytest.approx(around / 8 - 2)


@pytest.mark.parametrize("name", WRITERS)
def test_every_type_of_file_is_a_capture(name: str, tmp_path: Path) -> None:
    source = tmp_path / "in" / name
    source.parent.mkdir()
    WRITERS[name](source, small_cube())
    axes = "axes = 'yxt'\n" if name.endswith(".mat") else ""
    (tmp_path / "t.toml").write_text(
        f"[timing]\norientation = 'histogram'\ntime_bin_ps = 20\n[array]\n{axes}"
        "[laser]\nfwhm_ps = 100\n",
        encoding="utf-8",
    )
    (result,) = camkit.process(
        *(source.parent,), bundle="none", out_dir=tmp_path / "out", timing=tmp_path / "t.toml"
    )
    assert result.status == "ok", result.error
    assert result.output == tmp_path / "out" / (name.split(".", maxsplit=1)[0] + ".npz")
    found = np.load(result.output)
    assert np.nanmedian(found["time_of_flight_ps"]) == pytest.approx(400, abs=8)


def test_whole_floats_of_every_type_of_file_are_cycles(tmp_path: Path) -> None:
    stated = {"orientation": "gate", "time_bin_ps": 20.0, "cycles": 78_000.0, "fwhm_ps": 100.0}
    np.savez(tmp_path / "a.npz", histogram=small_cube(), **stated)
    scipy.io.savemat(tmp_path / "b.mat", {"histogram": small_cube(), **stated})
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file.create_dataset("histogram", data=small_cube()).attrs.update(stated)
    pipeline = camkit.load(None, kind="spad")
    for name in ("a.npz", "b.mat", "c.h5"):
        (told,) = [d for d in pipeline.plan(tmp_path / name)["decisions"] if d["what"] == "pile-up"]
        assert told["reason"] == "78000 cycles are stated"


def test_time_stamps_that_lie_outside_are_told(tmp_path: Path) -> None:
    write_cells5(tmp_path / "a.mat", small_cube())
    (tmp_path / "t.toml").write_text(
        "[timing]\ntime_bin_ps = 8\nbins = 30\nfirst_ps = 80\n[array]\nstamp_ps = 8\n",
        encoding="utf-8",
    )
    (result,) = camkit.process(
        tmp_path / "a.mat", bundle="none", out_dir=tmp_path, timing=tmp_path / "t.toml"
    )
    assert result.status == "ok", result.error
    lost = int(small_cube()[:10].sum())
    assert any(f"{lost} time stamps lie outside" in told for told in result.warnings)
    assert any("no pulse is stated: a Gaussian of" in told for told in result.warnings)
    assert any("state [array] pitch_um" in told for told in result.warnings)


def test_pile_up_is_undone_before_the_fit(tmp_path: Path, axis: TimeAxis, draw: Draw) -> None:
    cycles, true = 2000, np.full(64, 1200.0)
    bins = np.broadcast_to(np.arange(axis.bins), (64, axis.bins))
    gate = GatedPulse(width_ps=200, rc_ps=60, sigma_ps=42.5)
    mean = 20_000 * axis.shares(gate, true, bins) + 2
    seen = np.random.default_rng(0).binomial(cycles, 1 - np.exp(-mean / cycles))
    np.savez(tmp_path / "a.npz", histogram=seen.T.reshape(-1, 8, 8))
    found = {}
    for text in ("", f"cycles = {cycles}\n"):
        path = tmp_path / "t.toml"
        path.write_text(TIMING.replace("time_bin_ps", f"{text}time_bin_ps"), encoding="utf-8")
        made = camkit.load(None, kind="spad", timing=path).make(tmp_path / "a.npz")
        found[text] = np.median(made.arrays["amplitude"])
        assert made.sections["spad"]["pile_up"] == (
            0 if not text else pytest.approx(0.61, abs=0.03)
        )
    assert found[""] < 19_000
    assert found[f"cycles = {cycles}\n"] == pytest.approx(20_000, rel=0.02)
    path.write_text(TIMING.replace("time_bin_ps", "cycles = 100\ntime_bin_ps"), encoding="utf-8")
    with pytest.raises(ContractError, match=r"above the 100 cycles in which they can have come"):
        camkit.load(None, kind="spad", timing=path).make(tmp_path / "a.npz")


def test_saturated_pixels_are_bright_and_told(tmp_path: Path) -> None:
    counts = np.full((1, 8, 8), 50, np.uint16)
    counts[0, 3, 4] = 100
    np.savez(tmp_path / "a.npz", counts=counts)
    timing = tmp_path / "t.toml"
    timing.write_text(TIMING.replace("time_bin_ps", "cycles = 100\ntime_bin_ps"), encoding="utf-8")
    made = camkit.load(None, kind="spad", timing=timing).make(tmp_path / "a.npz")
    assert made.arrays["intensity"].argmax() == 3 * 8 + 4
    assert any("too strong to correct in 1 pixels" in told for told in made.warnings)


def test_a_change_of_the_timing_file_is_a_new_product(
    scan: Path, timing: Path, tmp_path: Path
) -> None:
    np.save(tmp_path / "dark.npy", np.zeros((HEIGHT, WIDTH)))
    timing.write_text(TIMING + "[correction]\ndark = 'dark.npy'\n", encoding="utf-8")

    def status() -> str:
        (result,) = camkit.process(
            scan, bundle="none", out_dir=tmp_path / "out", timing=timing, resume=True
        )
        assert result.error is None
        return result.status

    assert [status(), status()] == ["ok", "skipped"]
    np.save(tmp_path / "dark.npy", np.full((HEIGHT, WIDTH), 0.05))
    assert [status(), status()] == ["ok", "skipped"]


def test_a_change_of_the_timing_file_beside_is_a_new_product(scan: Path, tmp_path: Path) -> None:
    beside = scan.with_name("scan.npz.toml")
    found = []
    for first_ps in (0, 0, 100):
        text = TIMING.replace("time_bin_ps", f"first_ps = {first_ps}\ntime_bin_ps")
        beside.write_text(text, encoding="utf-8")
        (result,) = camkit.process(scan, bundle="none", out_dir=tmp_path / "out", resume=True)
        assert result.error is None
        found.append(result.status)
    assert found == ["ok", "skipped", "ok"]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--product", "intensity", "--pool", "3"], "--pool does not apply to the product"),
        (["--product", "transient", "--method", "lsq"], "--method does not apply to the product"),
        (["--returns", "3"], "returns must be one of 1, 2; got '3'"),
        (["--method", "wiener"], "method must be one of log, lsq"),
        (["--format", "png"], "--format must be one of exr, tiff for such captures"),
        (["--wb", "1,1,1"], "--wb does not apply to captures of the kind spad"),
    ],
)
def test_what_means_nothing_is_refused(
    options: list[str],
    told: str,
    scan: Path,
    timing: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    code = _command(
        "process", scan, "--bundle", "none", "--timing", timing, "--out-dir", out, *options
    )
    assert code in {1, 2}
    assert told in " ".join(capsys.readouterr().err.split())
    assert not (out / "scan.npz").exists()


def test_counts_have_no_depth(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", counts=np.ones((4, 4)))
    with pytest.raises(ContractError, match=r"this capture holds counts alone; use product=.int"):
        camkit.load(None, kind="spad", product="depth").make(tmp_path / "a.npz")


def test_a_bad_file_stops_no_other(scan: Path, timing: Path, tmp_path: Path) -> None:
    bad = scan.with_name("bad.npz")
    bad.write_bytes(scan.read_bytes()[:3000])
    results = camkit.process([bad, scan], bundle="none", out_dir=tmp_path / "out", timing=timing)
    assert [r.status for r in results] == ["failed", "ok"]
    assert "bad.npz is damaged, or no zip" in str(results[0].error)
    with pytest.raises(DecodeError):
        camkit.load(None, kind="spad", timing=timing).make(bad)


def test_a_tiff_is_a_picture_unless_an_option_says_otherwise(tmp_path: Path, timing: Path) -> None:
    stack = tmp_path / "in" / "stack.tif"
    stack.parent.mkdir()
    tifffile.imwrite(stack, small_cube(), photometric="minisblack")
    plain = camkit.process(stack, bundle="none", out_dir=tmp_path / "a")
    assert plain[0].status == "failed" or plain[0].output == tmp_path / "a" / "stack.exr"
    told = camkit.process(
        stack, bundle="none", out_dir=tmp_path / "b", product="intensity", timing=timing
    )
    assert told[0].output == tmp_path / "b" / "stack.npz"
    single = tmp_path / "in" / "single.tif"
    tifffile.imwrite(single, small_cube()[0])
    (grey,) = camkit.process(single, bundle="none", out_dir=tmp_path / "a")
    assert 'if it counts single photons, add product="intensity"' in " ".join(grey.warnings)


def test_the_plan_says_what_would_be_done(
    scan: Path, timing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    common = ("plan", scan, "--bundle", "none", "--out-dir", tmp_path / "out")
    assert _command(*common, "--timing", timing, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert told["plan"]["bins"] == 125
    assert told["plan"]["time_bin_ps"] == 20
    assert _command(*common, "--timing", timing, "--product", "transient") == 0
    assert "product: transient (asked)" in capsys.readouterr().out
    assert _command(*common) == 1
    assert "nothing says whether times are those of a gate or of a histogram" in " ".join(
        capsys.readouterr().out.split()
    )
    assert not (tmp_path / "out").exists()


def test_info_says_what_a_capture_holds_and_states(
    scan: Path, timing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _command("info", scan) == 0
    told = capsys.readouterr().out
    assert "kind: spad\nholds: histogram\nwidth: 16\nheight: 12\nbins: 125\naxes: tyx\n" in told
    np.savez(tmp_path / "a.npz", counts=np.ones((3, 4, 5)), bin_edges_ps=np.arange(9.0), bundle="b")
    (tmp_path / "a.npz.toml").write_text("[array]\naxes = 'xyt'\n", encoding="utf-8")
    assert _command("info", tmp_path / "a.npz", "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["holds"], facts["frames"], facts["axes"]) == ("counts", 5, "xyt")
    assert facts["stated"] == {"bin_edges_ps": "9 values, 0.0 to 8.0"}
    assert (facts["timing"], facts["bundle_named"]) == ("a.npz.toml", "b")
    (tmp_path / "bad.npz").write_bytes(b"PK")
    assert _command("info", tmp_path / "bad.npz") == 1
    assert "bad.npz is damaged, or no zip" in " ".join(capsys.readouterr().err.split())


def test_a_plan_of_a_capture_in_this_folder_is_told(
    scan: Path, timing: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It writes nothing, so it overwrites nothing; process would."""
    monkeypatch.chdir(scan.parent)
    words = (scan.name, "--bundle", "none", "--timing", timing)
    for command in (("plan", *words), ("process", *words, "--dry-run")):
        assert _command(*command) == 0
        told = capsys.readouterr().out
        assert "product: depth" in told
        assert "note: process would refuse to overwrite the capture itself" in told
    assert _command("process", *words) == 2
    assert "scan.npz would overwrite itself" in " ".join(capsys.readouterr().err.split())
    assert [path.name for path in scan.parent.iterdir()] == ["scan.npz"]


def test_a_capture_without_times_takes_those_of_its_bundle_and_is_told(tmp_path: Path) -> None:
    shape = (spad_bundle.HEIGHT, spad_bundle.WIDTH)
    bundle = str(spad_bundle.write_spad_bundle(tmp_path).path)
    path = tmp_path / "a.npz"

    def notes(bins: int, **stated: Any) -> str:
        counts = np.random.default_rng(0).poisson(9, (bins, *shape)).astype(np.uint16)
        np.savez(path, histogram=counts, **stated)
        return " | ".join(camkit.load(bundle, method="linear").make(path).warnings)

    with pytest.raises(ContractError, match=r"has 100 time bins and states no times; .* has 80 of"):
        notes(100)
    assert "those of bundle" not in notes(100, time_bin_ps=16, fwhm_ps=70)
    borrowed = "of bundle tiny-spad; the capture states none"
    assert f"times and pulse are those {borrowed}" in notes(80)
    assert f"times are those {borrowed}" in notes(80, fwhm_ps=70)
    assert f"the pulse is that {borrowed}" in notes(80, time_bin_ps=20)


def test_a_stated_histogram_has_no_gate_of_its_bundle(tmp_path: Path) -> None:
    """Else its times would be those of the gate, all too early by half its width."""
    shape = (spad_bundle.HEIGHT, spad_bundle.WIDTH)
    bundle = str(spad_bundle.write_spad_bundle(tmp_path).path)
    path, rng = tmp_path / "a.npz", np.random.default_rng(0)
    sigma_ps = np.hypot(42.5, 70 / 2.3548)
    stamps = rng.normal(800, sigma_ps, (400, *shape))
    counts = np.stack([(np.round(stamps / 20) == t).sum(axis=0) for t in range(spad_bundle.BINS)])
    stated = {"orientation": "histogram", "time_bin_ps": 20, "fwhm_ps": 70}
    np.savez(path, histogram=counts.astype(np.uint16), **stated)
    made = camkit.load(bundle, method="linear").make(path)
    assert np.median(made.arrays["time_of_flight_ps"]) == pytest.approx(800, abs=3)
    assert made.record["pulse"] == {
        "fwhm_ps": pytest.approx(sigma_ps * 2.3548, abs=0.01),
        "guessed": False,
    }
    assert any("the gate of bundle tiny-spad is left out" in told for told in made.warnings)
    np.savez(path, histogram=counts.astype(np.uint16), width_ps=200, **stated)
    stated_gate = camkit.load(bundle, method="linear").make(path)
    assert stated_gate.record["pulse"]["width_ps"] == 200
    assert not any("left out" in told for told in stated_gate.warnings)


@pytest.mark.parametrize(("pool", "is_told"), [("auto", False), ("1", False), ("5", True)])
def test_squares_asked_for_are_told_to_be_flat(
    scan: Path, timing: Path, pool: str, *, is_told: bool
) -> None:
    made = camkit.load(None, kind="spad", timing=timing, pool=pool).make(scan)
    assert is_told == any("a square is taken as one distance" in told for told in made.warnings)


def test_a_last_axis_that_looks_like_time_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stated = {"orientation": "histogram", "time_bin_ps": 20, "fwhm_ps": 100}
    path, beside = tmp_path / "a.npz", tmp_path / "a.npz.toml"
    cube = np.tile(small_cube()[:, :1, :1], (1, 9, 11))
    bins, height, width = cube.shape
    words = ("process", path, "--bundle", "none", "--overwrite", "--out-dir", tmp_path / "out")
    hint = f"taken as {height} time bins of {bins}x{width} pixels; if its last axis is time, state"
    for axes, counts in (("tyx", cube), ("yxt", cube.transpose(1, 2, 0))):
        np.savez(path, histogram=counts, **stated)
        beside.write_text(f'[array]\naxes = "{axes}"\n', encoding="utf-8")
        assert _command(*words) == 0
        told = capsys.readouterr()
        assert f"a.npz: {bins} bins, {width}x{height} pixels, " in told.out
        assert hint not in told.err
        beside.unlink()
        assert _command(*words) == 0
        assert (hint in " ".join(capsys.readouterr().err.split())) == (axes == "yxt")


def test_zipped_histograms_are_named_without_their_type(tmp_path: Path) -> None:
    write_sdt_zip(tmp_path / "cells.sdt.zip", small_cube())
    (result,) = camkit.process(
        tmp_path / "cells.sdt.zip", bundle="none", out_dir=tmp_path, product="intensity"
    )
    assert result.output == tmp_path / "cells.npz"


def _made(name: str, folder: Path, toml: str, **choices: Any) -> Any:
    path = folder / "t.toml"
    path.write_text(toml, encoding="utf-8")
    return camkit.load(None, kind="spad", timing=path, **choices).make(data_path(f"spad/{name}"))


def test_the_tower_is_sharp_from_few_photons(tmp_path: Path) -> None:
    made = _made(
        "tower_9.8km.mat",
        tmp_path,
        '[timing]\norientation = "histogram"\ntime_bin_ps = 200\nfirst_ps = 5180100\nbins = 1000\n'
        '[laser]\nfwhm_ps = 1000\n[array]\nkey = "data_processed"\n',
    )
    valid = made.arrays["valid"]
    assert 0.2 < valid.mean() < 0.4
    assert valid[:100, :50].mean() < 2e-3  # sky
    depth = made.arrays["depth_m"][valid]
    # the tower is some ten metres deep, at 780 m modulo the laser's cycle
    assert np.percentile(depth, 99) - np.percentile(depth, 1) < 8
    assert made.sections["spad"]["hot"] == []
