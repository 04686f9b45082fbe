"""The demo runs to its end: capture, plan, both pictures, and the comparison."""

import json
import sys
from pathlib import Path

import cv2
import pytest

from tests.bundle_factory import write_tiny_bundle
from tools import demo


def test_demo_leaves_capture_pictures_sidecars_and_comparison(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    bundle, out = write_tiny_bundle(tmp_path), tmp_path / "out"
    monkeypatch.setattr(sys, "argv", ["demo", "--out-dir", str(out), "--bundle", str(bundle)])
    monkeypatch.setattr(demo, "CROP_PX", 24)
    monkeypatch.setattr(demo, "BORDER_PX", 4)
    demo.main()
    assert json.loads((out / "demo.camkit.json").read_text("utf-8"))["input"]
    assert (out / "demo.dng").is_file()
    assert (out / "demo.exr").is_file()
    assert cv2.imread(str(out / "demo.png")).shape == (64, 96, 3)
    assert cv2.imread(str(out / "before_after.png")).shape == (24 * len(demo.FIELDS), 24 * 4, 3)
    said = capfd.readouterr().out
    assert "size" in said
    assert "PSNR in dB" in said
