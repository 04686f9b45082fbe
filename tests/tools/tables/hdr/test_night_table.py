"""The tables of snapshot HDR: networks trained once, rows measured once, what is missing said."""

import json
import math
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
import torch
from torch import nn

from camkit.export.parts import Parts
from tests.tools.tables.hdr.night_rig import Rig, rig, write_pictures
from tools.tables import equal_training, runner
from tools.tables.equal_training import Trainee
from tools.tables.hdr import night_scenes, night_table, restoring
from tools.tables.hdr.night_table import LACKS_VGG, ROWS
from tools.tables.journal import file_digest
from tools.tables.table_rows import chosen_rows, chosen_trainings

__all__ = ["rig"]
PHYSICS = "streak-4.physics"


def measured(rig: Rig, runs: Path, out: Path, *words: Any) -> tuple[dict[str, Any], str]:
    said = rig("measure", "--runs", runs, "-o", out, "--scenes", 1, "--overwrite", *words)
    return json.loads(out.read_text(encoding="utf-8")), said


def test_rows_are_measured_once_and_the_solve_gains(rig: Rig, tmp_path: Path) -> None:
    runs, out = tmp_path / "runs", tmp_path / "tables.json"
    words = ("--data", write_pictures(tmp_path / "hdr"), "--rows", PHYSICS, "bare-lens.guess")
    record, said = measured(rig, runs, out, *words)
    journal = (runs / runner.JOURNAL).read_text(encoding="utf-8").splitlines()
    assert set(record["rows"]) == {"bare-lens.ldr", "bare-lens.guess", PHYSICS}
    assert len(journal) == 3 * sum(map(len, record["groups"].values()))
    assert record["scenes_left_out"].keys() == {"torn.exr"}
    assert str(tmp_path) not in json.dumps(record)
    (night,) = record["groups"]["night"]
    ldr, solved = (record["rows"][key] for key in ("bare-lens.ldr", PHYSICS))
    gain = solved["groups"]["night"]["gain_db"]["mean"]
    assert gain > 1
    assert gain == pytest.approx(solved["scenes"][night][0] - ldr["scenes"][night][0], abs=1e-3)
    assert ldr["groups"]["night"]["gain_db"]["mean"] == 0
    assert ldr["groups"]["night"]["unclipped_over_bare_db"]["mean"] == 0
    assert "torn.exr is left out" in said
    again, quiet = measured(rig, runs, out, *words)
    assert again == record
    assert f"{PHYSICS} on" not in quiet
    assert (runs / runner.JOURNAL).read_text(encoding="utf-8").splitlines() == journal


