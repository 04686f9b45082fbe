from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from camkit.calibration.darks import Darks
from camkit.errors import ContractError, DecodeError
from camkit.noise import NoiseModel
from camkit.runtime.merging.merge import merge
from camkit.runtime.merging.survey import Survey, survey
from tests.camkit.calibration.point_factory import (
    BLACK,
    WHITE,
    Point,
    write_bracket,
    write_mosaic,
)

SMALL = Point(side=64, x=31.4, y=30.2, reach=10)


@pytest.fixture
def bracket(tmp_path: Path) -> Survey:
    """Two frames of 1 and 1/8 s."""
    return survey(write_bracket(tmp_path, SMALL, times_s=(1.0, 0.125)), None)


def _dark(path: Path, level: float, time_s: float, side: int = 64) -> Path:
    rng = np.random.default_rng(int(1e4 * level))
    write_mosaic(path, rng.normal(level, 1e-3, (side, side)), time_s)
    return path


def test_a_frame_takes_the_mean_of_its_own_time_else_the_nearest_in_proportion(
    tmp_path: Path, bracket: Survey
) -> None:
    files = [_dark(tmp_path / f"d{n}.dng", level, 1.0) for n, level in enumerate((0.02, 0.04))]
    darks = Darks.read(files, None, bracket)
    own, broken = darks.rows(bracket.frames[0], 4, 8)
    assert own.shape == (1, 4, 64)
    assert own.mean() == pytest.approx(0.03, abs=5e-4)
    assert not broken.any()
    scaled, _ = darks.rows(bracket.frames[1], 4, 8)
    assert scaled.mean() == pytest.approx(0.03 / 8, abs=1e-4)


def test_times_may_be_stated_and_hot_pixels_say_nothing(tmp_path: Path, bracket: Survey) -> None:
    lit = np.full((64, 64), 0.01)
    lit[5, 7] = 0.9
    write_mosaic(tmp_path / "d.dng", lit, 3.0)
    dark, broken = Darks.read([tmp_path / "d.dng"], [1.0], bracket).rows(bracket.frames[0], 0, 64)
    assert np.argwhere(broken[0]).tolist() == [[5, 7]]
    assert np.median(dark) == pytest.approx(0.01, abs=3e-4)


def test_a_dark_frame_of_another_size_or_without_a_time_is_refused(
    tmp_path: Path, bracket: Survey
) -> None:
    with pytest.raises(DecodeError, match="differ in size"):
        Darks.read([_dark(tmp_path / "d.dng", 0.02, 1.0, side=48)], None, bracket)
    _dark(tmp_path / "e.dng", 0.02, 0.0)
    with pytest.raises(ContractError, match=r"dark frame e\.dng states no exposure time"):
        Darks.read([tmp_path / "e.dng"], None, bracket)


def test_seconds_of_darks_do_not_go_with_stated_ratios(tmp_path: Path, bracket: Survey) -> None:
    files, dark = [frame.path for frame in bracket.frames], _dark(tmp_path / "d.dng", 0.02, 1.0)
    ratios = survey(files, [8.0, 1.0])
    told = r"d\.dng states seconds, the time of 0\.dng was .* then for each dark frame"
    with pytest.raises(ContractError, match=told):
        Darks.read([dark], None, ratios)
    Darks.read([dark], [8.0], ratios)
    Darks.read([dark], None, survey(files, [1.0, 0.125]))


@pytest.mark.parametrize("count", [1, 5])
def test_the_error_of_black_is_the_drift_that_darks_show_else_a_tenth_of_a_step(
    tmp_path: Path, bracket: Survey, count: int
) -> None:
    levels = (0.0, 0.001, -0.001, 0.002, -0.002)[:count]
    files = [_dark(tmp_path / f"d{n}.dng", 0.02 + level, 1.0) for n, level in enumerate(levels)]
    drift = np.std(levels, ddof=1) if count > 1 else 0.1 / (4095 - 256)
    found = Darks.read(files, None, bracket).level_error(bracket)
    of_darks = (1 + 1 / 8) / np.sqrt(count)
    assert found == pytest.approx(drift * np.hypot(np.sqrt(2), of_darks) / (1 + 1 / 8), rel=0.02)


@pytest.mark.parametrize(
    ("times_s", "dark_times_s"),
    [((1.0, 0.125), (0.125, 0.125)), ((1.0, 1.0, 1.0, 1.0), (1.0,)), ((1.0, 0.125), (1.0, 0.125))],
)
def test_the_error_of_black_is_what_frames_and_darks_of_another_black_do_to_the_light(
    tmp_path: Path, times_s: tuple[float, ...], dark_times_s: tuple[float, ...]
) -> None:
    """Short darks err more, and one dark errs alike in all frames that share it."""
    every, count, step = (*times_s, *dark_times_s), len(times_s), 1 / (WHITE - BLACK)
    shot = NoiseModel(shot=(1e-2,) * 3, read_variance=(0.0,) * 3)

    def taken(wrong: int | None) -> tuple[float, float]:
        """Give merged light and its error, where one file has a black that is 4 DN off."""
        files = [tmp_path / f"{n}.dng" for n in range(len(every))]
        for n, (path, time_s) in enumerate(zip(files, every, strict=True)):
            level = (0.3 * time_s if n < count else 0.0) + (4 * step if n == wrong else 0.0)
            steps = np.indices((64, 64)).sum(axis=0) % 3 * step  # no camera gives one level
            write_mosaic(path, level + steps, time_s)
        frames = survey(files[:count], None, alike=True)
        frames = replace(frames, frames=tuple(replace(f, noise=shot) for f in frames.frames))
        darks = Darks.read(files[count:], None, frames)
        return float(merge(frames, None, darks.rows).light.mean()), darks.level_error(frames)

    light, error = taken(None)
    moved = [(taken(wrong)[0] - light) / (4 * step) for wrong in range(len(every))]
    assert error == pytest.approx(0.1 * step * np.hypot.reduce(moved), rel=0.03)
