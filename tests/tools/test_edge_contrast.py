"""tools/edge_contrast.py on a tiny bundle whose lens hardly blurs: what must come out is known."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.runtime.job.reconstruction import Reconstruction
from tests.plan_factory import write_planned_bundle
from tests.tiny_design import run_tool
from tools import edge_contrast


def curves_of(row: dict[str, Any]) -> np.ndarray:
    """Give contrast (direction, place, frequency)."""
    return np.array([row["contrast"][across] for across in ("rows", "columns")])


def test_every_method_is_measured_and_a_step_twice_as_high_has_twice_the_contrast(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle = write_planned_bundle(tmp_path)
    monkeypatch.setattr(edge_contrast, "SIDE_PX", 192)
    monkeypatch.setattr(edge_contrast, "FIELD_SHARES", (0.0, 1.0))

    def measured() -> list[dict[str, Any]]:
        run_tool(monkeypatch, "edge_contrast", bundle.path, "--draws", 1, "--out-dir", tmp_path)
        found = json.loads((tmp_path / "contrast.json").read_text(encoding="utf-8"))
        return list(found["rows"])

    rows = measured()
    assert [row["method"] for row in rows] == ["wiener", *bundle.manifest.sizes]
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 2 + len(rows)
    assert (tmp_path / "contrast.png").stat().st_size > 10_000
    bank = curves_of(rows[0])
    # a lens that hardly blurs, on pixels with a mosaic: all of the large, little of the finest
    assert bank[:, :, 0] == pytest.approx(1, abs=0.02)
    assert (bank[:, :, -1] < 0.3).all()
    assert rows[0]["largest"] == pytest.approx(bank.max(), abs=1e-4)
    assert f"| {bank.max():.2f} |" in table[2]

    honest = Reconstruction.fill
    monkeypatch.setattr(Reconstruction, "fill", lambda *a, **k: 2 * honest(*a, **k))
    assert curves_of(measured()[0]) == pytest.approx(2 * bank, abs=1e-3)
