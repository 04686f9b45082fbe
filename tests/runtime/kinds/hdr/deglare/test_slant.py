"""The slant: streaks of its angle stand in one column, and what is laid back falls where it was."""

import math

import numpy as np
import pytest

from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.deglare.slant import Slant

SHAPE = (60, 50)


@pytest.mark.parametrize("angle_deg", [-30.0, -5.0, 0.0, 2.5, 8.0])
def test_a_line_of_the_angle_falls_into_one_column(angle_deg: float) -> None:
    slope = math.tan(math.radians(angle_deg))
    y, x = np.mgrid[: SHAPE[0], : SHAPE[1]]
    off = x - 25 - slope * (y - 30)
    picture = np.exp(-(off**2) / 18).astype(np.float32)[None]
    slant = Slant(angle_rad=math.radians(angle_deg), height=SHAPE[0], width=SHAPE[1], step=4)
    upright, share = slant.gathered(lambda top, bottom: picture[:, top:bottom], 1)
    place = np.arange(slant.shape[1]) - (25 - slope * 30 - slant.shift_px(0))
    wanted = np.broadcast_to(np.exp(-(place**2) / 18), slant.shape)
    inside = (share == 1) & (np.abs(place) < 8)
    assert inside.sum() > 60
    # a line between two samples lies 1/8 of its bend too low at most
    np.testing.assert_allclose(upright[0][inside], wanted[inside], atol=0.015)


def test_what_is_even_along_the_streaks_comes_back() -> None:
    slant = Slant(angle_rad=math.radians(6), height=48, width=40, step=4)
    column = np.arange(slant.shape[1], dtype=np.float32)
    field = np.stack([np.broadcast_to(column, slant.shape)] * 2)
    laid = slant.resampled(field, 0, 48)
    y, x = np.mgrid[:48, :40]
    wanted = x - np.array([slant.shift_px(row) for row in range(48)])[y]
    np.testing.assert_allclose(laid, np.broadcast_to(wanted, laid.shape), atol=1e-4)


def test_rows_read_and_laid_in_bands_are_those_of_the_whole() -> None:
    rng = np.random.default_rng(0)
    picture = rng.random((3, 61, 43), dtype=np.float32)
    slant = Slant(angle_rad=math.radians(-7), height=61, width=43, step=5)
    whole = slant.gathered(lambda top, bottom: picture[:, top:bottom], 3)
    parts = slant.gathered(lambda top, bottom: picture[:, top:bottom], 3, rows_at_once=7)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(one, other)
    laid = slant.resampled(whole[0], 0, 61)
    pieces = [slant.resampled(whole[0], top, 1) for top in range(61)]
    np.testing.assert_array_equal(np.concatenate(pieces, axis=1), laid)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"angle_rad": 0.9}, "within 45 degrees"),
        ({"angle_rad": math.nan}, "within 45 degrees"),
        ({"step": 11}, "a row of 11 px; got 10x10"),
        ({"width": 0}, "got 10x0"),
    ],
)
def test_what_cannot_be_sheared_is_refused(wrong: dict[str, float], told: str) -> None:
    fields: dict[str, float] = {"angle_rad": 0.1, "height": 10, "width": 10, "step": 1} | wrong
    with pytest.raises(ContractError, match=told):
        Slant(**fields)  # type: ignore[arg-type]
