"""tools/lens/field_figures.py on two small cameras: figures, numbers, and the better of two."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from camkit.bundle.haze_file import write_haze
from camkit.bundle.psf_file import write_psf
from tests.hazy_recipe import hazy_optics
from tests.tiny_design import run_tool
from tools.lens.field_figures import PLACES, cut

FIGURES = ("psf", "detection", "recovery", "board", "crops")


@pytest.fixture
def optics(tmp_path: Path) -> str:
    made = hazy_optics()
    assert made.haze is not None
    write_psf(tmp_path / "psf.safetensors", made.psf)
    write_haze(tmp_path / "haze.safetensors", made.haze)
    return f"{tmp_path / 'psf.safetensors'}+{tmp_path / 'haze.safetensors'}"


def test_two_cameras_are_drawn_and_told(
    optics: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocks = np.random.default_rng(0).integers(40, 220, (6, 6, 3), dtype=np.uint8)
    cv2.imwrite(str(tmp_path / "p.png"), cv2.resize(blocks, (96, 96), interpolation=0))
    out = tmp_path / "out"
    run_tool(
        monkeypatch,
        "lens.field_figures",
        *(f"thin-plate={optics}", f"bare={optics.partition('+')[0]}", "--data", tmp_path),
        *("--frame", 160, 128, "--fields", 2, "--crop-px", 48, "--board-px", 8),
        *("--out-dir", out),
    )
    for name in FIGURES:
        picture = cv2.imread(str(out / f"{name}.png"))
        assert picture.std() > 5, name
    lenses = json.loads((out / "field.json").read_text())["lenses"]
    assert list(lenses) == ["thin-plate", "bare"]
    plate = lenses["thin-plate"]
    # angles are those of the lens of that name; nobody knows them of another
    assert plate["fields"][0]["field_angle_deg"] == 0
    assert plate["fields"][1]["field_angle_deg"] > 10
    assert lenses["bare"]["fields"][0]["field_angle_deg"] is None
    # both zones are in one ring: the better one is the larger number
    found = plate["psnr_db"]
    assert plate["better_db"] == pytest.approx(max(found["before"], found["after"]), abs=0.3)
    rows = (out / "field.md").read_text().splitlines()
    assert rows[0].count("better") == 2
    assert rows[-1].startswith("| frame |")


def test_crops_lie_from_the_middle_to_the_corner() -> None:
    y, x = np.indices((90, 120), dtype=np.float32)
    crops = cut(np.stack([y, x, y]), 10)
    assert len(crops) == len(PLACES)
    assert crops[0][0].mean() == pytest.approx(44.5, abs=1)
    assert crops[0][1].mean() == pytest.approx(59.5, abs=1)
    middles = [float(crop[1].mean()) for crop in crops]
    assert middles == sorted(middles, reverse=True)
    assert crops[-1][0].min() == 0


def test_a_missing_lens_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cv2.imwrite(str(tmp_path / "p.png"), np.zeros((8, 8, 3), np.uint8))
    with pytest.raises(SystemExit, match=r"error: .*no-such"):
        run_tool(monkeypatch, "lens.field_figures", "no-such", "--data", tmp_path)
