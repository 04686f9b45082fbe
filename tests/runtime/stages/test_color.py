"""Whose colour matrix, and what the picture is in."""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Color, Linearise
from camkit.runtime.color import color_stage, to_output
from tests.bundle_factory import tiny_sensor
from tests.job_factory import (
    OWN_MATRIX,
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    start,
    stream_of,
)
from tests.planes_bundle import planes_sensor, write_planes_bundle


def test_the_files_own_matrix_wins_over_the_bundles(bundle: Bundle) -> None:
    own, bundles = (
        start(bundle, capture).color.matrix
        for capture in (made_mosaic(), made_mosaic(color_matrix=None))
    )
    stated = made_mosaic(color_matrix=np.array(tiny_sensor().color_matrix))
    np.testing.assert_array_equal(bundles, start(bundle, stated).color.matrix)
    assert (own != bundles).any()


def test_without_bundle_and_statement_colours_are_rec709_and_that_is_said() -> None:
    made = start(None, made_mosaic(color_matrix=None))
    np.testing.assert_array_equal(made.color.matrix, np.eye(3))
    assert [note.split(":")[0] for note in made.job.log.notes] == ["no colour matrix"]


def test_planes_without_a_matrix_are_rec709_already(bundle: Bundle) -> None:
    for camera in (bundle, None):
        made = start(camera, made_planes())
        np.testing.assert_array_equal(made.color.matrix, np.eye(3))
        assert not any("matrix" in note for note in made.job.log.notes)


@pytest.mark.parametrize("step", [1, 7, 64])
def test_rows_are_those_of_the_whole_in_the_colour_asked_for(step: int) -> None:
    light = np.random.default_rng(0).random((3, 64, 9), dtype=np.float32)
    job = made_job(made_mosaic(), color="acescg", exposure_ev=1.0)
    (picture,) = run_stage(Color(), job, stream_of(light))
    assert (picture.plane.channels, picture.plane.domain) == (("R", "G", "B"), "output")
    wanted = to_output(light, color_stage(OWN_MATRIX, "acescg", exposure_ev=1.0))
    np.testing.assert_array_equal(read_all(picture.rows(), step), wanted)


def test_one_channel_becomes_grey(tmp_path: Path) -> None:
    stages = (Linearise(gives=("light",)), Color(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor(size_px=None))
    light = np.random.default_rng(0).random((1, 20, 9), dtype=np.float32)
    made = start(camera, made_planes(samples=light))
    assert made.shape == (3, 20, 9)
    np.testing.assert_allclose(made.fill(), np.repeat(light, 3, axis=0), rtol=1e-6)
