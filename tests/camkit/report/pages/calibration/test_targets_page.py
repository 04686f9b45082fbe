"""The page of what a display shows: all of it, in its order."""

from pathlib import Path

import numpy as np
from PIL import Image

from camkit.calibration.display.screen import Screen
from camkit.calibration.display.targets import Targets, draw_targets, plan_targets
from camkit.calibration.geometry.board import Board
from camkit.report.pages.calibration.targets_page import (
    COLUMNS,
    PER_SHEET,
    SMALL_PX,
    draw_sheet,
    shrunk,
    targets_html,
)

SCREEN = Screen(width_px=640, height_px=400)


def _planned(folder: Path, levels: range) -> tuple[Targets, list[Path]]:
    path = folder / "a & b.png"
    Image.fromarray(np.full((60, 90, 3), 90, np.uint8)).save(path)
    return plan_targets([path], SCREEN, Board(columns=7, rows=5), levels), [path]


def test_every_target_is_listed_and_drawn_on_a_sheet(tmp_path: Path) -> None:
    planned, pictures = _planned(tmp_path, range(20))
    small = [shrunk(codes) for codes in draw_targets(planned, pictures)]
    assert {codes.shape for codes in small} == {(200, SMALL_PX, 3)}
    page = targets_html(planned, small)
    assert len(small) > PER_SHEET
    assert page.count("<img") == 2
    assert f"Targets {PER_SHEET + 1} to {len(small)}." in page
    for target in planned.targets:
        assert f"<td>{target.file}</td>" in page
    for told in (
        "board of 7x5 inner corners",
        "grey 19",
        "colour 0, 128, 0",
        "a &amp; b.png, sRGB",
    ):
        assert told in page


def test_a_sheet_shows_targets_beside_their_names_and_nothing_else(tmp_path: Path) -> None:
    planned, pictures = _planned(tmp_path, range(1))
    small = [shrunk(codes) for codes in draw_targets(planned, pictures)]
    panels = draw_sheet(planned.targets, small).axes
    assert len(panels) % COLUMNS == 0
    shown = [panel for panel in panels if panel.get_images()]
    assert [panel.get_title() for panel in shown] == [target.file for target in planned.targets]
    for panel, codes in zip(shown, small, strict=True):
        np.testing.assert_array_equal(panel.get_images()[0].get_array(), codes)


def test_small_screens_are_not_enlarged() -> None:
    codes = np.zeros((20, 30, 3), np.uint8)
    assert shrunk(codes).shape == codes.shape
