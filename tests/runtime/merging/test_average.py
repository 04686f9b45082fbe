"""The running mean against its definition, and what is done where nothing is usable."""

import numpy as np
import pytest

from camkit.runtime.merging.average import Average, Exposed

CLIP, DARK = "clipped", "dark"


def _averaged(*frames: tuple[float, float | str]) -> tuple[float, float]:
    """Average one sample seen as (value, precision or why not), longest frame first."""
    average = Average.empty((1, 1, 1))
    for value, precision in frames:
        usable = not isinstance(precision, str)
        average.add(
            0,
            1,
            Exposed(
                value=np.full((1, 1, 1), value, np.float32),
                precision=np.full((1, 1, 1), precision if usable else 1.0, np.float32),
                usable=np.full((1, 1, 1), usable),
                clipped=np.full((1, 1, 1), precision == CLIP),
            ),
        )
    return float(average.value[0, 0, 0]), float(average.precision[0, 0, 0])


def test_the_mean_is_that_of_its_definition() -> None:
    value, precision = _averaged((1.0, 2.0), (1.5, 1.0), (9.0, CLIP), (0.5, 5.0))
    assert value == pytest.approx((1.0 * 2 + 1.5 + 0.5 * 5) / 8, rel=1e-6)
    assert precision == 8.0


@pytest.mark.parametrize(
    ("frames", "value"),
    [
        ([(1.0, CLIP), (2.0, CLIP), (4.0, CLIP)], 4.0),  # the shortest knows the highest bound
        ([(0.1, DARK), (0.2, DARK)], 0.1),  # the longest knows the lowest
        ([(1.0, CLIP), (0.0, DARK)], 1.0),  # between two frames: at least the bound
        ([(1.0, CLIP), (4.0, 3.0)], 4.0),
        ([(-np.inf, DARK), (0.3, 3.0)], 0.3),
    ],
)
def test_bounds_stand_in_where_no_frame_is_usable(
    frames: list[tuple[float, float | str]], value: float
) -> None:
    assert _averaged(*frames)[0] == np.float32(value)
