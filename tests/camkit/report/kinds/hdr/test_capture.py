"""A scene with the plate and through the bare lens: what is held against what."""

from pathlib import Path

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.report.kinds.hdr.capture import (
    capture_of,
    clipped_planes,
    developer,
    photograph,
    sites_of,
)
from camkit.report.quality import Exposed, Shot
from camkit.runtime.twin.light import camera_space
from camkit.scenes.saturation import CEILING
from tests.hdr_bundle import write_hdr_bundle

LAMP = (slice(90, 98), slice(120, 128))
ARM = (slice(58, 83), slice(88, 161))
"""Above the lamp, where arms lie and nothing of the core."""


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hdr_bundle(tmp_path_factory.mktemp("hdr"))


@pytest.fixture(scope="module")
def scene() -> FloatArray:
    dark = np.full((3, 192, 256), 0.05, np.float32)
    dark[:, *LAMP] = 2 * CEILING
    return dark


@pytest.fixture(scope="module")
def exposed(bundle: Bundle, scene: FloatArray) -> Exposed:
    shot = Shot(set_name="set", picture=Path("lamp"), number=0, position=0, iso=100.0, psf="bundle")
    return photograph(shot, scene, bundle, bundle.frozen_optics)


def test_the_truth_ends_at_the_ceiling(exposed: Exposed) -> None:
    linear = exposed.extras["linear"]
    assert linear[:, *LAMP] == pytest.approx(CEILING, rel=1e-3)
    assert linear[:, :40] == pytest.approx(0.05, rel=1e-3)


def test_the_input_is_the_bare_lens_clipped_where_each_colour_clips(
    bundle: Bundle, exposed: Exposed
) -> None:
    given = exposed.extras["input"]
    pipeline = developer(bundle, 1)
    coded = pipeline.start(capture_of(pipeline, exposed.simulation)).fill()
    assert given[1, *ARM].mean() == pytest.approx(0.05, rel=0.02)
    assert coded[1, *ARM].mean() > 2 * 0.05
    matrix, gains = camera_space(bundle.manifest.sensor)
    white = np.linalg.inv(matrix) @ np.array(gains)
    inside = given[:, LAMP[0].start + 2 : LAMP[0].stop - 2, LAMP[1].start + 2 : LAMP[1].stop - 2]
    np.testing.assert_allclose(inside, np.broadcast_to(white[:, None, None], inside.shape), 0.01)


def test_what_clipped_in_either_capture_is_masked_and_little_else(exposed: Exposed) -> None:
    clipped = exposed.extras["clipped"]
    assert clipped[:, *LAMP].all()
    ring = clipped.copy()
    ring[:, LAMP[0].start - 8 : LAMP[0].stop + 8, LAMP[1].start - 8 : LAMP[1].stop + 8] = False
    assert not ring.any()


def test_a_clipped_sample_marks_the_pixels_of_its_colour_around_it(bundle: Bundle) -> None:
    samples = np.full((64, 64), 400, np.uint16)
    samples[20, 30] = samples[41, 11] = 4095  # red, blue
    capture = developer(bundle, 1).capture_of(
        samples, iso=100.0, white_balance=(2.0, 1.0, 1.6), origin_px=(0, 0)
    )
    red, green, blue = clipped_planes(capture)
    assert not green.any()
    for plane, (y, x) in ((red, (20, 30)), (blue, (41, 11))):
        assert plane[y - 1 : y + 2, x - 1 : x + 2].all()
        assert plane.sum() == 9


def test_every_sample_of_a_mosaic_has_one_colour() -> None:
    planes = sites_of("GRBG", (4, 6))
    assert (planes.sum(axis=0) == 1).all()
    # red, blue and green sites
    assert (planes[:, [0, 1, 1], [1, 0, 1]] == np.eye(3, dtype=bool)[[0, 2, 1]].T).all()
    assert sites_of(None, (3, 4, 6)).all()
