"""`camkit process`: exit codes, what goes to stdout and stderr, what each option does."""

import io
import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.cli.exit_code import ExitCode
from camkit.runtime.output.sidecar import sidecar_path
from tests.deep_bundle import write_deep_bundle

JSON_KEYS = {
    "input",
    "output",
    "status",
    "error",
    "bundle",
    "size",
    "seconds",
    "peak_rss_mb",
    "warnings",
    "beside",
}


def _record(folder: Path, name: str = "a.exr") -> dict:
    return json.loads(sidecar_path(folder / name).read_text())


def test_a_good_run_ends_with_0_and_says_what_it_wrote(captures, camkit_command) -> None:
    outcome = camkit_command("process", "a.dng", "--bundle", "tiny.camkit", "--out-dir", "out")
    assert outcome.code == 0
    assert outcome.out.startswith("a.dng -> out/a.exr: ")
    notes = outcome.err.splitlines()  # of a tiny network; progress is for terminals
    assert [line[:10] for line in notes] == ["  note: in"]
    assert (captures / "out" / "a.exr").is_file()


def test_without_out_dir_pictures_land_in_the_current_folder(captures, camkit_command) -> None:
    assert camkit_command("process", "a.dng", "--bundle", "tiny.camkit").code == 0
    assert (captures / "a.exr").is_file()
    assert (captures / "a.camkit.json").is_file()


def test_json_is_one_object_per_file_with_the_documented_keys(captures, camkit_command) -> None:
    (captures / "broken.dng").write_bytes(b"no picture")
    outcome = camkit_command(
        "process", "*.dng", "--bundle", "tiny.camkit", "--out-dir", "out", "--json"
    )
    lines = [json.loads(line) for line in outcome.out.splitlines()]
    assert [line["status"] for line in lines] == ["ok", "ok", "failed"]
    assert all(set(line) == JSON_KEYS for line in lines)
    assert (lines[0]["bundle"], lines[0]["size"]) == ("tiny", "M")
    assert lines[0]["output"] == "out/a.exr"
    assert lines[0]["seconds"]["decode"] > 0
    assert (lines[2]["output"], lines[2]["seconds"]) == (None, {})
    assert "broken.dng" in lines[2]["error"]
    assert (outcome.code, outcome.err) == (ExitCode.INPUT_FAILED, "")


def test_a_failed_file_is_told_on_stderr(captures, camkit_command) -> None:
    outcome = camkit_command("process", "absent.dng", "a.dng", "--bundle", "none")
    assert outcome.code == ExitCode.INPUT_FAILED
    assert outcome.err.startswith("absent.dng: failed: ")
    assert outcome.out.startswith("a.dng -> a.exr")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--wb", "1,2"], "--wb"),
        (["--wb", "1,0,1"], "--wb"),
        (["--wb", "red"], "--wb"),
        (["--mosaic", "RGGB"], "--black-level"),
        (["--mosaic", "RRGB", "--black-level", "0", "--white-level", "9"], "RRGB"),
        (["--max-mem", "much"], "memory"),
        (["--max-mem", "1k"], "at least"),
        (["--assume", "nothing"], "centre, scale"),
        (["--size", "XL"], "holds size(s) M; asked for XL"),
        (["--size", "S"], "holds size"),
        (["--method", "magic"], "admm-tv"),
        (["--mode", "slow"], "exact"),
        (["--format", "bmp"], "exr"),
        (["--jpeg-quality", "90"], "leave it out for exr"),
        (["--format", "jpeg", "--jpeg-quality", "0"], "1..100"),
        (["--format", "jpeg", "--linear"], "8 bits"),
        (["--color", "srgb"], "acescg"),
        (["--demosaic", "best"], "quality"),
        (["--jobs", "0"], "jobs"),
        (["--threads", "0"], "threads"),
        (["--resume", "--overwrite"], "choose one"),
        (["--tone", "gamma"], "--tone takes srgb, linear or a file"),
        (["--halves", "_l"], "--halves takes two texts that differ"),
        (["--noise", "1e-5"], "--noise takes two numbers SHOT,READ_VARIANCE"),
        (["--noise", "0,1e-9"], "--noise takes the shot noise and the read variance"),
        (["--noise", "1e-5,0", "--iso", "100"], "--noise and --iso both say"),
        (["--iso", "0"], "iso must be a number"),
    ],
)
def test_a_wrong_option_is_refused_in_one_line_before_any_work(
    captures, camkit_command, arguments: list[str], message: str
) -> None:
    outcome = camkit_command("process", "a.dng", "--bundle", "tiny.camkit", *arguments)
    assert outcome.code == ExitCode.USAGE, outcome
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert not (captures / "a.exr").exists()


