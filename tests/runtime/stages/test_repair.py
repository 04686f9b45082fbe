"""Broken samples are replaced row by row as in the whole, and what stays unknown is told."""

import numpy as np
import pytest

from camkit.bundle.stages import Linearise, Repair
from camkit.runtime.capture import Capture
from camkit.runtime.job.stream import Stream
from camkit.runtime.rows import RollingRows, Rows
from camkit.runtime.signal.noise import repair_mosaic, repair_planes
from camkit.runtime.stages.repair import SoundRows
from tests.job_factory import (
    captured,
    made_job,
    made_mosaic,
    made_planes,
    read_all,
    run_stage,
    stream_of,
)

HEIGHT = 70


def _mosaic() -> Capture:
    samples = np.random.default_rng(0).integers(300, 500, (HEIGHT, 64)).astype(np.uint16)
    samples[9::20, 11::20] = 1000  # alone far above all around them: broken
    samples[30:40, 30:40] = 1023  # a light that clips
    samples[46:55, 15:26] = 400
    samples[50, 20] = 1023  # clipped and alone
    return made_mosaic(samples=samples, cfa="GRBG")


def _planes() -> Capture:
    samples = np.random.default_rng(1).random((3, HEIGHT, 64), dtype=np.float32)
    samples[1, 20, 20] = np.nan
    return made_planes(samples=samples)


CAPTURES = {"mosaic": _mosaic(), "planes": _planes()}


def _repaired(capture: Capture, threads: int = 1) -> tuple[Stream, Stream, SoundRows]:
    job = made_job(capture, threads=threads)
    taken = run_stage(Linearise(), job, captured(capture))
    sound, unknown = run_stage(Repair(), job, *taken)
    assert isinstance(sound.source, SoundRows)
    return sound, unknown, sound.source


def _whole(capture: Capture) -> tuple[Rows, Rows]:
    """Give the picture repaired in one piece, and what was replaced."""
    light = capture.linear_rows(0, HEIGHT)
    if capture.cfa is None:
        return repair_planes(light)
    sound, broken = repair_mosaic(light)
    return sound[None], broken[None]


@pytest.mark.parametrize("capture", CAPTURES.values(), ids=CAPTURES.keys())
@pytest.mark.parametrize(("threads", "step"), [(1, 1), (1, 9), (2, 33), (3, 70)])
def test_bands_on_any_number_of_threads_are_the_whole_and_count_each_sample_once(
    capture: Capture, threads: int, step: int
) -> None:
    sound, unknown, source = _repaired(capture, threads)
    wanted, broken = _whole(capture)
    np.testing.assert_array_equal(read_all(sound.rows(), step), wanted)
    assert source.repaired == np.count_nonzero(broken) > 0
    clipped = np.broadcast_to(capture.saturated_rows(0, HEIGHT), broken.shape)
    np.testing.assert_array_equal(read_all(unknown.rows(), step), clipped & ~broken)


@pytest.mark.parametrize("capture", CAPTURES.values(), ids=CAPTURES.keys())
@pytest.mark.parametrize("first", [1, 19, 50, 69])
def test_rows_equal_the_whole_wherever_reading_begins(capture: Capture, first: int) -> None:
    sound, unknown, source = _repaired(capture)
    wanted, broken = _whole(capture)
    np.testing.assert_array_equal(sound.rows().read(first, HEIGHT), wanted[:, first:])
    assert source.repaired == np.count_nonzero(broken[:, first:])
    clipped = np.broadcast_to(capture.saturated_rows(0, HEIGHT), broken.shape)
    left = unknown.rows().read(first, HEIGHT)
    np.testing.assert_array_equal(left, (clipped & ~broken)[:, first:])


def test_readings_that_overlap_count_each_sample_once() -> None:
    sound, _, source = _repaired(_mosaic())
    rows = sound.rows()
    for top in range(0, 64, 4):
        rows.read(max(top - 8, 0), top + 6)
    assert source.repaired == np.count_nonzero(_whole(_mosaic())[1][:, :66])


@pytest.mark.parametrize("step", [70, 33])
def test_a_hot_pixel_is_known_from_its_neighbours_and_a_clipped_light_is_not(step: int) -> None:
    capture = _mosaic()
    sound, unknown, _ = _repaired(capture, threads=2)
    read_all(sound.rows(), step)
    clipped = capture.saturated_rows(0, HEIGHT)
    left = unknown.rows().read(0, HEIGHT)[0]
    assert clipped[50, 20]
    assert not left[50, 20]
    assert left[32:38, 32:38].all()
    np.testing.assert_array_equal(np.argwhere(clipped & ~left), [[50, 20]])
    again = _repaired(capture)[1].rows().read(45, 60)[0]
    np.testing.assert_array_equal(again, left[45:60])


