"""The comparison of depth on the fine grid, on a tiny array."""

import json
from pathlib import Path

import pytest

from tests.spad_bundle import write_spad_bundle
from tools.spad import depth


def test_every_way_is_held_against_the_truth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(depth, "LIGHTS", ((300.0, 3.0),))
    bundle = write_spad_bundle(tmp_path)
    out = tmp_path / "found" / "depth.json"
    depth.main(["--bundle", str(bundle.path), "--scenes", "2", "-o", str(out)])
    rows = {row["method"]: row for row in json.loads(out.read_text(encoding="utf-8"))["rows"]}
    assert set(rows) == {"enlarged", "linear", "S", "auto"}
    assert rows["enlarged"]["over_enlarged"] == 1.0
    assert rows["enlarged"]["sigma_68"] is None
    assert rows["linear"]["over_enlarged"] < 0.8
    assert rows["linear"]["sigma_68"] == pytest.approx(1.0, abs=0.15)
    assert rows["linear"]["valid_share"] > 0.95