def test_a_missing_or_damaged_bundle_is_refused_with_3(captures, camkit_command) -> None:
    assert camkit_command("process", "a.dng", "--bundle", "nobody").code == 3
    (captures / "bad.camkit").write_bytes(b"no zip")
    assert camkit_command("process", "a.dng", "--bundle", "bad.camkit").code == 3


def test_nothing_matched_ends_with_4(captures, camkit_command) -> None:
    outcome = camkit_command("process", "*.nef", "--bundle", "tiny.camkit")
    assert (outcome.code, outcome.out) == (ExitCode.NOTHING_MATCHED, "")
    assert "*.nef" in outcome.err


def test_no_bundle_for_any_file_is_a_usage_error_with_the_list(captures, camkit_command) -> None:
    bare = captures / "bare.png"
    cv2.imwrite(str(bare), np.zeros((8, 8, 3), np.uint8))
    outcome = camkit_command("process", "bare.png")
    assert outcome.code == ExitCode.USAGE
    assert "bare.png" in outcome.err


def test_two_inputs_of_one_name_are_a_usage_error(captures, camkit_command) -> None:
    (captures / "more").mkdir()
    (captures / "more" / "a.dng").write_bytes((captures / "a.dng").read_bytes())
    outcome = camkit_command("process", "a.dng", "more", "--bundle", "none", "--out-dir", "out")
    assert outcome.code == ExitCode.USAGE
    assert not (captures / "out").exists()


def test_an_existing_picture_needs_overwrite_or_resume(captures, camkit_command) -> None:
    run = ("process", "a.dng", "--bundle", "tiny.camkit", "--json")
    assert camkit_command(*run).code == 0
    assert camkit_command(*run).code == ExitCode.USAGE
    assert json.loads(camkit_command(*run, "--resume").out)["status"] == "skipped"
    assert json.loads(camkit_command(*run, "--overwrite").out)["status"] == "ok"


def test_a_skipped_file_is_said_to_be_done_before(captures, camkit_command) -> None:
    run = ("process", "a.dng", "--bundle", "none", "--resume")
    camkit_command(*run)
    assert "done before" in camkit_command(*run).out


def test_dry_run_prints_the_plan_and_does_nothing(captures, camkit_command) -> None:
    before = sorted(captures.rglob("*"))
    run = ("process", "a.dng", "--bundle", "tiny.camkit", "--out-dir", "out", "--dry-run")
    outcome = camkit_command(*run)
    assert outcome.code == 0
    assert "status: planned" in outcome.out
    record = json.loads(camkit_command(*run, "--json").out)
    assert record["plan"]["tiles"]["mode"] == "exact"
    assert record["output"] == "out/a.exr"
    assert sorted(captures.rglob("*")) == before


def test_dry_run_tells_what_would_fail(captures, camkit_command) -> None:
    (captures / "c.dng").write_bytes(b"no picture")
    outcome = camkit_command("process", "*.dng", "--bundle", "tiny.camkit", "--dry-run", "--json")
    assert outcome.code == ExitCode.INPUT_FAILED
    assert [json.loads(x)["status"] for x in outcome.out.splitlines()] == [
        "planned",
        "planned",
        "failed",
    ]
    assert camkit_command("process", "a.dng", "--bundle", "nobody", "--dry-run").code == 3


def test_white_balance_gains_are_taken_relative_to_green(captures, camkit_command) -> None:
    outcome = camkit_command("process", "a.dng", "--bundle", "tiny.camkit", "--wb", "4,2,3")
    assert outcome.code == 0
    assert _record(captures)["options"]["white_balance"] == [2.0, 1.0, 1.5]


