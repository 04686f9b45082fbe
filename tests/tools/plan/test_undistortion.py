"""Both interpolations are timed, and what cubic loses is told."""

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
    assert set(found["cpu_s_per_mp"]) == {"lanczos", "cubic"}
    assert found["loss_db"]["pictures"] == 1
    assert abs(found["loss_db"]["mean"]) < 1
