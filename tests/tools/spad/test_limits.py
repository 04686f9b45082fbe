"""Conditions that break sharpening are found, harmless ones are not called broken."""

import json
from pathlib import Path

import numpy as np
import pytest

from tools.spad import limits
from tools.spad.limit import judged, light, pile_up, pixels, stated
from tools.spad.limit.judged import Sweep


def test_a_sweep_breaks_at_its_first_broken_point() -> None:
    points = tuple({"value": v, "broken": v > 2} for v in (1, 2, 3, 4))
    assert Sweep(name="n", unit="", points=points).breaks_at == 3
    assert Sweep(name="n", unit="", points=points[:2]).breaks_at is None


def test_points_are_broken_by_scatter_doubt_or_error() -> None:
    bounds, valid = np.full(100, 5.0), np.ones(100, bool)
    fine = np.tile([5.0, -5.0], 50)
    assert not judged.judged(1, fine, bounds, valid)["broken"]
    assert judged.judged(1, 2 * fine, bounds, valid)["broken"]
    assert judged.judged(1, fine, bounds, np.arange(100) < 40)["broken"]
    wrong = np.where(np.arange(100) < 2, 500.0, fine)
    assert judged.judged(1, wrong, bounds, valid)["broken"]


def test_conditions_are_charted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for module in (light, pile_up, pixels, stated):
        monkeypatch.setattr(module, "SHAPE", (8, 16))
    monkeypatch.setattr(light, "PHOTONS", (300, 2))
    monkeypatch.setattr(light, "SBRS", (3, 0.01))
    monkeypatch.setattr(pile_up, "CHANCES", (0.01, 0.45))
    monkeypatch.setattr(pixels, "DARK", (0.01, 1.0))
    monkeypatch.setattr(pixels, "HOT", (0.01,))
    monkeypatch.setattr(stated, "WIDTHS", (1.0,))
    monkeypatch.setattr(stated, "TIMES", (1.0,))
    monkeypatch.setattr(stated, "APART_PS", (800,))
    assert limits.main(["--out-dir", str(tmp_path)]) == 0
    record = json.loads((tmp_path / "spad-limits.json").read_text(encoding="utf-8"))
    breaks = {sweep["name"]: sweep["breaks_at"] for sweep in record["sweeps"]}
    assert breaks["photons, SBR 3"] == 2
    assert breaks["pile-up, gate scan, corrected"] is None
    assert breaks["pile-up, free running, left"] == 0.45
    assert breaks["pile-up, free running, corrected"] == 0.45
    assert breaks["orientation stated as"] == "histogram"
    assert breaks["two returns, 1000 photons"] is None
    assert (tmp_path / "spad-limits.png").stat().st_size > 1000
