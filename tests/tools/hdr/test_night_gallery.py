"""The gallery of a night: files, and what was gained."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.hdr_bundle import write_hdr_bundle
from tools.hdr import night_gallery
from tools.pictures.captions import GAP_PX, text_px


def test_a_night_is_photographed_read_back_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(night_gallery, "SIDES_PX", (96, 128))
    bundle = write_hdr_bundle(tmp_path).path
    night_gallery.show_gallery(str(bundle), tmp_path / "out")
    sheet = cv2.imread(str(tmp_path / "out" / "night.png"))
    assert sheet is not None
    line = 2 * text_px(128)
    rows = len(night_gallery.STOPS) + len(night_gallery.STOPS_OF_DETAIL)
    assert sheet.shape == (3 * line + rows * (2 * line + 96), 4 * (128 + GAP_PX), 3)
    for column in range(4):
        left = column * (128 + GAP_PX)
        assert sheet[4 * line : 5 * line, left : left + 128].min() < 100
    streaks = cv2.imread(str(tmp_path / "out" / "streaks.png"))
    assert streaks is not None
    assert streaks[: 2 * line].min() < 100
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("night.dng", "night.exr", "night.camkit.json", "night.png", "streaks.png")
    }
    told = capsys.readouterr().out
    assert re.search(r"physics +-?\d+\.\d\d dB", told)
    assert told.rstrip().endswith("truth")


def test_the_brightest_light_is_shown_enlarged_also_at_the_border() -> None:
    truth = np.zeros((3, 32, 48), np.float32)
    truth[:, 31, 0] = 256
    rows = night_gallery.night_rows({"network: 45.00 dB": truth / 2, "truth": truth})
    frame, *_, darkest = rows.values()
    assert list(frame) == ["network: 45.00 dB", "truth"]
    assert list(darkest) == ["network", "truth"]
    assert darkest["truth"].shape == truth.shape
    np.testing.assert_allclose(darkest["truth"][:, -4:, :4], 1, rtol=1e-6)
    assert darkest["truth"][:, :-4].max() == 0
    assert darkest["network"].max() < 1


@pytest.mark.parametrize("name", ["streak-hdr", "streak-rank1"])
def test_built_in_cameras_bring_the_lamps_of_a_night_back(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(night_gallery, "SIDES_PX", (320, 480))
    monkeypatch.setattr(night_gallery, "find_spec", lambda _: None)  # the plate is drawn elsewhere
    night_gallery.show_gallery(name, tmp_path)
    found = re.findall(r"(\d+\.\d+) dB", capsys.readouterr().out)
    developed, physics, network = (float(value) for value in found)
    assert physics > developed + 3
    assert network > physics
