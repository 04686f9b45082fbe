"""Every way of undistortion is timed, and what it loses and rings is told."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.scenes import procedural_scene
from tests.bundle_factory import write_tiny_bundle
from tools.plan import undistortion


def test_seconds_and_losses_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(undistortion, "BORDER_PX", 4)
    bundle = write_tiny_bundle(tmp_path)
    (tmp_path / "in").mkdir()
    scene = np.clip(procedural_scene(3, 96, 128), 0, 1)
    picture = (255 * scene.transpose(1, 2, 0)).astype(np.uint8)
    cv2.imwrite(str(tmp_path / "in" / "a.png"), picture)
    out = tmp_path / "found" / "undistortion.json"
    words = ["--bundle", str(bundle), "--data", str(tmp_path / "in"), "--size", "M"]
    undistortion.main([*words, "--repeat", "1", "-o", str(out)])
    found = json.loads(out.read_text(encoding="utf-8"))
    ways = {"lanczos", "cubic", "cubic_limited"}
    assert set(found["cpu_s_per_mp"]) == set(found["night_cpu_s_per_mp"]) == ways
    assert found["loss_db"]["lanczos"] == {"mean": 0, "most": 0, "pictures": 1}
    for way in ("cubic", "cubic_limited"):
        assert found["loss_db"][way]["pictures"] == 1
        assert abs(found["loss_db"][way]["mean"]) < 1
    for night in found["rings"].values():
        assert night["cubic_limited"]["darkest"] >= night["cubic"]["darkest"]
