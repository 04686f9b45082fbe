"""Straight steps in photographs are found where they are, and nothing else is."""

import numpy as np
import pytest

from camkit.calibration.blur.photo_edges import FieldAxes, find_photo_edges
from tests.camkit.calibration.blur_factory import photograph

AXES = FieldAxes(axis_px=(239.5, 159.5), pitch_um=5.0, radius_mm=1.45)


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", None])
def test_edges_of_polygons_are_found_in_every_mosaic(cfa):
    found = find_photo_edges(photograph(1, cfa=cfa), AXES, photo=0, reach_px=10, most=800)
    assert len(found.edges) >= 8
    assert found.clipped == 0
    for edge in found.edges:
        assert edge.outward**2 + edge.sideways**2 == pytest.approx(1)
        assert all(colour is not None for colour in edge.colours)


def test_noise_alone_has_no_edge():
    capture = photograph(1, noise=0.0)
    rng = np.random.default_rng(0)
    samples = rng.normal(20000, 600, capture.samples.shape).astype(np.uint16)
    noisy = type(capture)(
        samples=samples,
        cfa="RGGB",
        black_level=capture.black_level,
        white_level=60000.0,
        pixel_pitch_um=5.0,
    )
    assert find_photo_edges(noisy, AXES, photo=0, reach_px=10, most=400).edges == ()


def test_clipped_edges_are_counted_and_left_out():
    found = find_photo_edges(photograph(1, scale=2.5), AXES, photo=0, reach_px=10, most=800)
    assert found.clipped > 5
    for edge in found.edges:
        assert max(edge.colours[1].value) < 0.99
