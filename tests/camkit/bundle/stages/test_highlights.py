"""Lights are read where the pixels of the sensor lie, behind optics that write streaks."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from camkit.bundle.chain import join_stages
from camkit.bundle.plane import Grid, Plane
from camkit.bundle.sensor import MOSAIC, RGB
from camkit.bundle.stages import Demosaic, Highlights, JoinError, Linearise, Parts, Stage
from camkit.errors import BundleError
from tests.bundle_factory import tiny_optics, tiny_sensor
from tests.hdr_bundle import hdr_stages, hdr_stages_from_samples, write_hdr_bundle

MOSAIC_PLANE = Plane(type="float32", channels=MOSAIC, domain="linear", grid=Grid())
PICTURE = Plane(type="float32", channels=RGB, domain="linear", grid=Grid())


def _parts(optics: object) -> Parts:
    return Parts(sensor=tiny_sensor(), optics=optics, networks={})  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def streaks(tmp_path_factory: pytest.TempPathFactory) -> Parts:
    return write_hdr_bundle(tmp_path_factory.mktemp("hdr")).manifest.parts


def test_it_gives_the_plane_that_it_takes(streaks: Parts) -> None:
    assert Highlights().join([PICTURE], streaks) == (PICTURE,)
    planes = join_stages(hdr_stages(), streaks)
    assert planes["lit"] == planes["rgb"]


def _with(**changes: object) -> list[Plane]:
    return [PICTURE.model_copy(update=changes)]


@pytest.mark.parametrize(
    ("taken", "message"),
    [
        ([], "it takes 1 to 2 plane"),
        ([PICTURE] * 3, "it takes 1 to 2 plane"),
        ([PICTURE, PICTURE], "beside its colours it takes their mosaic"),
        (_with(domain="dn"), "it takes planes that are linear, not dn"),
        (_with(channels=("cfa",)), "it takes red, green and blue"),
        (_with(channels=("R", "G", "B", "N")), "it takes red, green and blue"),
        (_with(grid=Grid(pitch_ratio=0.5)), "it works on the pixels of the sensor"),
        (_with(grid=Grid(warped=False)), "before any undistortion"),
    ],
)
def test_planes_in_which_no_streak_lies_as_it_fell_are_refused(
    taken: Sequence[Plane], message: str, streaks: Parts
) -> None:
    with pytest.raises(JoinError, match=message):
        Highlights().join(taken, streaks)


@pytest.mark.parametrize(
    ("optics", "message"),
    [
        (None, "reads lights from the streaks of optics, and the bundle states no optics"),
        (tiny_optics(), "it needs optics that write streaks, not frozen_psf"),
    ],
)
def test_a_camera_without_streaks_is_refused(optics: object, message: str) -> None:
    stages: tuple[Stage, ...] = (Linearise(), Demosaic(takes=("light",)), Highlights())
    with pytest.raises(JoinError, match=rf"stage 3 \(highlights\) does not join: .*{message}"):
        join_stages(stages, _parts(optics))


def test_it_takes_the_mosaic_of_its_colours(streaks: Parts) -> None:
    both = hdr_stages_from_samples()
    assert join_stages(both, streaks)["lit"] == PICTURE
    other = MOSAIC_PLANE.model_copy(update={"grid": Grid(pitch_ratio=0.5)})
    with pytest.raises(JoinError, match="beside its colours it takes their mosaic"):
        Highlights(takes=("rgb", "balanced")).join([PICTURE, other], streaks)


def test_streaks_from_samples_need_the_format_that_brought_them(tmp_path: Path) -> None:
    stages = hdr_stages_from_samples()
    assert write_hdr_bundle(tmp_path, stages=stages, format_version="2.8").manifest.stages == stages
    with pytest.raises(BundleError, match=r"streaks are taken from the samples .* format 2\.8"):
        write_hdr_bundle(tmp_path, stages=stages, format_version="2.7")
