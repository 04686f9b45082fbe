"""The exposure that is found saturates that share of the pixels of a real capture."""

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.twin.saturation import exposure_for_share, saturation_of
from camkit.runtime.twin.simulate import SimulationOptions, simulate
from camkit.scenes.saturation import with_exposure
from tests.camera_factory import delta_psf, make_sensor
from tests.planes_bundle import planes_sensor
from tests.psf_factory import uniform_psf

QUIET = SimulationOptions(noise=False, distort=False, vignette=False)


@pytest.mark.parametrize("share", [0.015, 0.1])
def test_the_share_clips_in_the_planes_of_a_perfect_camera(share: float) -> None:
    """Of an ideal lens and a sensor that sees all colours at every pixel, the capture itself."""
    sensor = planes_sensor(("R", "G", "B"), full_well_e=1e6)
    delta = np.zeros((3, 3), np.float32)
    delta[1, 1] = 1
    scene = night_scene(4, sensor.height_px, sensor.width_px)
    found = exposure_for_share(scene, sensor, share)
    exposed = with_exposure(scene, found.exposure)
    assert found.peak == pytest.approx(exposed.max())
    taken = simulate(exposed, sensor, uniform_psf(delta, channels=3), QUIET).samples
    clipped = (taken == sensor.white_level).any(axis=0).mean()
    # the converter rounds what is half a step below white up to white
    assert found.saturated_fraction <= clipped < found.saturated_fraction + 0.01


def test_each_site_of_a_mosaic_clips_where_its_own_colour_does() -> None:
    sensor = make_sensor(96, 64)
    scene = night_scene(1, 64, 96)
    found = exposure_for_share(scene, sensor, 0.05)
    taken = simulate(with_exposure(scene, found.exposure), sensor, delta_psf(sensor), QUIET)
    clean = taken.clean / np.array(taken.white_balance, np.float32)[:, None, None]
    assert (clean > 1).any(axis=0).mean() == pytest.approx(found.saturated_fraction, abs=2e-3)
    sites = (taken.samples == sensor.white_level).mean()
    assert 0 < sites <= found.saturated_fraction


def test_what_an_exposure_saturates_is_what_was_asked_of_it() -> None:
    sensor = make_sensor()
    scene = night_scene(2, 64, 96)
    found = exposure_for_share(scene, sensor, 0.02)
    assert saturation_of(scene, sensor, found.exposure, ceiling=256.0) == found
    assert saturation_of(scene, sensor, found.exposure).peak >= found.peak
    assert saturation_of(scene, sensor, found.exposure / 3).saturated_fraction < 0.02


def test_a_flat_scene_is_refused() -> None:
    with pytest.raises(ContractError, match="no exposure saturates"):
        exposure_for_share(np.full((3, 20, 20), 0.5, np.float32), make_sensor(), 0.015)


def test_grey_sensors_saturate_by_luminance() -> None:
    sensor = planes_sensor(("Y",))
    scene = np.zeros((3, 10, 10), np.float32)
    scene[:, 0, :4] = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0.5]]).T
    assert exposure_for_share(scene, sensor, 0.01).exposure == pytest.approx(1 / 0.7152, rel=2e-3)
