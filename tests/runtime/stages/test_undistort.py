"""The distortion undone, band by band as in the whole, about the optical axis."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.facts import Port
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent
from camkit.bundle.stages import Linearise, Network, Undistort
from camkit.radial import RadialDistortion
from camkit.runtime.geometry.warp import Warp, undistort_bands
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import PITCH_UM
from tests.job_factory import (
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    start,
    stream_of,
)
from tests.planes_bundle import facts_of, finer_network, planes_sensor, write_planes_bundle
from tests.psf_factory import streak_kernel, uniform_psf


def test_bands_are_those_of_the_whole_in_ideal_geometry(bundle: Bundle) -> None:
    light = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    job = made_job(made_mosaic(), bundle, threads=2)
    (straight,) = run_stage(Undistort(), job, stream_of(light))
    assert not straight.plane.grid.warped
    bands = undistort_bands(ArrayRows(light), bundle.psf.distortion, job.placement.window)
    np.testing.assert_array_equal(
        read_all(straight.rows(), 13), np.concatenate(list(bands), axis=1)
    )


def test_the_bundle_says_how_it_interpolates(bundle: Bundle) -> None:
    light = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    job = made_job(made_mosaic(), bundle)
    made = {
        way: read_all(run_stage(Undistort(interpolation=way), job, stream_of(light))[0].rows(), 13)
        for way in ("lanczos", "cubic")
    }
    window = job.placement.window
    bands = undistort_bands(ArrayRows(light), bundle.psf.distortion, window, interpolation="cubic")
    np.testing.assert_array_equal(made["cubic"], np.concatenate(list(bands), axis=1))
    assert np.abs(made["cubic"] - made["lanczos"]).max() > 1e-4


def test_a_bundle_that_says_so_has_no_rings_around_lamps(bundle: Bundle) -> None:
    light = np.full((3, 64, 96), 0.01, np.float32)
    light[:, 3:6, 3:6] = 100.0
    job = made_job(made_mosaic(), bundle)
    kept, limited = (
        read_all(run_stage(Undistort(overshoot=overshoot), job, stream_of(light))[0].rows(), 13)
        for overshoot in ("kept", "limited")
    )
    assert kept.min() < -0.1
    assert limited.min() > 0.0099
    assert limited.max() <= 100


@pytest.mark.parametrize("channels", [("Y",), tuple("abcde")])
def test_pixels_move_away_from_the_axis_wherever_it_meets_the_sensor(
    tmp_path: Path, channels: tuple[str, ...]
) -> None:
    """Undoing a barrel moves what lies right of the axis further right, and left further left."""
    count = len(channels)
    barrel = RadialDistortion(
        coefficients=np.tile([1.0, -0.04, 0.0, 0.0], (count, 1)), radius_mm=0.35
    )
    psf = replace(uniform_psf(streak_kernel(0.0), channels=count), distortion=barrel)
    extent = {"width_px": 96, "height_px": 64, "pixel_pitch_um": PITCH_UM}
    y, x = np.mgrid[0:64, 0:96].astype(np.float32)
    moved = {}
    for axis_px in (None, (20.0, 31.5), (75.0, 31.5)):
        sensor = planes_sensor(
            channels, extent=Extent.model_validate(extent | {"optical_centre_px": axis_px})
        )
        stages = (Linearise(gives=("light",)), Undistort(takes=("light",)))
        camera = write_planes_bundle(
            tmp_path, stages, sensor=sensor, psf=replace(psf, pixel_pitch_um=PITCH_UM)
        )
        spot = np.exp(-((x - 60) ** 2 + (y - 31.5) ** 2) / 8)
        made = start(camera, made_planes(samples=np.stack([spot] * count)))
        found = made.fill()
        centre = (found * x).sum(axis=(1, 2)) / found.sum(axis=(1, 2))
        np.testing.assert_allclose(centre, centre[0], atol=1e-4)
        moved[axis_px] = float(centre[0]) - 60
    # the picture is centred on the middle of the window; beside the axis it is stretched more
    assert moved[None] > 0.02
    assert moved[20.0, 31.5] > moved[None]
    assert moved[75.0, 31.5] != pytest.approx(moved[20.0, 31.5], abs=0.02)


def test_a_finer_plane_is_moved_by_the_same_share_of_a_pixel(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    ports = [Port(name="a", channels=1)], [Port(name="b", channels=1, scale=2)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
        Undistort(takes=("large",)),
    )
    barrel = RadialDistortion(coefficients=np.array([[1.0, -0.04, 0.0, 0.0]]), radius_mm=0.35)
    psf = replace(uniform_psf(streak_kernel(0.0)), distortion=barrel, pixel_pitch_um=PITCH_UM)
    sensor = planes_sensor(
        extent=Extent(
            width_px=96, height_px=64, pixel_pitch_um=PITCH_UM, optical_centre_px=(30.0, 20.0)
        )
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=sensor,
        psf=psf,
        networks={"restore": (facts_of(data, *ports), data)},
    )
    made = start(camera, made_planes(samples=np.full((1, 64, 96), 0.3, np.float32)))
    window = made.job.placement.window
    fine = made.job.window_of(camera.manifest.planes["large"])
    x, y = np.meshgrid(np.linspace(0, 95, 7), np.linspace(0, 63, 5))
    coarse_warp, fine_warp = (Warp(barrel, w, to_sensor=False) for w in (window, fine))
    found = fine_warp.positions(0, 2 * x + 0.5, 2 * y + 0.5)
    np.testing.assert_allclose((found - 0.5) / 2, coarse_warp.positions(0, x, y), atol=1e-6)
    large = read_all(made.rows_of("large"))
    bands = undistort_bands(ArrayRows(large), barrel, fine)
    np.testing.assert_array_equal(made.fill(), np.concatenate(list(bands), axis=1))