def test_options_reach_the_sidecar(captures, camkit_command) -> None:
    outcome = camkit_command(
        *("process", "a.dng", "--bundle", "tiny.camkit", "--method", "net", "--mode", "whole"),
        *("--no-vignetting", "--no-undistort", "--exposure", "-1.5", "--demosaic", "quality"),
        *("--color", "acescg", "--max-mem", "2G", "--threads", "1"),
    )
    assert outcome.code == 0, outcome.err
    record = _record(captures)
    wanted = {
        "method": "net",
        "mode": "whole",
        "vignetting": False,
        "undistort": False,
        "exposure_ev": -1.5,
        "demosaic": "quality",
        "color": "acescg",
    }
    assert record["options"].items() >= wanted.items()
    assert "undistort" not in record["seconds"]


def test_stated_noise_and_iso_reach_the_sidecar(captures, camkit_command) -> None:
    words = ("process", "a.dng", "--bundle", "tiny.camkit", "--overwrite")
    assert camkit_command(*words, "--noise", "2e-5,1e-8").code == 0
    noise = _record(captures)["plan"]["noise"]
    assert noise == {"source": "stated", "shot": [2e-5] * 3, "read_variance": [1e-8] * 3}
    assert camkit_command(*words, "--iso", "800").code == 0
    record = _record(captures)
    assert (record["plan"]["noise"]["source"], record["iso"]) == ("bundle", 800.0)


def test_halves_of_developed_pictures_become_one_by_the_curve_that_is_stated(
    captures, camkit_command
) -> None:
    for half, code in (("l", 100), ("r", 200)):
        cv2.imwrite(str(captures / f"x_{half}.png"), np.full((8, 8, 3), code, np.uint8))
    curve = "levels = [0, 100, 200, 255]\nluminance = [0.0, 0.1, 0.5, 1.0]\n"
    (captures / "maker.toml").write_text(curve)
    outcome = camkit_command(
        *("process", "x_?.png", "--bundle", "none", "--halves", "_l,_r"),
        *("--tone", "maker.toml", "--format", "tiff", "--linear"),
    )
    assert outcome.code == 0, outcome.err
    assert outcome.out.count(" -> ") == 1
    picture = cv2.imread(str(captures / "x_l.tif"), cv2.IMREAD_UNCHANGED)
    assert picture.mean() / 65535 == pytest.approx(0.3, abs=1e-4)
    record = _record(captures, "x_l.tif")
    assert record["other_half"] == "x_r.png"
    assert record["options"]["halves"] == ["_l", "_r"]
    assert record["options"]["tone"]["name"] == "maker.toml"


def test_a_headerless_mosaic_is_developed_with_its_three_options(captures, camkit_command) -> None:
    mosaic = np.random.default_rng(0).integers(25, 900, (32, 40), dtype=np.uint16)
    cv2.imwrite(str(captures / "bare.png"), mosaic)
    options = ("--mosaic", "GRBG", "--black-level", "25", "--white-level", "1023")
    outcome = camkit_command("process", "bare.png", "--bundle", "none", *options)
    assert outcome.code == 0, outcome.err
    record = _record(captures, "bare.exr")
    assert record["options"]["mosaic"]["cfa"] == "GRBG"


def test_assume_centre_takes_a_picture_of_another_size_with_a_note(
    captures, camkit_command
) -> None:
    picture = np.full((32, 48, 3), 30_000, np.uint16)
    cv2.imwrite(str(captures / "small.png"), picture)
    run = ("process", "small.png", "--bundle", "tiny.camkit")
    assert "--assume centre" in camkit_command(*run).err
    outcome = camkit_command(*run, "--assume", "centre")
    assert outcome.code == 0, outcome.err
    assert "note: assumed to be a centred crop" in outcome.err


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_on_a_terminal_progress_goes_to_stderr_and_results_stay_on_stdout(
    captures, camkit_command, monkeypatch
) -> None:
    terminal = _Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setattr("camkit.cli.progress.SILENT_S", 0.0)
    monkeypatch.setattr("camkit.cli.progress.REDRAW_S", 0.001)
    outcome = camkit_command("process", "*.dng", "--bundle", "tiny.camkit", "--json")
    assert [json.loads(line)["status"] for line in outcome.out.splitlines()] == ["ok", "ok"]
    assert "\r\x1b[Kcamkit process: making" in terminal.getvalue()
    assert terminal.getvalue().endswith("\r\x1b[K"), "nothing of it stays"
    assert "status" not in terminal.getvalue()


