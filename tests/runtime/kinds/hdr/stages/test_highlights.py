"""Lights found before the first row: the same bits whatever bands, threads and memory."""

import json
import tracemalloc
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import (
    Color,
    Demosaic,
    Highlights,
    Linearise,
    Repair,
    WhiteBalance,
    Wiener,
)
from camkit.colorimetry import rec709_from_camera
from camkit.errors import ContractError
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.cancel import Cancelled
from camkit.runtime.capture import Capture
from camkit.runtime.job.walker import Walk
from camkit.runtime.kinds.hdr.stages import highlights
from camkit.runtime.kinds.hdr.streaks.cells import cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.kernels import streak_kernels
from camkit.runtime.kinds.hdr.streaks.painting import Painter
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, recover
from camkit.runtime.kinds.hdr.streaks.rims import MOST_OVER, near_clipped, no_brighter
from camkit.runtime.plan.decision import Subject, Work
from camkit.runtime.plan.speed import Speed
from camkit.runtime.signal.demosaic import apply_gains, demosaic
from tests.hdr_bundle import DEEP_MM, SIZE_PX, hdr_stages_from_samples, write_hdr_bundle
from tests.job_factory import made_job, start, stream_of
from tests.streak_factory import blurred, captured, star, star_kernels, street, with_lamps

WIDTH, HEIGHT = SIZE_PX
LAMPS = [
    (60, 70, 4.0, (40.0, 30.0, 20.0)),
    (120, 180, 2.0, (200.0, 150.0, 90.0)),
]
GAINS = (1.9, 1.0, 1.5)
WHITE, BLACK = 4095, 256


