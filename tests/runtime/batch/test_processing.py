"""Many captures: refused before work, or each done, and nothing half-done is ever visible."""

import gc
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

import camkit
from camkit.errors import BundleError, ContractError
from camkit.runtime.batch import expand
from camkit.runtime.cancel import Cancelled
from camkit.runtime.capture import Capture, MosaicOptions
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.output.sidecar import sidecar_path
from camkit.runtime.pipeline import Pipeline
from tests.capture_factory import write_tiny_captures


@pytest.fixture
def captures(tmp_path: Path) -> Path:
    """A folder with a.dng, b.dng and tiny.camkit."""
    write_tiny_captures(tmp_path, ["a", "b"])
    return tmp_path


def _pixels(path: Path) -> np.ndarray:
    return np.asarray(OpenEXR.File(str(path)).channels()["RGB"].pixels)


def test_each_capture_gives_a_picture_and_a_sidecar(captures: Path) -> None:
    results = camkit.process(
        captures / "*.dng", bundle=captures / "tiny.camkit", out_dir=captures / "out"
    )
    assert [r.status for r in results] == ["ok", "ok"]
    for result in results:
        assert result.output is not None
        assert _pixels(result.output).shape == (64, 96, 3)
        record = json.loads(sidecar_path(result.output).read_text())
        assert record["bundle"] == "tiny"
        assert record["plan"]["tiles"]["windows"] >= 1
        assert set(record["seconds"]) >= {"decode", "wiener", "network", "write"}


def test_one_bad_file_does_not_stop_the_others(captures: Path) -> None:
    (captures / "broken.dng").write_bytes(b"not a picture")
    results = camkit.process(
        [captures / "a.dng", captures / "broken.dng", captures / "b.dng"],
        bundle=captures / "tiny.camkit",
        out_dir=captures / "out",
    )
    assert [r.status for r in results] == ["ok", "failed", "ok"]
    assert "broken.dng" in (results[1].error or "")
    assert not list((captures / "out").glob("broken*"))


def test_jobs_give_the_bits_of_one_at_a_time(captures: Path) -> None:
    for jobs in (1, 2):
        camkit.process(
            captures / "*.dng",
            bundle=captures / "tiny.camkit",
            out_dir=captures / f"out{jobs}",
            jobs=jobs,
        )
    for name in ("a.exr", "b.exr"):
        one, two = (captures / f"out{jobs}" / name for jobs in (1, 2))
        np.testing.assert_array_equal(_pixels(one), _pixels(two))


def test_what_a_file_took_is_let_go_without_the_collector(captures: Path) -> None:
    """Captures and sessions are large, and the collector, which counts objects, comes late."""

    def held() -> set[int]:
        # by type: isinstance would ask proxies for their class
        kinds = {Capture, Pipeline, NetworkEngine}
        return {id(one) for one in gc.get_objects() if type(one) in kinds}

    gc.collect()
    before = held()
    gc.disable()
    try:
        camkit.process(captures, bundle=captures / "tiny.camkit", out_dir=captures / "out")
        assert held() <= before
    finally:
        gc.enable()


def test_resume_skips_only_what_is_proved_done(captures: Path) -> None:
    def run(**choices: object) -> list[str]:
        results = camkit.process(
            captures / "*.dng",
            bundle=captures / "tiny.camkit",
            out_dir=captures / "out",
            resume=True,
            **choices,
        )
        return [r.status for r in results]

    assert run() == ["ok", "ok"]
    assert run() == ["skipped", "skipped"]
    assert run(threads=1) == ["skipped", "skipped"], "threads do not change the bits"
    with (captures / "out" / "a.exr").open("ab") as file:
        file.write(b"x")
    assert run() == ["ok", "skipped"], "a picture that was changed is made again"
    sidecar_path(captures / "out" / "b.exr").unlink()
    assert run() == ["skipped", "ok"], "a picture without a sidecar is made again"
    assert run(exposure_ev=1.0) == ["ok", "ok"], "other options are other pictures"


