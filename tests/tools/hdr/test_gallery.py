"""The gallery of a night: files, and what was gained."""

import re
from pathlib import Path

import cv2
import pytest

from tests.hdr_bundle import write_hdr_bundle
from tools.hdr import gallery


def test_a_night_is_photographed_read_back_and_drawn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(gallery, "SIDES_PX", (96, 128))
    bundle = write_hdr_bundle(tmp_path).path
    gallery.show_gallery(str(bundle), tmp_path / "out")
    sheet = cv2.imread(str(tmp_path / "out" / "night.png"))
    assert sheet is not None
    assert sheet.shape == (4 * 96, 3 * 128, 3)
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("night.dng", "night.exr", "night.camkit.json", "night.png", "streaks.png")
    }
    told = capsys.readouterr().out
    assert "by physics" in told
    assert "as it was" in told


@pytest.mark.parametrize("name", ["streak-hdr", "streak-rank1"])
def test_built_in_cameras_bring_the_lamps_of_a_night_back(
    name: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(gallery, "SIDES_PX", (320, 480))
    monkeypatch.setattr(gallery, "find_spec", lambda _: None)  # the plate is drawn elsewhere
    gallery.show_gallery(name, tmp_path)
    found = re.findall(r"(\d+\.\d+) dB", capsys.readouterr().out)
    developed, physics, network = (float(value) for value in found)
    assert physics > developed + 3
    assert network > physics