def test_another_solve_is_measured_again(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs, out = tmp_path / "runs", tmp_path / "tables.json"
    measured(rig, runs, out, "--rows", PHYSICS)
    monkeypatch.setattr(night_table, "_source_digest", lambda: "another")
    _, said = measured(rig, runs, out, "--rows", PHYSICS)
    assert f"{PHYSICS} on night:0" in said
    assert "bare-lens.ldr on" not in said


def test_networks_are_trained_once_and_measured(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The bundle of a network is packed once; here it is that of the solve alone."""
    packed = []

    def export(parts: Parts, out: Path) -> None:
        packed.append(parts)
        shutil.copy(tmp_path / "runs" / "cameras" / "streak-3.camkit", out)

    monkeypatch.setattr(restoring, "export_bundle", export)
    monkeypatch.setattr(restoring, "NETWORK", "physics")
    runs, out = tmp_path / "runs", tmp_path / "tables.json"
    rows = ("--rows", "streak-3.network", "streak-3.physics", "bare-lens.alone")
    train = ("train", "--out-dir", runs, "--workers", 0, *rows)
    said = rig(*train)
    assert said.count("training for 15 CPU-minutes") == 2
    folder = runs / "streak-3.network-1"
    assert not list(folder.glob(equal_training.SAMPLES))
    assert 'file = "streak-3"' in (folder / equal_training.RECIPE).read_text(encoding="utf-8")
    assert "training" not in rig(*train)
    record, _ = measured(rig, runs, out, *rows)
    assert len(packed) == 1
    assert packed[0].without_plate
    found = {key: row["scenes"]["night:0"] for key, row in record["rows"].items()}
    assert found["streak-3.network"] == found["streak-3.physics"]
    assert math.isfinite(found["bare-lens.alone"][0])
    assert record["rows"]["streak-3.network"]["trained"]["streak-3.network-1"]["steps"] == 2
    (runs / runner.JOURNAL).unlink()
    measured(rig, runs, out, "--rows", "streak-3.network")
    assert len(packed) == 1
    file_digest.cache_clear()
    with (folder / "streak-hdr_highlights_S.pt").open("ab") as file:
        file.write(b"more")
    _, said = measured(rig, runs, out, *rows)
    assert "streak-3.network-1 on night:0" in said
    assert len(packed) == 2


def test_night_scenes_that_are_too_easy_are_apart_and_their_lack_is_said(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(night_scenes, "LDR_LIMIT_DB", 1.0)
    monkeypatch.setattr(night_table, "MOST_NIGHTS", 2)
    words = (tmp_path / "runs", tmp_path / "tables.json", "--rows", "bare-lens.ldr")
    record, said = measured(rig, *words)
    assert record["groups"] == {"night_easy": ["night:0", "night:1"]}
    assert "only 0 night scenes" in said


def test_a_scene_of_which_all_clipped_has_no_unclipped_pixels(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(night_table, "_scores", lambda *_: {"hdr_psnr_db": 30.0})
    words = (tmp_path / "runs", tmp_path / "tables.json", "--rows", "bare-lens.ldr")
    record, _ = measured(rig, *words)
    found = record["rows"]["bare-lens.ldr"]["groups"]["night"]
    assert set(found) == {"hdr_psnr_db", "gain_db", "cpu_s"}


def test_rows_that_cannot_be_measured_are_named(rig: Rig, tmp_path: Path) -> None:
    rows = ("--rows", "streak-4.network", "streak-4.thesis")
    record, said = measured(rig, tmp_path / "runs", tmp_path / "tables.json", *rows)
    assert record["rows_left_out"] == {
        "streak-4.network": "not trained yet: streak-4.network-1, streak-4.network-2, "
        "streak-4.network-3",
        "streak-4.thesis": LACKS_VGG,
    }
    assert "streak-4.thesis is left out: needs weights of VGG-19" in said


def test_a_training_that_was_stopped_goes_on(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The checkpoint is there and the word that it is done is not."""
    command = ("train", "--out-dir", tmp_path / "runs", "--workers", 0, "--rows")
    rig(*command, "streak-3.network")
    (tmp_path / "runs" / "streak-3.network-1" / equal_training.DONE_FILE).unlink()
    seen = []
    monkeypatch.setattr(
        equal_training, "train", lambda path, options, **_: seen.append(options) or _stop(path)
    )
    with pytest.raises(InterruptedError):
        rig(*command, "streak-3.network")
    assert seen[0].resume
    assert seen[0].max_cpu_minutes == 15
    assert seen[0].vgg is None


def _stop(path: Path) -> None:
    raise InterruptedError(path)


def test_weights_of_vgg_go_to_the_rows_that_look_through_them(
    rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the file these rows are left out."""
    seen: list[Trainee] = []
    monkeypatch.setattr(runner, "trained", lambda one, *_: seen.append(one))
    monkeypatch.setattr(night_table, "recipe_text", lambda _: "")
    words = ("train", "--out-dir", tmp_path, "--rows", "streak-cross.thesis")
    assert f"streak-cross.thesis-1: left out: {LACKS_VGG}" in rig(*words)
    rig(*words, "--vgg", tmp_path / "vgg.pth")
    assert [(one.run.training, one.vgg) for one in seen] == [
        ("streak-cross.thesis-1", tmp_path / "vgg.pth")
    ]


def test_the_recipe_of_a_row_has_its_plate_and_its_seed(rig: Rig) -> None:
    del rig
    *_, last = chosen_trainings(ROWS, ["streak-cross.network"])
    table = tomllib.loads(night_table.recipe_text(last))
    assert (table["plate"]["file"], table["schedule"]["seed"]) == ("streak-cross", 3)


def test_another_time_than_before_is_refused(rig: Rig, tmp_path: Path) -> None:
    folder = tmp_path / "streak-3.network-1"
    folder.mkdir()
    done = {"cpu_minutes": 2.0, "cpu_s": 120.0, "steps": 9, "valid_db": 40.0}
    (folder / equal_training.DONE_FILE).write_text(json.dumps(done), encoding="utf-8")
    words = ("train", "--out-dir", tmp_path, "--rows", "streak-3.network")
    assert "9 steps, 120 CPU-s, 40.00 dB" in rig(*words, "--cpu-minutes", 2)
    with pytest.raises(SystemExit, match=r"for 2 CPU-minutes, not 15"):
        rig(*words)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--rows", "streak-5.network"), "no row 'streak-5.network'"),
        (("--scenes", "0"), "--scenes must be >= 1"),
        (("-o", "absent/t.json"), "no folder absent"),
        (("-o", "there.json"), "give --overwrite"),
    ],
)
def test_a_wrong_call_is_one_line(
    rig: Rig,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    words: tuple[str, ...],
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("there.json").touch()
    with pytest.raises(SystemExit, match=message):
        rig("measure", "--runs", "runs", "-o", "t.json", *words)
    assert not Path("t.json").exists()


def test_a_frame_of_any_size_passes_a_network() -> None:
    class Halved(nn.Module):
        stride_px = 8

        def forward(self, planes: torch.Tensor) -> torch.Tensor:
            assert not planes.shape[-1] % 8
            assert not planes.shape[-2] % 8
            return planes / 2

    planes = torch.rand(1, 3, 21, 40)
    assert torch.equal(restoring.whole_frame(Halved(), planes), planes / 2)


def test_rows_are_those_of_the_issue_and_each_has_its_folder() -> None:
    names = [run.name for row in ROWS for run in row.runs]
    assert len(set(names)) == len(names)
    assert sum(len(row.runs) for row in ROWS if row.recipe) == 13
    assert {row.key for row in ROWS if len(row.seeds) == 3} == {
        "streak-cross.network",
        "streak-4.network",
    }
    assert chosen_rows(ROWS, None) == ROWS