def test_an_existing_output_is_refused_before_any_work(captures: Path) -> None:
    out = captures / "out"
    out.mkdir()
    (out / "b.exr").write_bytes(b"precious")
    with pytest.raises(ContractError, match="resume, overwrite"):
        camkit.process(captures / "*.dng", bundle=captures / "tiny.camkit", out_dir=out)
    assert (out / "b.exr").read_bytes() == b"precious"
    assert not (out / "a.exr").exists()


def test_two_inputs_of_one_output_name_are_refused_before_any_work(captures: Path) -> None:
    (captures / "other").mkdir()
    (captures / "other" / "a.dng").write_bytes((captures / "a.dng").read_bytes())
    with pytest.raises(ContractError, match="would both give"):
        camkit.process(
            [captures / "a.dng", captures / "other" / "a.dng"],
            bundle="none",
            out_dir=captures / "out",
        )
    assert not (captures / "out").exists()


def test_folders_of_an_archive_are_kept_on_request(captures: Path) -> None:
    archive = captures / "archive"
    for folder in ("2021/may", "2022"):
        (archive / folder).mkdir(parents=True)
        (archive / folder / "a.dng").write_bytes((captures / "a.dng").read_bytes())
    out = captures / "out"
    choices = {"bundle": "none", "out_dir": out, "keep_folders": True}
    results = camkit.process(f"{archive}/**/*.dng", **choices)
    assert [r.output for r in results] == [out / "2021/may/a.exr", out / "2022/a.exr"]
    assert all(sidecar_path(r.output).is_file() for r in results if r.output)
    again = camkit.process(f"{archive}/**/*.dng", resume=True, **choices)
    assert [r.status for r in again] == ["skipped", "skipped"]
    (single,) = camkit.process(archive / "2022" / "a.dng", **(choices | {"out_dir": out / "one"}))
    assert single.output == out / "one" / "a.exr", "one folder has nothing to tell apart"


def test_a_capture_is_never_overwritten_by_its_own_picture(captures: Path) -> None:
    with pytest.raises(ContractError, match="overwrite itself"):
        camkit.process(
            captures / "a.dng", bundle="none", out_dir=captures, format="dng", overwrite=True
        )


def test_no_bundle_for_any_file_is_refused_with_the_list(tmp_path: Path) -> None:
    files = [tmp_path / "x.dng", tmp_path / "y.dng"]
    for file in files:
        file.write_bytes(b"no bundle in here")
    with pytest.raises(ContractError, match=r"x\.dng.*y\.dng.*bundle"):
        camkit.process(files, out_dir=tmp_path / "out")


def test_no_bundle_for_some_files_fails_only_those(captures: Path) -> None:
    (captures / "c.dng").write_bytes(b"no bundle in here")
    results = camkit.process(captures / "*.dng", out_dir=captures / "out")
    assert [r.status for r in results] == ["failed", "failed", "failed"]
    assert "tiny" in (results[0].error or ""), "the named bundle is not built in"
    assert "names no bundle" in (results[2].error or "")


def test_a_refused_bundle_stops_everything(captures: Path) -> None:
    bad = captures / "bad.camkit"
    bad.write_bytes(b"no zip")
    with pytest.raises(BundleError):
        camkit.process(captures / "*.dng", bundle=bad, out_dir=captures / "out")


def test_none_only_develops(captures: Path) -> None:
    (result,) = camkit.process(captures / "a.dng", bundle="none", out_dir=captures / "out")
    assert (result.status, result.bundle, result.size) == ("ok", None, None)
    assert "wiener" not in result.seconds


@pytest.mark.parametrize(("kind", "suffix"), [("tiff", "tif"), ("png", "png"), ("dng", "dng")])
def test_other_formats_are_written_and_read_back(captures: Path, kind: str, suffix: str) -> None:
    (result,) = camkit.process(
        captures / "a.dng", bundle=captures / "tiny.camkit", out_dir=captures / "out", format=kind
    )
    assert result.status == "ok", result.error
    assert result.output == captures / "out" / f"a.{suffix}"
    (again,) = camkit.process(result.output, bundle="none", out_dir=captures / "again")
    assert again.status == "ok", again.error


