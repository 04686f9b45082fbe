"""Depth on the fine grid: nearer to the truth than enlarged maps, with sigmas that hold."""

import cv2
import numpy as np
import pytest

from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.depth import FineSharpener
from camkit.runtime.kinds.spad.golden_captures import stage_set
from camkit.runtime.kinds.spad.sharpen import Sharpener, Way
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.counting import Disturbances, count_times, scaled_to
from camkit.runtime.kinds.spad.twin.photon_twin import seen_by, times_of
from camkit.runtime.kinds.spad.twin.scene import light_of_depth
from tests.spad_bundle import HEIGHT, SCALE, WIDTH

NOTHING = np.zeros((HEIGHT, WIDTH), dtype=bool)
DARK = np.zeros((HEIGHT, WIDTH))


def _scan(
    camera: FineCamera, photons: float, sbr: float, seed: int
) -> tuple[np.ndarray, np.ndarray]:
    """Give the depth of a scene and its counts (h, w, bins)."""
    axis, pulse = times_of(camera)
    depth = stage_set(camera, seed)
    y, x = np.mgrid[: SCALE * HEIGHT, : SCALE * WIDTH]
    albedo = 0.6 + 0.3 * np.sin(x / 9) * np.cos(y / 7)
    mean = scaled_to(seen_by(camera, light_of_depth(depth, albedo, axis, pulse)), photons)
    mean += photons / sbr / axis.bins
    counts = count_times(mean, "gate", Disturbances(), np.random.default_rng(seed))
    return depth, np.ascontiguousarray(counts.transpose(1, 2, 0), dtype=np.float32)


def _metres(times_ps: np.ndarray) -> np.ndarray:
    return np.asarray(times_ps * LIGHT_M_PER_PS / 2)


@pytest.mark.parametrize(("photons", "sbr", "share"), [(30.0, 3.0, 0.8), (1000.0, 3.0, 0.5)])
def test_bins_made_finer_beat_maps_that_are_enlarged(
    camera: FineCamera, photons: float, sbr: float, share: float
) -> None:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way())
    coarse = Sharpener(axis, pulse, Way(pool="1"))
    own, enlarged = [], []
    for seed in range(3):
        depth, counts = _scan(camera, photons, sbr, seed)
        found = fine.cube(counts, DARK, hot=NOTHING, blind=NOTHING).sharpened
        own.append(np.abs(_metres(found.time_of_flight_ps[0]) - depth))
        small = _metres(coarse.strip(counts).time_of_flight_ps[0]).astype(np.float32)
        # a sample lies at sub-pixel 2 of its 4
        places = np.array([[SCALE, 0, 2], [0, SCALE, 2]], np.float64)
        size = (SCALE * WIDTH, SCALE * HEIGHT)
        large = cv2.warpAffine(small, places, size, borderMode=cv2.BORDER_REPLICATE)
        enlarged.append(np.abs(large - depth))
    assert np.mean(own) < share * np.mean(enlarged)


@pytest.mark.parametrize("photons", [100.0, 1000.0])
def test_sigma_holds_two_thirds_of_the_errors(camera: FineCamera, photons: float) -> None:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way())
    ratios = []
    for seed in range(4):
        depth, counts = _scan(camera, photons, 3.0, seed)
        found = fine.cube(counts, DARK, hot=NOTHING, blind=NOTHING).sharpened
        error = np.abs(found.time_of_flight_ps[0] - 2 * depth / LIGHT_M_PER_PS)
        ratios.append((error / found.sigma_ps[0])[found.valid[0]])
    assert 0.88 < np.quantile(np.concatenate(ratios), 0.6827) < 1.12


def test_background_alone_is_believed_nowhere(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way())
    rng = np.random.default_rng(1)
    alarms = [
        fine.cube(
            rng.poisson(0.4, (HEIGHT, WIDTH, axis.bins)).astype(np.float32),
            DARK,
            hot=NOTHING,
            blind=NOTHING,
        ).sharpened.valid.mean()
        for _ in range(6)
    ]
    assert np.mean(alarms) <= 2e-3