@pytest.mark.parametrize("ahead", [10, 40, 70])
def test_the_mask_may_be_read_before_the_rows(ahead: int) -> None:
    """Whoever asks for the mask first gets it, and the rows behind it are not counted twice."""
    capture = _mosaic()
    job = made_job(capture)
    sound, unknown = run_stage(Repair(), job, *run_stage(Linearise(), job, captured(capture)))
    wanted, broken = _whole(capture)
    found, masked = [], []
    rows, left = sound.rows(), unknown.rows()
    for top in range(0, HEIGHT + ahead, 10):
        if top < HEIGHT:
            masked.append(left.read(top, min(top + 10, HEIGHT)))
        if top >= ahead:
            found.append(rows.read(top - ahead, top - ahead + 10))
    np.testing.assert_array_equal(np.concatenate(found, 1), wanted)
    np.testing.assert_array_equal(
        np.concatenate(masked, 1)[0], capture.saturated_rows(0, HEIGHT) & ~broken[0]
    )
    assert isinstance(sound.source, SoundRows)
    assert sound.source.repaired == np.count_nonzero(broken)


def test_what_was_repaired_is_said_once_the_rows_are_out() -> None:
    from camkit.runtime.stage_finder import stage_module

    capture = _mosaic()
    job = made_job(capture)
    work = stage_module("repair").prepare(Repair(), job)
    assert work.warnings() == ()
    for _ in range(2):  # two products walk the same rows
        taken = run_stage(Linearise(), job, captured(capture))
        read_all(work.run(taken)[0].rows())
    count = np.count_nonzero(_whole(capture)[1])
    assert work.warnings() == (f"{count} dead or invalid pixels were repaired",)


def test_without_a_mask_none_is_given_and_rows_that_roll_may_be_repaired() -> None:
    capture = _mosaic()
    light = capture.linear_rows(0, HEIGHT)[None]
    bands = (light[:, top : top + 7] for top in range(0, HEIGHT, 7))
    taken = stream_of(RollingRows(light.shape, bands).reader())
    given = run_stage(Repair(takes=("light",), gives=("sound",)), made_job(capture), taken)
    assert len(given) == 1
    np.testing.assert_array_equal(read_all(given[0].rows(), 5), _whole(capture)[0])


@pytest.mark.parametrize("capture", CAPTURES.values(), ids=CAPTURES.keys())
@pytest.mark.parametrize("known", [40, HEIGHT])
def test_a_second_walk_seeks_only_where_the_first_did_not(
    capture: Capture, known: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = made_job(capture)
    wanted, broken = _whole(capture)
    clipped = np.broadcast_to(capture.saturated_rows(0, HEIGHT), broken.shape)
    first = run_stage(Repair(), job, *run_stage(Linearise(), job, captured(capture)))[0].rows()
    for top in range(0, known, 10):
        first.read(top, top + 10)
    sought: list[int] = []
    for name, mend in (("repair_mosaic", repair_mosaic), ("repair_planes", repair_planes)):
        monkeypatch.setattr(
            f"camkit.runtime.stages.repair.{name}",
            lambda light, mend=mend: sought.append(light.shape[-2]) or mend(light),
        )
    other = job.with_new_log()
    sound, unknown = run_stage(Repair(), other, *run_stage(Linearise(), other, captured(capture)))
    np.testing.assert_array_equal(read_all(sound.rows(), 7), wanted)
    np.testing.assert_array_equal(read_all(unknown.rows(), 7), clipped & ~broken)
    assert isinstance(sound.source, SoundRows)
    assert sound.source.repaired == np.count_nonzero(broken)
    assert bool(sought) == (known < HEIGHT)


def test_more_than_is_kept_is_sought_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("camkit.runtime.stages.repair.MOST_KEPT", 1)
    capture = _mosaic()
    job = made_job(capture)
    for _ in range(2):
        sound = run_stage(Repair(), job, *run_stage(Linearise(), job, captured(capture)))[0]
        np.testing.assert_array_equal(read_all(sound.rows(), 7), _whole(capture)[0])
        assert isinstance(sound.source, SoundRows)
        assert sound.source.repaired == np.count_nonzero(_whole(capture)[1])
