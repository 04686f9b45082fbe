"""The demo runs to its end: captures, plan, pictures, and the comparison."""

import json
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.bundle_factory import write_tiny_bundle
from tools import demo


def test_demo_leaves_captures_pictures_sidecars_and_comparison(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle, out = write_tiny_bundle(tmp_path), tmp_path / "out"
    photo = tmp_path / "small.png"
    cv2.imwrite(str(photo), np.full((24, 24, 3), 90, np.uint8))
    monkeypatch.setattr(sys, "argv", ["demo", "--out-dir", str(out), "--bundle", str(bundle)])
    monkeypatch.setattr(demo, "PHOTO", photo)
    monkeypatch.setattr(demo, "CROP_PX", 24)
    monkeypatch.setattr(demo, "BORDER_PX", 4)
    demo.main()
    for name, suffix in (("confetti", "exr"), ("photo", "png")):
        assert (out / f"{name}.dng").is_file()
        assert (out / f"{name}.{suffix}").is_file()
        assert json.loads((out / f"{name}.camkit.json").read_text("utf-8"))["input"]
    assert cv2.imread(str(out / "photo.png")).shape == (24, 24, 3)
    rows = 24 * (len(demo.FIELDS) + 1)
    assert cv2.imread(str(out / "before_after.png")).shape == (rows, 24 * 4, 3)
    told = capsys.readouterr().out
    assert "distance from axis" in told
    assert told.count("half way") == 1


def test_the_photograph_is_small_and_says_whose_it_is() -> None:
    assert demo.PHOTO.stat().st_size < 1.5e6
    assert "CC0" in (demo.PHOTO.parent / "README.md").read_text("utf-8")