@pytest.fixture(scope="module")
def camera(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    return write_hdr_bundle(tmp_path_factory.mktemp("camera"))


@pytest.fixture(scope="module")
def light() -> FloatArray:
    return blurred(with_lamps(street(HEIGHT, WIDTH), LAMPS), star())


def _mosaic(light: FloatArray, **facts: Any) -> Capture:
    samples, _ = captured(light, "RGGB")
    stated: dict[str, Any] = {
        "samples": np.rint(samples[0] * (WHITE - BLACK) + BLACK).astype(np.uint16),
        "cfa": "RGGB",
        "black_level": np.full((2, 2), BLACK, np.float32),
        "white_level": float(WHITE),
        "white_balance": GAINS,
        "iso": 100.0,
    }
    return Capture(**(stated | facts))


def _planes(light: FloatArray) -> Capture:
    return Capture(
        samples=np.rint(np.minimum(light, 1) * WHITE).astype(np.uint16),
        cfa=None,
        black_level=np.zeros(3, np.float32),
        white_level=float(WHITE),
        white_balance=GAINS,
        iso=100.0,
    )


def _slowly(capture: Capture, camera: Bundle, planes: FloatArray) -> tuple[FloatArray, Recovery]:
    """Put lights into whole planes."""
    sensor, sites = camera.manifest.sensor, sample_sites(capture.cfa)
    assert sensor.type == "bayer"
    light, over = (
        rows(0, capture.height).reshape(-1, capture.height, capture.width)
        for rows in (capture.linear_rows, capture.saturated_rows)
    )
    dense = color_kernels(camera.psf, *sensor.response_arrays()).at(0, 0)
    found = recover(
        cells_of(light, over, sites), streak_kernels(dense, sites, camera.streaks.reach_px)
    )
    lit = planes.copy()
    matrix = np.eye(3) if capture.cfa is None else rec709_from_camera(np.array(sensor.color_matrix))
    Painter(found, matrix).paint(lit, 0, GAINS)
    return lit, found


def _plane(capture: Capture, camera: Bundle, name: str, **choices: Any) -> FloatArray:
    """Give a plane of a walk."""
    job = made_job(capture, camera, **choices)
    walk = Walk(job)
    return np.concatenate(list(walk.stream(name).bands()), axis=1)


@pytest.mark.parametrize("made", [_mosaic, _planes], ids=["mosaic", "linear RGB"])
def test_bands_are_those_of_the_whole_picture_painted(
    made: Callable[[FloatArray], Capture], camera: Bundle, light: FloatArray
) -> None:
    capture = made(light)
    rgb = _plane(capture, camera, "rgb")
    wanted, found = _slowly(capture, camera, rgb)
    assert found.regions
    assert wanted.max() > 20
    np.testing.assert_array_equal(_plane(capture, camera, "lit"), wanted)


def test_lights_are_looked_for_before_any_gain(
    tmp_path: Path, light: FloatArray, camera: Bundle
) -> None:
    """A repair behind the white balance gives no light as the sensor saw it."""
    stages = (
        Linearise(),
        WhiteBalance(takes=("light",)),
        Repair(takes=("balanced", "clipped")),
        Demosaic(takes=("sound",), method="fast"),
        Highlights(),
        Wiener(takes=("lit", "unknown"), prior_scale=1e-3, prior_exponent=2.0),
        Color(takes=("restored",)),
    )
    other = write_hdr_bundle(tmp_path, stages=stages)
    capture = _mosaic(light)
    wanted, _ = _slowly(capture, camera, _plane(capture, other, "rgb"))
    np.testing.assert_array_equal(_plane(capture, other, "lit"), wanted)


def test_threads_and_memory_change_no_bit(camera: Bundle, light: FloatArray) -> None:
    capture = _mosaic(light)
    one = start(camera, capture, threads=1).fill()
    for choices in ({"threads": 2}, {"threads": 1, "max_mem_bytes": 400_000_000}):
        np.testing.assert_array_equal(start(camera, capture, **choices).fill(), one)


def test_the_cells_of_bands_are_those_of_the_whole(
    camera: Bundle, light: FloatArray, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = _mosaic(light)
    whole = start(camera, capture).fill()
    monkeypatch.setattr(highlights, "BAND_ROWS", 14)
    np.testing.assert_array_equal(start(camera, capture).fill(), whole)


def test_lamps_come_back_and_the_record_says_so(camera: Bundle, light: FloatArray) -> None:
    capture = _mosaic(light)
    work = start(camera, capture)
    work.fill()
    told = work.sections["hdr"]
    _, found = _slowly(capture, camera, np.zeros((3, HEIGHT, WIDTH), np.float32))
    assert told == found.to_json()
    assert told["regions"] == len(found.regions) > 0
    assert told["peak"] > 50
    assert json.loads(json.dumps(told)) == told


def test_the_record_is_there_with_the_first_band(camera: Bundle, light: FloatArray) -> None:
    """Whoever counts rows never asks for a band behind the last one."""
    job = made_job(_mosaic(light), camera)
    walk = Walk(job)
    bands = walk.stream("lit").bands()
    assert "hdr" not in job.log.sections
    next(iter(bands))
    assert job.log.sections["hdr"]["regions"] > 0


def test_what_could_not_be_told_is_warned_of_once_the_rows_are_out(camera: Bundle) -> None:
    scene = with_lamps(street(HEIGHT, WIDTH), [(2, 70, 4.0, (40.0, 40.0, 40.0))])
    work = start(camera, _mosaic(blurred(scene, star())))
    work.fill()
    assert any("a light reaches the border" in note for note in work.warnings)


def test_what_burnt_out_is_neutral_where_lights_cannot_be_told(camera: Bundle) -> None:
    scene = street(HEIGHT, WIDTH)
    scene[:, :, WIDTH // 2 :] = 6 / np.array(GAINS, np.float32)[:, None, None]
    capture = _mosaic(blurred(scene, star()))
    work = start(camera, capture)
    work.fill()
    assert any("of the picture is clipped" in note for note in work.warnings)
    burnt = _plane(capture, camera, "lit")[:, 8:-8, WIDTH // 2 + 8 : -8]
    assert burnt.min() > 1
    assert np.ptp(burnt, axis=0).max() < 0.1 * burnt.max()


def test_nothing_clipped_costs_no_window(camera: Bundle) -> None:
    work = start(camera, _mosaic(blurred(street(HEIGHT, WIDTH), star())))
    work.fill()
    assert work.sections["hdr"]["regions"] == 0
    assert not any("lights" in note for note in work.warnings)


def test_whoever_waits_may_stop_before_a_window(camera: Bundle, light: FloatArray) -> None:
    job = replace(made_job(_mosaic(light), camera), cancel=lambda: True)
    walk = Walk(job)
    with pytest.raises(Cancelled):
        list(walk.stream("lit").bands())
    assert "hdr" not in job.log.sections


def test_the_depth_asked_for_is_that_of_the_kernels(tmp_path: Path, light: FloatArray) -> None:
    """The mean of all depths is taken unless one is asked for."""
    camera = write_hdr_bundle(tmp_path, depths_mm=DEEP_MM)
    dense = camera.streaks.dense()
    dense /= dense.sum((-2, -1), keepdims=True)
    sites = sample_sites("RGGB")
    for depth_m, kernel in ((1.0, dense[0, 0]), (5.0, dense[1, 0]), (None, dense[:, 0].mean(0))):
        job = made_job(_mosaic(light), camera, depth_m=depth_m)
        found = highlights._kernels(job)
        wanted = streak_kernels(np.stack([kernel] * 3), sites, camera.streaks.reach_px)
        np.testing.assert_allclose(found.fine.whole, wanted.fine.whole, atol=1e-6)
        assert found.reach_px == camera.streaks.reach_px
    lit = [_plane(_mosaic(light), camera, "lit", depth_m=depth_m) for depth_m in (1.0, 5.0)]
    assert (lit[0] != lit[1]).any()


def test_a_capture_of_other_pixels_has_kernels_of_its_scale(
    camera: Bundle, light: FloatArray
) -> None:
    """At half the pixels, arms are half as long."""
    half = light[:, ::2, ::2]
    job = made_job(replace(_mosaic(half), sensor_size_px=None), camera, assume="scale")
    assert job.placement.kernel_scale == 0.5
    kernels = highlights._kernels(job)
    full = highlights._kernels(made_job(_mosaic(light), camera))
    assert kernels.reach_px == round(full.reach_px / 2)
    assert len(kernels.fine.whole[0]) < 0.6 * len(full.fine.whole[0])


def test_it_says_what_it_holds(camera: Bundle, light: FloatArray) -> None:
    work = highlights.prepare(_entry(camera), made_job(_mosaic(light), camera))
    assert work.first_bytes == highlights.first_bytes(HEIGHT * WIDTH)
    assert work.fit is None
    assert work.warnings() == ()


def test_a_picture_that_is_one_window_holds_what_is_stated() -> None:
    """But for what its windows are wider than it, which is little in larger ones."""
    side, middles = 384, range(16, 384, 32)
    lamps = [(y, x, 3.0, (50.0, 50.0, 50.0)) for y in middles for x in middles]
    samples, over = captured(blurred(with_lamps(street(side, side), lamps), star()), "RGGB")
    kernels, sites = star_kernels(), sample_sites("RGGB")
    planes = np.zeros((3, side, side), np.float32)
    tracemalloc.start()
    found = recover(cells_of(samples, over, sites), kernels)
    assert found.to_json()["window_fraction"] == 1
    painter = Painter(found)
    _, peak = tracemalloc.get_traced_memory()
    del found
    painter.paint(planes, 0, GAINS)
    painter.paint(planes[:, :1], 0, GAINS)
    kept, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert 0.25 < kept / (highlights.KEPT_BYTES_PER_PX * side * side) < 1
    held = highlights.first_bytes(side * side)
    assert 0.7 * held < peak < 1.1 * held
    large = 24_000_000
    assert highlights.first_bytes(large) == highlights.BYTES_PER_PX * large


def _entry(camera: Bundle) -> Highlights:
    (entry,) = (stage for stage in camera.manifest.stages if isinstance(stage, Highlights))
    return entry


@pytest.mark.parametrize("size", [(1, 1), (3, 40), (40, 3)])
def test_a_capture_smaller_than_a_cell_is_left_as_it_is(
    camera: Bundle, size: tuple[int, int]
) -> None:
    capture = _mosaic(np.full((3, *size), 0.3, np.float32))
    work = start(camera, capture, assume="centre")
    developed = start(camera, capture, assume="centre", method="develop").fill()
    np.testing.assert_array_equal(work.fill(), developed)
    (note,) = [note for note in work.warnings if "lights" in note]
    assert f"the picture has {size[1]} x {size[0]}" in note
    assert "hdr" not in work.sections


@pytest.mark.parametrize("size", [(4, 4), (5, 7), (4, 61)])
def test_the_smallest_captures_are_taken(camera: Bundle, size: tuple[int, int]) -> None:
    bright = np.full((3, *size), 0.3, np.float32)
    bright[:, 1:3, 1:3] = 9
    got = start(camera, _mosaic(bright), assume="centre").fill()
    assert got.shape == (3, *size)
    assert np.isfinite(got).all()


def test_a_bundle_without_a_mask_is_refused(tmp_path: Path, light: FloatArray) -> None:
    stages = (
        Linearise(gives=("light",)),
        WhiteBalance(takes=("light",)),
        Demosaic(method="fast"),
        Highlights(),
        Color(takes=("lit",)),
    )
    camera = write_hdr_bundle(tmp_path, stages=stages)
    with pytest.raises(ContractError, match="a stage that gives light and a mask"):
        start(camera, _mosaic(light))


def test_physics_is_a_method_and_others_are_refused(camera: Bundle, light: FloatArray) -> None:
    capture = _mosaic(light)
    usual = start(camera, capture).fill()
    np.testing.assert_array_equal(start(camera, capture, method="physics").fill(), usual)
    with pytest.raises(ContractError, match="method must be one of physics"):
        start(camera, capture, method="wiener")


def test_rows_that_others_read_too_are_not_changed(camera: Bundle, light: FloatArray) -> None:
    """The bands belong to the stage: planes that are shared are copied first."""
    capture = _planes(light)
    job = made_job(capture, camera)
    walk = Walk(job)
    rgb = np.concatenate(list(walk.stream("rgb").bands()), axis=1)
    before = rgb.copy()
    (lit,) = highlights.prepare(_entry(camera), job).run([stream_of(rgb, gains=GAINS)])
    made = np.concatenate(list(lit.bands()), axis=1)
    np.testing.assert_array_equal(rgb, before)
    assert (made != before).any()


def test_its_seconds_grow_with_the_picture(camera: Bundle, light: FloatArray) -> None:
    job, speed = (
        made_job(_mosaic(light), camera),
        Speed(block_s=1, clipped_block_s=1, rest_s_per_mp=0.1, threads=1),
    )
    small = Subject(
        bundle=camera,
        options=job.options,
        height_px=1000,
        width_px=1000,
        placement=job.placement,
    )
    large = replace(small, height_px=4000, width_px=6000)
    found = [highlights.seconds(_entry(camera), s, Work(), speed) for s in (small, large)]
    assert found == pytest.approx([0.1 * highlights.REST_SHARE, 2.4 * highlights.REST_SHARE])


# ------------------------------------------------------------------ streaks from the samples


@pytest.fixture(scope="module")
def sampled(tmp_path_factory: pytest.TempPathFactory) -> Bundle:
    """Return the camera whose streaks are taken from its mosaic."""
    folder = tmp_path_factory.mktemp("sampled")
    return write_hdr_bundle(folder, stages=hdr_stages_from_samples(), format_version="2.8")


def test_bands_threads_and_memory_change_no_bit_of_cleared_samples(
    sampled: Bundle, light: FloatArray, monkeypatch: pytest.MonkeyPatch
) -> None:
    capture = _mosaic(light)
    whole = start(sampled, capture, threads=1).fill()
    for choices in ({"threads": 2}, {"threads": 1, "max_mem_bytes": 400_000_000}):
        np.testing.assert_array_equal(start(sampled, capture, **choices).fill(), whole)
    for cells, cleared, lit in ((14, 8, 30), (34, 40, 7)):
        monkeypatch.setattr(highlights, "BAND_ROWS", cells)
        monkeypatch.setattr(highlights, "CLEARED_ROWS", cleared)
        monkeypatch.setattr(highlights, "LIT_ROWS", lit)
        np.testing.assert_array_equal(start(sampled, capture).fill(), whole)


def test_cleared_samples_are_those_of_the_whole_mosaic(sampled: Bundle, light: FloatArray) -> None:
    """The slow twin: the whole mosaic cleared, demosaicked, lit."""
    capture = _mosaic(light)
    sensor, sites = sampled.manifest.sensor, sample_sites("RGGB")
    assert sensor.type == "bayer"
    samples, over = capture.linear_rows(0, HEIGHT), capture.saturated_rows(0, HEIGHT)
    dense = color_kernels(sampled.psf, *sensor.response_arrays()).at(0, 0)
    kernels = streak_kernels(dense, sites, sampled.streaks.reach_px)
    found = recover(cells_of(samples[None], over[None], sites), kernels, least_samples=1)
    painter = Painter(found, rec709_from_camera(np.array(sensor.color_matrix)))
    cleared = samples.copy()
    painter.clear(cleared, over, 0, sites)
    apply_gains(cleared, "RGGB", GAINS)
    wanted = demosaic(cleared, "RGGB", "quality")
    painter.light_up(wanted, over, 0, GAINS)
    no_brighter(wanted, _plane(capture, sampled, "rgb"), near_clipped(over))
    got = _plane(capture, sampled, "lit")
    np.testing.assert_allclose(got, wanted, rtol=1e-5, atol=1e-6)


def test_streaks_taken_from_samples_leave_less_than_those_taken_from_colours(
    sampled: Bundle, camera: Bundle, light: FloatArray
) -> None:
    """Away from lamps, whose blur stays: in the mean, and at the worst."""
    scene = with_lamps(street(HEIGHT, WIDTH), LAMPS)
    y, x = np.indices((HEIGHT, WIDTH))
    away = np.min([np.hypot(y - top, x - left) for top, left, _, _ in LAMPS], axis=0) > 8
    gains, capture = np.array(GAINS)[:, None, None], _mosaic(light)
    ours, theirs = (
        np.abs(_plane(capture, bundle, "lit") / gains - scene)[:, away]
        for bundle in (sampled, camera)
    )
    assert ours.mean() < 0.96 * theirs.mean()
    assert ours.max() < 0.8 * theirs.max()


def test_away_from_lights_nothing_is_brighter_than_it_was_seen(
    sampled: Bundle, light: FloatArray
) -> None:
    """Networks act where it is, and are left out where nothing clipped."""
    capture = _mosaic(light)
    lit, rgb = (_plane(capture, sampled, name) for name in ("lit", "rgb"))
    far = ~near_clipped(capture.saturated_rows(0, HEIGHT))
    assert far.mean() > 0.5
    assert (lit <= MOST_OVER * np.maximum(rgb, 0) + 1e-6)[:, far].all()


def test_planes_that_come_as_such_are_painted_as_ever(
    sampled: Bundle, camera: Bundle, light: FloatArray
) -> None:
    capture = _planes(light)
    got, wanted = (_plane(capture, bundle, "lit") for bundle in (sampled, camera))
    np.testing.assert_array_equal(got, wanted)


def test_lights_that_cannot_be_told_are_neutral_behind_samples_too(sampled: Bundle) -> None:
    scene = street(HEIGHT, WIDTH)
    scene[:, :, WIDTH // 2 :] = 6 / np.array(GAINS, np.float32)[:, None, None]
    burnt = _plane(_mosaic(blurred(scene, star())), sampled, "lit")[:, 8:-8, WIDTH // 2 + 8 : -8]
    assert burnt.min() > 1
    assert np.ptp(burnt, axis=0).max() < 0.1 * burnt.max()


def test_developed_and_too_small_captures_take_the_colours(sampled: Bundle) -> None:
    capture = _mosaic(np.full((3, 3, 40), 0.3, np.float32))
    developed = start(sampled, capture, assume="centre", method="develop").fill()
    np.testing.assert_array_equal(start(sampled, capture, assume="centre").fill(), developed)
