"""Errors beside lamps of pictures whose errors are known; networks against the solve."""

import json
from pathlib import Path

import numpy as np
import pytest

from camkit.contracts import FloatArray
from tests.hdr_bundle import write_hdr_bundle
from tests.tiny_design import run_tool
from tools.hdr import residue

SIDE = 128


def _truth() -> FloatArray:
    truth = np.full((3, SIDE, SIDE), 0.2, np.float32)
    truth[:, 60:68, 60:68] = 40
    return truth


def test_a_picture_without_errors_has_none() -> None:
    beside, undershoot, rims, level_db = residue.numbers_of(_truth(), _truth())
    assert (beside, undershoot, rims) == (0, 0, 0)
    assert level_db == 120


def test_errors_are_told_where_they_are_asked_for() -> None:
    """A dark line beside a lamp counts beside it, a pink rim at its rim, what lies far nowhere."""
    ring, rim = _truth(), _truth()
    ring[:, 50, 60:68] -= 0.1
    ring[:, 10, 10] -= 5
    beside, undershoot, rims, _ = residue.numbers_of(ring, _truth())
    assert 0 < beside < 0.01
    assert undershoot == pytest.approx(0.1)
    assert rims == 0
    rim[1, 59, 60:68] = 0.05
    beside, undershoot, rims, _ = residue.numbers_of(rim, _truth())
    assert (beside, undershoot) == (0, 0)
    assert rims > 0


def test_a_scene_without_lamps_has_a_psnr_alone() -> None:
    dark = np.full((3, SIDE, SIDE), 0.2, np.float32)
    beside, undershoot, rims, level_db = residue.numbers_of(dark + np.float32(0.1), dark)
    assert np.isnan([beside, undershoot, rims]).all()
    assert level_db == pytest.approx(20 * np.log10(256 / 0.1), abs=1e-3)


def test_gains_over_the_solve_are_paired() -> None:
    def row(level_db: float) -> dict[str, float]:
        return dict.fromkeys(residue.NUMBERS, 0.1) | {"hdr_psnr_db": level_db}

    found = {
        "one": {"physics": row(40), "M": row(42), "bare lens": row(30)},
        "two": {"physics": row(60), "M": row(61), "bare lens": row(50)},
    }
    text = residue.to_text(found)
    assert "| mean | M | 0.1000 | 0.100 | 0.1000 | 51.50 |" in text
    assert "M over physics, 2 scenes: +1.50 dB, standard error 0.50, worst +1.00" in text


def test_the_command_leaves_out_what_no_exposure_fits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_hdr_bundle(tmp_path)
    monkeypatch.setattr(residue, "SIDES_PX", (SIDE, SIDE))
    record = tmp_path / "residue.json"
    words = ("--bundle", str(bundle.path), "--scenes", "night:0", "procedural:0")
    run_tool(monkeypatch, "hdr.residue", *words, "-o", record)
    told = capsys.readouterr().out
    assert "| night:0 | physics |" in told
    assert "left out: procedural:0" in told
    found = json.loads(record.read_text())
    assert set(found["scenes"]["night:0"]) == {"physics", "bare lens"}
