"""Amounts of light: exact where the model holds, by a band that a dense solve agrees with."""

import numpy as np
import pytest

from camkit.runtime.kinds.hdr.deglare import arms
from camkit.runtime.kinds.hdr.deglare.arms import (
    LAST_SCALES,
    MOST_RUNS,
    SCALES,
    Columns,
    arm_streaks,
    fields_of,
    runs_of,
    seek_arms,
)

ROWS, COLUMNS = 60, 40


def _lights() -> np.ndarray:
    lights = np.zeros((ROWS, COLUMNS), bool)
    lights[10:13, 8:15] = True
    lights[40:42, 12:20] = True
    lights[30, 30:34] = True
    return lights


def _columns(seen: np.ndarray, lights: np.ndarray) -> Columns:
    return Columns(
        light=np.ascontiguousarray(seen.T.astype(np.float32)),
        usable=np.ascontiguousarray(~lights.T),
        level=np.full(seen.T.shape, 0.05, np.float32),
        joined=np.ones(seen.shape[1] - 1, bool),
    )


def test_runs_are_numbered_down_every_column() -> None:
    runs = runs_of(_lights())
    assert runs[11, 12] == 1
    assert runs[40, 12] == 2
    assert runs[40, 18] == 1
    assert runs[0, 0] == 0


def test_too_many_runs_become_fewer_that_cover_them() -> None:
    lights = np.zeros((120, 3), bool)
    lights[::3, 1] = True
    runs = runs_of(lights)
    assert 0 < runs.max() <= MOST_RUNS
    assert (runs[lights] > 0).all()
    assert not runs[:, 0].any()


def test_fields_are_sums_over_the_rows_of_a_run() -> None:
    lights = _lights()
    fading = np.exp(-np.arange(ROWS) / 15).astype(np.float32)
    fields = fields_of(runs_of(lights), fading)
    row = 25
    slow = sum(fading[abs(row - other)] for other in (10, 11, 12))
    assert fields[9, row, 0] == pytest.approx(slow, rel=1e-5)
    assert fields.shape == (COLUMNS, ROWS, 2)
    assert not fields[0].any()
    assert fields_of(np.zeros((ROWS, 4), np.intp), fading).shape == (4, ROWS, 0)


@pytest.mark.parametrize("scales", [SCALES, LAST_SCALES])
def test_amounts_over_an_even_scene_come_back(scales: tuple[float, ...]) -> None:
    lights = _lights()
    fading = np.exp(-np.arange(ROWS) / 15).astype(np.float32)
    fields = fields_of(runs_of(lights), fading)
    wanted = np.where(fields.any(axis=1), 0.02, 0) * (1 + np.arange(COLUMNS)[:, None] % 3)
    seen = 0.1 + arm_streaks(fields, wanted).T
    start = wanted * 0.9 if scales == LAST_SCALES else None
    found = seek_arms(_columns(seen, lights), fields, scales, start)
    # the price takes a little
    np.testing.assert_allclose(found, wanted, rtol=0.03, atol=1e-5)


def test_amounts_survive_edges_of_the_scene_and_are_never_negative() -> None:
    lights = _lights()
    fading = np.exp(-np.arange(ROWS) / 15).astype(np.float32)
    fields = fields_of(runs_of(lights), fading)
    wanted = np.where(fields.any(axis=1), 0.03, 0)
    scene = np.full((ROWS, COLUMNS), 0.1)
    scene[:, 16:] = 0.3  # a wall, whose edge lies within the second light
    scene[20:24, :] = 0.5
    seen = scene + arm_streaks(fields, wanted).T
    found = seek_arms(_columns(seen, lights), fields, SCALES)
    assert found.min() >= 0
    error = np.abs(arm_streaks(fields, found) - arm_streaks(fields, wanted))
    assert np.median(error[fields.any(axis=(1, 2))]) < 0.01
    nothing = seek_arms(_columns(scene, lights), fields, SCALES)
    assert np.median(arm_streaks(fields, nothing)[fields.any(axis=(1, 2))]) < 0.01


def test_the_band_solves_what_dense_equations_say() -> None:
    lights = _lights()
    fields = fields_of(runs_of(lights), np.exp(-np.arange(ROWS) / 15).astype(np.float32))
    seen = np.random.default_rng(2).random((ROWS, COLUMNS))
    columns = _columns(seen, lights)
    equations = arms._equations(columns, fields, np.zeros(fields[:, 0].shape), 5.0)
    held = ~fields.any(axis=1)
    count, runs, _ = equations.diagonal.shape
    dense = np.zeros((count * runs, count * runs))
    for c in range(count):
        at = slice(c * runs, (c + 1) * runs)
        dense[at, at] = equations.diagonal[c]
        if c + 1 < count:
            below = slice((c + 1) * runs, (c + 2) * runs)
            dense[below, at] = equations.coupling[c]
            dense[at, below] = equations.coupling[c].T
    free = ~held.ravel()
    wanted = np.zeros(count * runs)
    wanted[free] = np.linalg.solve(dense[np.ix_(free, free)], equations.right_side.ravel()[free])
    np.testing.assert_allclose(equations.solved(held).ravel(), wanted, rtol=1e-6, atol=1e-9)
