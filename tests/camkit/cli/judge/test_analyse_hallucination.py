"""`camkit analyse hallucination`: JSON, crops and page; what it refuses in one line."""

import json
from pathlib import Path

import cv2
import numpy as np

from camkit.cli.exit_code import ExitCode
from camkit.scenes import procedural_scene
from tests.wide_bundle import write_wide_bundle


def test_pictures_are_judged_and_the_worst_patches_kept(tmp_path: Path, camkit_command) -> None:
    bundle = write_wide_bundle(tmp_path)
    data = tmp_path / "data"
    data.mkdir()
    levels = np.rint(255 * np.clip(procedural_scene(3, 240, 320), 0, 1)).astype(np.uint8)
    cv2.imwrite(str(data / "a.png"), levels.transpose(1, 2, 0)[..., ::-1])
    crops, page = tmp_path / "crops", tmp_path / "page.html"
    arguments = ["analyse", "hallucination", bundle.path, "--data", data, "--pictures", "1"]
    outcome = camkit_command(*arguments, "--crops", crops, "--page", page, "--json")
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    worst = told["methods"][told["control"]["method"]]["worst"]
    assert sorted(p.name for p in crops.iterdir()) == [Path(w["crop"]).name for w in worst]
    assert page.is_file()
    again = camkit_command(*arguments, "--crops", crops)
    assert again.code == ExitCode.USAGE
    assert "--overwrite" in again.err
    (crops / "worst-99.png").touch()
    (crops / "own.txt").touch()
    again = camkit_command(*arguments, "--crops", crops, "--patch-px", "128", "--overwrite")
    assert again.code == 0, again.err
    assert not (crops / "worst-99.png").exists()
    assert (crops / "own.txt").exists()


def test_bad_input_is_one_line(tmp_path: Path, camkit_command) -> None:
    bundle = write_wide_bundle(tmp_path)
    (tmp_path / "file").touch()
    (tmp_path / "few").mkdir()
    levels = np.zeros((240, 320, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "few" / "a.png"), levels)
    for arguments, words in (
        (["--data", tmp_path / "nowhere"], "nowhere"),
        (["--data", tmp_path, "--patch-px", "9"], "even side"),
        (["--data", tmp_path / "few", "--pictures", "2"], "ask for fewer"),
        (["--data", tmp_path, "--crops", tmp_path / "file", "--overwrite"], "is a file"),
        (["--data", tmp_path, "--vgg", tmp_path / "none.pth"], "none.pth"),
    ):
        outcome = camkit_command("analyse", "hallucination", bundle.path, *arguments)
        assert outcome.code != 0
        assert words in outcome.err
        assert outcome.err.count("\n") == 1