def test_a_hot_pixel_is_painted_over_and_not_believed(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    depth, counts = _scan(camera, 300.0, 10.0, 1)
    counts[7, 9] += np.random.default_rng(0).poisson(40.0, axis.bins)
    fine = FineSharpener(camera, axis, pulse, Way())
    found = fine.cube(counts, DARK, hot=NOTHING, blind=NOTHING).sharpened
    block = np.s_[28:32, 36:40]
    assert found.hot[0][block].all()
    assert found.hot[0].sum() == SCALE**2
    assert not found.valid[0][block].any()
    around = np.abs(_metres(found.time_of_flight_ps[0]) - depth)[20:40, 28:48]
    assert np.median(around) < 0.002


def test_amplitude_and_intensity_are_photons_of_a_pixel(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    wall = np.full((SCALE * HEIGHT, SCALE * WIDTH), 0.14)
    light = seen_by(camera, light_of_depth(wall, np.ones_like(wall), axis, pulse))
    mean = scaled_to(light, 500.0) + 1.0
    counts = np.random.default_rng(0).poisson(mean).transpose(1, 2, 0).astype(np.float32)
    found = (
        FineSharpener(camera, axis, pulse, Way())
        .cube(np.ascontiguousarray(counts), DARK, hot=NOTHING, blind=NOTHING)
        .sharpened
    )
    assert found.intensity.mean() == pytest.approx(counts.sum(axis=2).mean(), rel=0.01)
    assert found.amplitude.mean() == pytest.approx(500.0, rel=0.02)
    assert found.background.mean() == pytest.approx(1.0, rel=0.05)


def test_few_photons_are_read_linearly_and_many_by_the_network(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way(), size="S")
    always = FineSharpener(camera, axis, pulse, Way(), size="S", always=True)
    for photons, size in ((20.0, None), (300.0, "S")):
        _, counts = _scan(camera, photons, 10.0, 3)
        made = fine.cube(counts, DARK, hot=NOTHING, blind=NOTHING)
        assert made.size == size
        assert made.photons == pytest.approx(photons, rel=0.2)
        assert always.cube(counts, DARK, hot=NOTHING, blind=NOTHING).size == "S"


def test_stated_dark_counts_are_noise_too(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    fine = FineSharpener(camera, axis, pulse, Way())
    rng = np.random.default_rng(5)
    ratios: dict[float, list[np.ndarray]] = {0.0: [], 4.0: []}
    for seed in range(3):
        depth, counts = _scan(camera, 300.0, 10.0, seed)
        counts = counts + rng.poisson(4.0, counts.shape).astype(np.float32)
        for stated, of_stated in ratios.items():
            found = fine.cube(counts, DARK + stated, hot=NOTHING, blind=NOTHING).sharpened
            error = np.abs(found.time_of_flight_ps[0] - 2 * depth / LIGHT_M_PER_PS)
            of_stated.append((error / found.sigma_ps[0])[found.valid[0]])
    unstated, told = (np.quantile(np.concatenate(ratios[dark]), 0.6827) for dark in (0.0, 4.0))
    assert told == pytest.approx(unstated, rel=0.1)


@pytest.mark.parametrize(("photons", "dark"), [(60.0, 0.0), (300.0, 0.0), (300.0, 0.4)])
def test_dark_sky_beside_a_wall_is_believed_nowhere(
    camera: FineCamera, photons: float, dark: float
) -> None:
    axis, pulse = times_of(camera)
    shape = (SCALE * HEIGHT, SCALE * WIDTH)
    albedo = np.full(shape, 1e-9)
    albedo[:, : shape[1] // 4] = 1
    light = seen_by(camera, light_of_depth(np.full(shape, 0.14), albedo, axis, pulse))
    mean = photons * light / light.sum(axis=0).max() + 0.02 + dark
    fine = FineSharpener(camera, axis, pulse, Way())
    alarms = []
    for seed in range(8):
        counts = np.random.default_rng(seed).poisson(mean).transpose(1, 2, 0).astype(np.float32)
        counts = np.ascontiguousarray(counts)
        found = fine.cube(counts, DARK + dark, hot=NOTHING, blind=NOTHING).sharpened
        assert found.valid[0][:, : shape[1] // 4 - 8].mean() > 0.9
        alarms.append(found.valid[0][:, shape[1] // 2 :].mean())
    assert np.mean(alarms) <= 2e-3


def test_a_blind_pixel_does_not_reach_its_neighbours(camera: FineCamera) -> None:
    axis, pulse = times_of(camera)
    depth, counts = _scan(camera, 300.0, 10.0, 2)
    spoilt = counts.copy()
    spoilt[8, 10] *= 20
    spoilt[8, 10, spoilt[8, 10].argmax() - 4 :] = 0
    blind = NOTHING.copy()
    blind[8, 10] = True
    fine = FineSharpener(camera, axis, pulse, Way())
    found = fine.cube(spoilt, DARK, hot=NOTHING, blind=blind).sharpened
    assert not found.valid[0][32:36, 40:44].any()
    error = np.abs(_metres(found.time_of_flight_ps[0]) - depth)[24:44, 32:52]
    sound = fine.cube(counts, DARK, hot=NOTHING, blind=NOTHING).sharpened
    usual = np.abs(_metres(sound.time_of_flight_ps[0]) - depth)[24:44, 32:52]
    assert np.quantile(error, 0.9) < 2 * np.quantile(usual, 0.9) + 0.002
