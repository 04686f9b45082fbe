"""Division by the relative illumination at the place of every sample, on any grid."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.facts import Port
from camkit.bundle.plane import Grid
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent
from camkit.bundle.stages import Illumination, Linearise, Network
from camkit.psf import FrozenPsf
from camkit.runtime.geometry.illumination import divide_illumination, illumination_band
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
from tests.psf_factory import grid_psf, streak_kernel, uniform_psf


def test_bands_are_divided_as_the_whole(bundle: Bundle) -> None:
    light = np.random.default_rng(0).random((3, 64, 96), dtype=np.float32)
    job = made_job(made_mosaic(), bundle, threads=2)
    (even,) = run_stage(Illumination(), job, stream_of(light))
    wanted = divide_illumination(light, 0, bundle.psf, job.placement.window)
    np.testing.assert_array_equal(read_all(even.rows(), 13), wanted)
    assert wanted[0, 0, 0] > 1.05 * light[0, 0, 0]


def test_a_finer_plane_is_divided_at_the_places_of_its_samples(bundle: Bundle) -> None:
    job = made_job(made_mosaic(), bundle)
    stream = stream_of(np.ones((3, 128, 192), np.float32))
    finer = replace(stream, plane=stream.plane.model_copy(update={"grid": Grid().finer(2)}))
    (even,) = run_stage(Illumination(), job, finer)
    found = read_all(even.rows())
    usual = divide_illumination(
        np.ones((3, 64, 96), np.float32), 0, bundle.psf, job.placement.window
    )
    blocks = found.reshape(3, 64, 2, 96, 2).mean(axis=(2, 4))
    np.testing.assert_allclose(blocks, usual, rtol=1e-4)


def _falling(psf: FrozenPsf) -> FrozenPsf:
    assert psf.grid_x_mm is not None
    assert psf.grid_y_mm is not None
    light = 1 - 0.5 * psf.grid_x_mm[None] - 0.2 * psf.grid_y_mm[:, None]
    return replace(psf, relative_illumination=light.ravel())


@pytest.mark.parametrize("channels", [("Y",), tuple("abcde")])
def test_a_walk_gives_back_the_light_that_a_one_sided_fall_took(
    tmp_path: Path, channels: tuple[str, ...]
) -> None:
    at_mm = np.array([-0.4, 0.0, 0.4])
    streaks = np.broadcast_to(streak_kernel(0.0, 3, 5), (3, 3, 11, 11)).copy()
    plain = grid_psf(streaks, at_mm, at_mm, channels=len(channels))
    psf = replace(_falling(plain), pixel_pitch_um=PITCH_UM)
    stages = (Linearise(gives=("light",)), Illumination(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor(channels), psf=psf)
    light = np.full((len(channels), 64, 96), 0.4, np.float32)
    window = made_job(made_planes(samples=light), camera).placement.window
    shaded = light * illumination_band(psf, window, 0, 64)
    assert shaded[0, 32, 0] > 1.1 * shaded[0, 32, -1]
    made = start(camera, made_planes(samples=shaded))
    np.testing.assert_allclose(made.fill(), light, rtol=1e-5)


def test_a_network_before_it_that_doubles_the_size_changes_no_place(tmp_path: Path) -> None:
    data = finer_network(1, 1, scale=2)
    ports = [Port(name="a", channels=1)], [Port(name="b", channels=1, scale=2)]
    stages = (
        Linearise(gives=("light",)),
        Network(takes=("light",), gives=("large",), transform="none"),
        Illumination(takes=("large",)),
    )
    at_mm = np.array([-0.2, 0.2])
    plain = grid_psf(np.stack([streak_kernel(0.0)] * 4).reshape(2, 2, 21, 21), at_mm, at_mm)
    psf = replace(_falling(plain), pixel_pitch_um=PITCH_UM)
    extent = Extent(
        width_px=96, height_px=64, pixel_pitch_um=PITCH_UM, optical_centre_px=(30.0, 40.0)
    )
    camera = write_planes_bundle(
        tmp_path,
        stages,
        sensor=planes_sensor(extent=extent),
        psf=psf,
        networks={"restore": (facts_of(data, *ports), data)},
    )
    made = start(camera, made_planes(samples=np.full((1, 64, 96), 0.4, np.float32)))
    gain = read_all(made.rows_of("even")) / read_all(made.rows_of("large"))
    light = illumination_band(psf, made.job.placement.window, 0, 64)
    blocks = gain.reshape(64, 2, 96, 2).mean(axis=(1, 3))
    np.testing.assert_allclose(blocks, 1 / light, rtol=2e-4)


def test_uniform_optics_dim_nothing(tmp_path: Path) -> None:
    psf = replace(uniform_psf(streak_kernel(0.0)), pixel_pitch_um=PITCH_UM)
    stages = (Linearise(gives=("light",)), Illumination(takes=("light",)))
    camera = write_planes_bundle(tmp_path, stages, sensor=planes_sensor(), psf=psf)
    samples = np.random.default_rng(0).random((1, 64, 96), dtype=np.float32)
    np.testing.assert_array_equal(start(camera, made_planes(samples=samples)).fill(), samples)
