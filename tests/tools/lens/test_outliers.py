"""tools/lens/outliers.py on a tiny camera: a drawing, and one line for what is no camera."""

from collections.abc import Callable
from pathlib import Path

import cv2
import pytest

from tests.tiny_design import run_tool
from tests.wide_bundle import write_wide_bundle


def test_cameras_are_drawn_side_by_side(
    picture: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "pictures").mkdir()
    shown = cv2.imread(str(picture("one")))
    larger = cv2.resize(shown, (640, 640), interpolation=0)
    cv2.imwrite(str(tmp_path / "pictures" / "one.png"), larger)
    camera = write_wide_bundle(tmp_path).path
    out = tmp_path / "new" / "outliers.png"
    cameras = (camera, f"again={camera}")
    options = ("--data", tmp_path / "pictures", "--pictures", 1, "--worst", 2, "-o", out)
    heights = []
    for count in (1, 2):
        run_tool(monkeypatch, "lens.outliers", *cameras[:count], *options)
        drawn = cv2.imread(str(out))
        assert drawn.std() > 5
        heights.append(drawn.shape[0])
    assert heights[1] > 1.2 * heights[0]
    with pytest.raises(SystemExit, match="two cameras are called again"):
        run_tool(monkeypatch, "lens.outliers", cameras[1], cameras[1], *options)
    with pytest.raises(SystemExit, match=r"error: .*nowhere"):
        run_tool(monkeypatch, "lens.outliers", "nowhere", *options)