def test_the_depth_decides_the_kernels_and_is_in_plan_and_sidecar(
    tmp_path, monkeypatch, camkit_command
) -> None:
    monkeypatch.chdir(tmp_path)
    write_deep_bundle(tmp_path)
    bundle = ("--bundle", "deep.camkit")
    camkit_command("simulate", "procedural:3", "--size-px", "64,48", *bundle, "-o", "a.dng")
    call = ("process", "a.dng", *bundle, "--out-dir", "out")
    assert camkit_command(*call).code == 0
    mean = _record(tmp_path / "out")
    assert mean["options"]["depth_m"] is None
    assert mean["plan"]["depth"] == "mean of 0.5 m, 1 m, 2 m"
    assert "done before" in camkit_command(*call, "--resume").out
    planned = camkit_command("plan", *call[1:], "--depth-m", 0.7)
    assert "kernels: 0.7 m" in planned.out
    again = camkit_command(*call, "--resume", "--depth-m", 0.7)
    assert (again.code, "done before" in again.out) == (0, False), "another depth is other work"
    near = _record(tmp_path / "out")
    assert (near["options"]["depth_m"], near["plan"]["depth"]) == (0.7, "0.7 m")
    assert near["output_sha256"] != mean["output_sha256"]


def test_infinity_is_a_depth_and_another_than_the_bundles_is_refused(
    captures, camkit_command
) -> None:
    call = ("process", "a.dng", "--bundle", "tiny.camkit", "--out-dir", "out", "--depth-m")
    assert camkit_command(*call, "inf").code == 0
    assert _record(captures / "out")["options"]["depth_m"] == "inf"
    outcome = camkit_command(*call, 3, "--overwrite")
    assert outcome.code == ExitCode.USAGE
    assert "the one depth infinity; got 3 m" in outcome.err


def test_a_preview_lies_beside_the_picture_and_is_proved_by_the_sidecar(
    captures: Path, camkit_command
) -> None:
    call = ("process", "a.dng", "--bundle", "tiny.camkit", "--preview", "--json")
    done = camkit_command(*call)
    assert done.code == 0, done.err
    told = json.loads(done.out)
    assert told["beside"] == ["a.preview.jpg"]
    assert camkit_command(*call).code == ExitCode.USAGE, "it is not replaced without a word"
    again = json.loads(camkit_command(*call, "--resume").out)
    assert again["status"] == "skipped"
    Path("a.preview.jpg").write_bytes(b"")
    again = json.loads(camkit_command(*call, "--resume").out)
    assert again["status"] == "ok"
    assert Path("a.preview.jpg").stat().st_size > 0


@pytest.mark.parametrize(
    "options", [("--color", "acescg"), ("--format", "dng", "--out-dir", "out"), ("--format", "png")]
)
def test_every_picture_may_have_a_preview(captures: Path, camkit_command, options) -> None:
    done = camkit_command("process", "a.dng", "--bundle", "tiny.camkit", "--preview", *options)
    assert done.code == 0, done.err
    assert Path("out" if "dng" in options else "", "a.preview.jpg").is_file()


def test_products_of_single_photons_have_no_preview(captures: Path, camkit_command) -> None:
    np.savez("a.npz", counts=np.ones((8, 8), np.uint16))
    done = camkit_command("process", "a.npz", "--bundle", "none", "--preview")
    assert done.code == ExitCode.USAGE
    assert "--preview is for photographs; a.npz becomes products" in done.err


@pytest.mark.parametrize("more", [(), ("--dry-run",)])
def test_what_matches_nothing_beside_captures_is_named_once(captures, camkit_command, more) -> None:
    (captures / "hollow").mkdir()
    outcome = camkit_command(
        *("process", "a.dng", "more/*.dng", "hollow", "--bundle", "none", "--out-dir", "out"), *more
    )
    assert outcome.code == 0
    assert outcome.err.splitlines() == ["camkit: no capture matches more/*.dng, hollow"]
