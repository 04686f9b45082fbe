"""The fading of streaks is read from them; a picture without any says nothing."""

import numpy as np

from camkit.runtime.kinds.hdr.deglare.arms import Columns, arm_streaks, fields_of, runs_of
from camkit.runtime.kinds.hdr.deglare.profile import first_fading, fitted_fading

ROWS, COLUMNS, REACH = 80, 30, 60.0


def test_the_fading_of_known_amounts_is_found() -> None:
    lights = np.zeros((ROWS, COLUMNS), bool)
    lights[20, 5:9] = lights[50, 15:20] = True
    runs = runs_of(lights)
    true = np.exp(-np.arange(ROWS) / 12).astype(np.float32)
    amounts = np.where(fields_of(runs, true).any(axis=1), 0.05, 0)
    seen = 0.1 + arm_streaks(fields_of(runs, true), amounts)
    columns = Columns(
        light=seen,
        usable=np.ascontiguousarray(~lights.T),
        level=np.full(seen.shape, 0.1, np.float32),
        joined=np.ones(COLUMNS - 1, bool),
    )
    found = fitted_fading([columns] * 2, runs, [amounts] * 2, first_fading(ROWS, REACH), REACH)
    assert found is not None
    assert (np.diff(found) <= 1e-6).all()
    np.testing.assert_allclose(found[1:40], true[1:40], atol=0.06)
    none = fitted_fading([columns], runs, [amounts * 0], first_fading(ROWS, REACH), REACH)
    assert none is None


def test_the_first_fading_ends_where_arms_do() -> None:
    fading = first_fading(10, 4.0)
    np.testing.assert_allclose(fading, [1, 0.75, 0.5, 0.25, 0, 0, 0, 0, 0, 0])
