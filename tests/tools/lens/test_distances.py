"""tools/lens/distances.py: every distance has its rows; gains are paired."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.frozen_optics import FrozenOptics
from tests.deep_bundle import write_deep_bundle
from tests.tiny_design import run_tool
from tools.lens import distances


def test_distances_have_rows_and_paired_gains(
    picture: Callable[[str], Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    deep = write_deep_bundle(tmp_path)
    asked: list[float] = []

    def traced(bundle: object, seed: int, *, depth_mm: float, **_: object) -> FrozenOptics:
        asked.append(depth_mm)
        return deep.frozen_optics

    monkeypatch.setattr(distances, "fabricated_optics", traced)
    sets = picture("a").parent
    out = tmp_path / "rows.json"
    run_tool(
        monkeypatch,
        "lens.distances",
        *(deep.path, "--before", deep.path, "--data", sets.parent, "--sets", sets.name),
        *("--per-set", 1, "--depths-m", 0.5, 1, "--out", out),
    )
    rows = json.loads(out.read_text())["captures"]
    assert len(rows) == len(distances.POSITIONS) * 2
    assert set(asked) == {500.0, 1000.0}
    assert {row["copy"] for row in rows} == set(distances.LENSES)
    assert all(row["filter untold"] == row["filter untold before"] for row in rows)
    assert any(row["filter untold"] != row["filter told"] for row in rows)
    table = capsys.readouterr().out
    assert "| M untold - M untold before | +0.00 +- nan" in table
    assert "| M untold - developed |" in table


def test_a_picture_that_is_off_by_a_tenth_has_20_db() -> None:
    sharp = np.full((3, 100, 100), 0.5, np.float32)
    assert distances._psnr_db(sharp + 0.1, sharp) == pytest.approx(20, abs=1e-3)
