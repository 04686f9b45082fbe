"""Edges are found where they are, at any angle, and nowhere else."""

import math

import numpy as np
import pytest

from camkit.calibration.edges import SQUARE_PX, find_edges
from camkit.runtime.capture import Capture
from camkit.scenes.slanted_edge import slanted_edge
from camkit.scenes.squares import squares_scene

WHITE = 4095.0


def capture(plane: np.ndarray) -> Capture:
    """A mosaic of a grey scene."""
    return Capture(
        samples=np.round(plane * WHITE).astype(np.uint16),
        cfa="RGGB",
        black_level=np.zeros((2, 2), np.float32),
        white_level=WHITE,
    )


@pytest.mark.parametrize("angle_deg", [0.0, 3.5, -40.0, 60.0])
@pytest.mark.parametrize("levels", [(0.1, 0.6), (0.6, 0.1)])
def test_an_edge_lies_where_it_was_drawn(angle_deg: float, levels: tuple[float, float]) -> None:
    angle = math.radians(angle_deg)
    scene = slanted_edge(256, 256, angle_rad=angle, levels=levels)[1]
    edges = find_edges(capture(scene)).edges
    assert edges
    sign = 1 if levels[1] > levels[0] else -1
    for edge in edges:
        off = (edge.x_px - 127.5) * math.cos(angle) - (edge.y_px - 127.5) * math.sin(angle)
        assert off == pytest.approx(0, abs=0.1)
        down, right = edge.normal
        assert (down, right) == pytest.approx(
            (-sign * math.sin(angle), sign * math.cos(angle)), abs=0.003
        )
        for profile in edge.profiles:
            assert profile.value[0] == pytest.approx(0.1, abs=0.002)
            assert profile.value[-1] == pytest.approx(0.6, abs=0.002)


def test_edges_of_squares_are_found_and_corners_are_not() -> None:
    found = find_edges(capture(squares_scene(3, 704, 704)[1]))
    assert 8 <= len(found.edges) <= 40
    assert found.clipped == 0
    normals = {round(math.degrees(math.atan2(*edge.normal))) for edge in found.edges}
    assert len(normals) == 4  # left, right, above, below


def test_what_is_no_straight_step_is_none() -> None:
    y, x = np.mgrid[:256, :256]
    ramp = 0.1 + 0.6 * x / 255
    line = 0.6 - 0.5 * (np.abs(x - 128 - 0.1 * y) < 3)
    disc = 0.1 + 0.5 * (np.hypot(x - 128, y - 128) < 40)
    for plane in (ramp, line, disc, np.full((256, 256), 0.5)):
        assert not find_edges(capture(plane)).edges


def test_a_clipped_edge_is_counted_and_left_out() -> None:
    found = find_edges(capture(slanted_edge(256, 256, levels=(0.1, 1.0))[1]))
    assert not found.edges
    assert found.clipped > 0


def test_a_small_capture_has_no_edges() -> None:
    assert not find_edges(capture(slanted_edge(SQUARE_PX - 2, 200)[1])).edges
