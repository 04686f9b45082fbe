"""The demo runs to its end: captures, plan, pictures, and the comparison."""

import json
import re
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.bundle_factory import write_tiny_bundle
from tools import demo
from tools.pictures.captions import text_px


def test_demo_leaves_captures_pictures_sidecars_and_comparison(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bundle, out = write_tiny_bundle(tmp_path), tmp_path / "out"
    honest = demo.write_captioned
    photo = tmp_path / "small.png"
    cv2.imwrite(str(photo), np.full((24, 24, 3), 90, np.uint8))
    monkeypatch.setattr(sys, "argv", ["demo", "--out-dir", str(out), "--bundle", str(bundle)])
    monkeypatch.setattr(demo, "PHOTO", photo)
    monkeypatch.setattr(demo, "CROP_PX", 24)
    monkeypatch.setattr(demo, "BORDER_PX", 4)
    drawn = []
    monkeypatch.setattr(demo, "write_captioned", lambda *a: (drawn.append(a), honest(*a)))
    demo.main()
    for name, suffix in (("confetti", "exr"), ("photo", "png")):
        assert (out / f"{name}.dng").is_file()
        assert (out / f"{name}.{suffix}").is_file()
        assert json.loads((out / f"{name}.camkit.json").read_text("utf-8"))["input"]
    assert cv2.imread(str(out / "photo.png")).shape == (24, 24, 3)
    ((_, heading, rows),) = drawn
    first, second, *others = rows
    assert "ISO 100" in heading
    assert "photograph" in first
    assert "3 times as large" in second
    assert len(others) == len(demo.FIELDS)
    assert all("confetti" in title for title in others)
    for title in (first, *others):
        *made, sharp = rows[title]
        assert len(made) == 3
        assert all(re.fullmatch(r"[a-zA-Z ]+: -?\d+\.\d\d dB", caption) for caption in made)
        assert sharp == "truth"
    page = cv2.imread(str(out / "before_after.png"))
    assert page is not None
    strips = 2 * text_px(24) * (len(heading.splitlines()) + 2 * len(rows))
    assert page.shape[0] == strips + 24 * len(rows)
    told = capsys.readouterr().out
    assert told.index("photo     0.50") < told.index("confetti  0.00")
    assert told.splitlines()[-1] == f"Open {out / 'before_after.png'} first."


def test_the_photograph_is_small_and_says_whose_it_is() -> None:
    assert demo.PHOTO.stat().st_size < 1.5e6
    assert "CC0" in (demo.PHOTO.parent / "README.md").read_text("utf-8")


def test_make_demo_ends_with_the_file_to_open() -> None:
    lines = (Path(demo.__file__).parents[1] / "Makefile").read_text("utf-8").splitlines()
    recipe = [line for line in lines if " -m tools." in line and line.endswith("--out-dir out")]
    assert "tools.demo " in recipe[-1]
    assert len(recipe) == 2


@pytest.mark.parametrize("target", ["RUNTIME_STAMP", "DEV_STAMP"])
def test_make_says_what_it_installs_before_it_does(target: str) -> None:
    rules = (Path(demo.__file__).parents[1] / "Makefile").read_text("utf-8").split("\n\n")
    (recipe,) = (rule.splitlines()[1:] for rule in rules if rule.startswith(f"$({target}):"))
    told = recipe[0] + recipe[1]
    assert all(line.startswith("\t@echo ") for line in recipe[:2])
    assert "on disk" in told
    assert "minutes" in told
