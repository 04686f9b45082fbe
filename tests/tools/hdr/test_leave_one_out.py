"""Frames that were left out are predicted; a known curve is found where OpenCV's is not."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.merging.bracket_factory import scene, write_coded
from tests.runtime.merging.test_response_estimate import film_curve
from tools.hdr import leave_one_out

TIMES_S = (1.0, 0.5, 0.25, 0.125, 0.0625)


def _bracket(folder: Path, count: int) -> Path:
    folder.mkdir()
    lines = ["# name seconds"]
    for n, time_s in enumerate(TIMES_S[:count]):
        write_coded(folder / f"{n}.png", scene(96, 128) * time_s, film_curve(), seed=n)
        lines.append(f"{n}.png {time_s} ignored")
    (folder / leave_one_out.LIST).write_text("\n".join(lines) + "\n")
    return folder


def test_every_inner_frame_is_predicted_each_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = _bracket(tmp_path / "film", 5), tmp_path / "found.json"
    monkeypatch.setattr(sys, "argv", ["leave_one_out", str(folder), "-o", str(out)])
    leave_one_out.main()
    record = json.loads(out.read_text())["film"]
    monkeypatch.setattr(sys, "argv", ["leave_one_out", str(folder)])
    monkeypatch.setattr(leave_one_out, "WAYS", {"opencv": leave_one_out.by_opencv})
    leave_one_out.main()
    assert record["left_out_s"] == [0.5, 0.25, 0.125]
    assert max(record["estimate"]) < 1.5  # the noise of the frame itself is 0.4
    assert np.mean(record["estimate"]) < 0.3 * np.mean(record["srgb"])
    assert np.mean(record["estimate"]) < np.mean(record["opencv"])
    assert "| film |" in capsys.readouterr().out


def test_a_way_without_a_curve_is_none(tmp_path: Path) -> None:
    pictures, times_s = leave_one_out.read_bracket(_bracket(tmp_path / "film", 3))
    with pytest.raises(SystemExit, match="linear is no curve"):
        leave_one_out.by_camkit("linear")(pictures, times_s, 0.5)


def test_blue_borders_are_cut_off_and_no_more() -> None:
    picture = np.full((20, 30, 3), 77, dtype=np.uint8)
    other = picture.copy()
    picture[:, :4], other[-3:] = leave_one_out.BLUE, leave_one_out.BLUE
    assert [p.shape for p in leave_one_out.without_borders([picture, other])] == [(17, 26, 3)] * 2


def test_the_residual_leaves_black_and_white_out() -> None:
    picture = np.array([[[0, 10, 255]]], dtype=np.uint8)
    assert leave_one_out.residual(np.array([[[9.0, 13.0, 9.0]]]), picture) == 3.0


def test_a_bracket_of_two_leaves_nothing_to_compare(tmp_path: Path) -> None:
    folder = _bracket(tmp_path / "short", 2)
    with pytest.raises(SystemExit, match="takes 3"):
        leave_one_out.read_bracket(folder)
