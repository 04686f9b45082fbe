"""tools/quality.py on a tiny bundle: tuned, compared, and resumed without a second measurement."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from tests.psf_factory import texture
from tests.tiny_design import run_tool
from tests.wide_bundle import write_wide_bundle
from tools.comparison.measurement import CAPTURE_COLUMNS

PEER = "skimage_wiener"


@pytest.fixture
def bundle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Bundle:
    """Give a bundle without a prescription: its own PSF stands for the fabricated ones."""
    made = write_wide_bundle(tmp_path)
    monkeypatch.setattr(
        "tools.quality.fabricated_optics", lambda bundle, *_, **__: bundle.frozen_optics
    )
    monkeypatch.setattr("tools.quality.lens_text", lambda *_: "lens")
    folder = tmp_path / "pictures" / "set"
    folder.mkdir(parents=True)
    picture = np.rint(texture(80, 96) * 255).astype(np.uint8)
    cv2.imwrite(str(folder / "a.png"), picture.transpose(1, 2, 0))
    return made


def test_a_tuned_comparison_has_a_row_for_every_method_and_resumes(
    bundle: Bundle,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out, work = tmp_path / "out" / "quality.json", tmp_path / "work"
    shared = ("--bundle", bundle.path, "--isos", 100, "--work-dir", work, "--out", out)
    pictures = tmp_path / "pictures"
    tune = ("--tune", "--places", 1, "--data", pictures / "set", "--methods", PEER)
    run_tool(monkeypatch, "quality", *shared, *tune)
    tuned = json.loads(out.read_text(encoding="utf-8"))["tuned"]
    assert set(tuned["values"]) == {PEER}
    compare = ("--data", pictures, "--sets", "set", "--psf", "both", "--resume")
    methods = ("--methods", f"input,{PEER},M", "--compare", bundle.path, "rival")
    run_tool(monkeypatch, "quality", *shared, *compare, *methods)
    report = json.loads(out.read_text(encoding="utf-8"))
    assert report["methods"] == ["input", PEER, "M", "rival"]
    # five places, two kinds of PSF
    assert len(report["captures"]) == 5 * 2
    assert all(len(row) == len(CAPTURE_COLUMNS) + 4 for row in report["captures"])
    assert report["tuned"] == tuned
    assert report["commands"][0].startswith("python -m tools.quality --bundle ")
    assert f"`{report['commands'][0]}`" in out.with_suffix(".md").read_text(encoding="utf-8")
    assert "10 captures, 10 to do" in capsys.readouterr().out
    run_tool(monkeypatch, "quality", *shared, *compare, *methods)
    assert "10 captures, 0 to do" in capsys.readouterr().out
    assert json.loads(out.read_text("utf-8"))["captures"] == report["captures"]


def test_without_tuned_parameters_a_comparison_is_refused(
    bundle: Bundle, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = ("--bundle", bundle.path, "--data", tmp_path / "pictures", "--sets", "set")
    with pytest.raises(SystemExit, match="run with --tune first"):
        run_tool(monkeypatch, "quality", *command, "--out", tmp_path / "none.json")
