"""A lens profile about an optical centre off the middle: every way of computing gives one picture.

Whole and tiled, one thread and two, rows asked for in any bands, crops by their origin.
"""

from pathlib import Path

import numpy as np
import pytest

from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import Extent
from camkit.bundle.writer import write_bundle
from camkit.runtime.geometry.distortion import distort_points, undistort_points
from camkit.runtime.geometry.warp import undistort_bands
from camkit.runtime.rows import ArrayRows
from tests.bundle_factory import PITCH_UM, tiny_sensor
from tests.job_factory import made_mosaic, start
from tests.profile_bundle import profile_manifest, tiny_profile

SIZE = (320, 400)
CENTRE_PX = (140.0, 260.0)


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    sensor = tiny_sensor().model_copy(
        update={
            "extent": Extent(
                width_px=SIZE[1],
                height_px=SIZE[0],
                pixel_pitch_um=PITCH_UM,
                optical_centre_px=CENTRE_PX,
            )
        }
    )
    distortion = tiny_profile().distortion
    assert distortion is not None
    wide = distortion.model_copy(update={"radius_mm": 1.6})
    manifest = profile_manifest(sensor=sensor, optics=tiny_profile(distortion=wide))
    return write_bundle(tmp_path_factory.mktemp("x") / "plain.camkit", manifest, {})


def _capture() -> np.ndarray:
    return np.random.default_rng(1).integers(100, 900, SIZE, dtype=np.uint16)


def test_tiles_threads_and_memory_give_the_bits_of_the_whole(camera: Bundle) -> None:
    taken = made_mosaic(samples=_capture())
    whole = start(camera, taken, threads=1).fill()
    for choices in ({"threads": 2}, {"threads": 1, "max_mem_bytes": 2**29}):
        np.testing.assert_array_equal(start(camera, taken, **choices).fill(), whole)
    rng = np.random.default_rng(2)
    light = rng.random((3, *SIZE), dtype=np.float32)
    window = start(camera, taken).job.placement.window
    made = {
        rows: np.concatenate(
            list(undistort_bands(ArrayRows(light), camera.distortion, window, band_rows=rows)), 1
        )
        for rows in (8, 64, 512)
    }
    np.testing.assert_array_equal(made[8], made[512])
    np.testing.assert_array_equal(made[64], made[512])


def test_the_picture_is_undistorted_about_the_optical_centre(
    camera: Bundle, tmp_path: Path
) -> None:
    """A spot lies, but for one shift of the picture, where the model says from the centre."""
    spots = [(60, 60), (340, 100), (200, 280)]
    found = []
    for x0, y0 in spots:
        y, x = np.mgrid[0 : SIZE[0], 0 : SIZE[1]]
        light = 64 + 800 * np.exp(-((x - x0) ** 2 + (y - y0) ** 2) / 18)
        picture = start(camera, made_mosaic(samples=light.astype(np.uint16))).fill()
        grey = np.clip(picture[1] - 0.02 * picture[1].max(), 0, None)
        found.append([float((grey * axis).sum() / grey.sum()) for axis in (x, y)])
    ideal = np.array(found) - CENTRE_PX
    # the shift that centres the picture is the one unknown: it drops out of differences
    placed = distort_points(
        (ideal - _shift(camera)) * PITCH_UM * 1e-3, camera.distortion, channel=1
    ) / (PITCH_UM * 1e-3)
    np.testing.assert_allclose(placed + CENTRE_PX, spots, atol=0.1)
    moved = np.array(found) - spots
    assert np.abs(moved - moved[0]).max() > 1


def _shift(camera: Bundle) -> np.ndarray:
    """Give by how many pixels the ideal picture is moved to keep its middle where it was."""
    middle = (np.array([SIZE[1] - 1, SIZE[0] - 1]) / 2 - CENTRE_PX) * PITCH_UM * 1e-3
    ideal = undistort_points(middle, camera.distortion, channel=1)
    return np.asarray((middle - ideal) / (PITCH_UM * 1e-3))


def test_light_is_evened_about_the_optical_centre(camera: Bundle) -> None:
    flat = made_mosaic(samples=np.full(SIZE, 500, np.uint16))
    even = start(camera, flat, undistort=False).fill()[1]
    kept = start(camera, flat, undistort=False, vignetting=False).fill()[1]
    brightened = even / kept
    y, x = np.unravel_index(int(brightened.argmin()), brightened.shape)
    assert (abs(x - CENTRE_PX[0]), abs(y - CENTRE_PX[1])) <= (8, 8)
    heights = np.hypot(np.arange(SIZE[1]) - CENTRE_PX[0], 0) * PITCH_UM * 1e-3
    light = np.interp(heights**2, [0, 0.04, 0.16], [1, 0.9, 0.6])
    np.testing.assert_allclose(brightened[260], 1 / light, rtol=2e-3)