def test_a_headerless_mosaic_is_taken_with_its_levels(tmp_path: Path) -> None:
    import cv2

    mosaic = np.random.default_rng(0).integers(25, 900, (32, 40), dtype=np.uint16)
    cv2.imwrite(str(tmp_path / "bare.png"), mosaic)
    levels = MosaicOptions(cfa="GRBG", black_level=25.0, white_level=1023.0)
    (result,) = camkit.process(
        tmp_path / "bare.png", bundle="none", mosaic=levels, out_dir=tmp_path / "out"
    )
    assert result.status == "ok", result.error


def test_an_unknown_option_is_refused(captures: Path) -> None:
    with pytest.raises(ContractError, match=r"unknown option.*sharpness"):
        camkit.process(captures / "a.dng", bundle="none", sharpness=3)
    with pytest.raises(ContractError, match=r"formats; did you mean format\? known are"):
        camkit.process(captures / "a.dng", bundle="none", formats="png")  # type: ignore[call-arg]


def test_expand_lists_each_capture_once(captures: Path) -> None:
    named = expand([captures / "a.dng", captures, str(captures / "*.dng")])
    assert named == [captures / "a.dng", captures / "b.dng"]
    assert expand([str(captures / "*.nothing")]) == []
    assert expand([captures / "absent.dng"]) == [captures / "absent.dng"]


def test_kill_in_mid_batch_and_resume_give_the_same_and_nothing_half(tmp_path: Path) -> None:
    names = [f"shot{i}" for i in range(6)]
    bundle = write_tiny_captures(tmp_path, names)
    out = tmp_path / "out"
    code = (
        "import sys, camkit\n"
        "camkit.process(sys.argv[1], bundle=sys.argv[2], out_dir=sys.argv[3], resume=True)\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "*.dng"), str(bundle), str(out)]
    child = subprocess.Popen(command)
    deadline = time.monotonic() + 60
    while not list(out.glob("*.camkit.json")) and time.monotonic() < deadline:
        time.sleep(0.01)
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    done = {p: p.stat().st_mtime_ns for p in out.glob("*.exr") if sidecar_path(p).exists()}
    for path in out.glob("*.exr"):
        _pixels(path)
    results = camkit.process(tmp_path / "*.dng", bundle=bundle, out_dir=out, resume=True)
    assert [r.status for r in results].count("skipped") == len(done)
    assert {p: p.stat().st_mtime_ns for p in done} == done
    assert not list(out.glob("*.part"))
    whole = camkit.process(tmp_path / "*.dng", bundle=bundle, out_dir=tmp_path / "whole")
    for result in whole:
        assert result.output is not None
        np.testing.assert_array_equal(_pixels(result.output), _pixels(out / result.output.name))


def test_a_file_is_no_folder_to_write_to(captures: Path) -> None:
    with pytest.raises(ContractError, match=r"a\.dng is no folder"):
        camkit.process([captures / "b.dng"], bundle="none", out_dir=captures / "a.dng")


def test_without_its_sidecar_no_picture_appears(captures: Path) -> None:
    """A picture without proof would be in the way of the next run."""
    out = captures / "out"
    (out / "a.camkit.json").mkdir(parents=True)
    (result,) = camkit.process(
        [captures / "a.dng"], bundle=str(captures / "tiny.camkit"), out_dir=out
    )
    assert result.status == "failed"
    assert [path.name for path in out.iterdir()] == ["a.camkit.json"]


def test_cancel_ends_the_run_and_keeps_what_is_finished(captures: Path) -> None:
    done: list[Path] = []
    with pytest.raises(Cancelled):
        camkit.process(
            captures / "*.dng",
            bundle=captures / "tiny.camkit",
            out_dir=captures / "out",
            on_result=lambda result: done.append(result.input),
            cancel=lambda: bool(done),
        )
    assert [p.name for p in done] == ["a.dng"]
    assert sorted(p.name for p in (captures / "out").iterdir()) == ["a.camkit.json", "a.exr"]
