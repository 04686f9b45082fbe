"""Streaks are taken from samples as far as they are known: no dark lines, nothing of the scene."""

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern
from camkit.runtime.kinds.hdr.streaks import doubt
from camkit.runtime.kinds.hdr.streaks.cells import PITCH_PX, sample_sites
from camkit.runtime.kinds.hdr.streaks.doubt import BLOCK_PX, MARGIN_PX, RUN, settled

HEIGHT, WIDTH = 98, 131
PATTERNS: tuple[CfaPattern, ...] = ("RGGB", "GBRG")


def _arm(width_px: float, level: float = 0.2) -> FloatArray:
    """Return a streak along the rows that is no different in any column."""
    y = np.arange(HEIGHT, dtype=np.float32)[:, None] - HEIGHT // 2
    return np.asarray(level * np.exp(-0.5 * (y / width_px) ** 2) + np.zeros(WIDTH), np.float32)


def _settled(
    rest: FloatArray,
    thrown: FloatArray,
    cfa: CfaPattern = "RGGB",
    clipped: NDArray[np.bool_] | None = None,
) -> FloatArray:
    """Settle a mosaic colour by colour."""
    out, over = rest.copy(), np.zeros(rest.shape, np.bool_) if clipped is None else clipped
    for places in sample_sites(cfa):
        at = [np.s_[y::PITCH_PX, x::PITCH_PX] for y, x in places]
        light, under = ([plane[there] for there in at] for plane in (rest, thrown))
        found = settled(light, under, [over[there] for there in at])
        for there, samples in zip(at, found, strict=True):
            out[there] = samples
    return out


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("turned", [False, True])
def test_a_streak_taken_too_broadly_leaves_hardly_a_line(cfa: CfaPattern, turned: bool) -> None:
    """A lamp found broader than it is leaves two dark lines and a bright one, as bright in all."""
    true, found = _arm(1.2), _arm(2.4, 0.1)
    if turned:
        true, found = true.T, found.T
    noise = np.random.default_rng(1).normal(0, 0.001, true.shape).astype(np.float32)
    rest = 0.08 + noise + true - found
    left = np.abs(_settled(rest, found, cfa) - 0.08)
    assert (rest - 0.08).min() < -0.035
    assert left.max() < 0.35 * np.abs(rest - 0.08).max()


def test_samples_without_streaks_keep_their_bits() -> None:
    rest = np.random.default_rng(2).uniform(0, 0.5, (HEIGHT, WIDTH)).astype(np.float32)
    thrown = _arm(1.5)
    got = _settled(rest, thrown)
    quiet = np.abs(np.arange(HEIGHT) - HEIGHT // 2) > 16
    np.testing.assert_array_equal(got[quiet], rest[quiet])
    assert (got != rest).any()
    np.testing.assert_array_equal(_settled(rest, np.zeros_like(thrown)), rest)


def test_a_scene_that_varies_by_more_than_the_doubt_stays() -> None:
    stripes = np.array([0.1, 0.1, 0.3, 0.3], np.float32)
    rest = np.tile(stripes, (HEIGHT, WIDTH // 4 + 1))[:, :WIDTH]
    got = _settled(rest, _arm(1.5, 0.06))
    assert np.abs(got - rest).max() < 0.01


def test_nothing_is_brighter_than_it_was_seen() -> None:
    """A dark spot under a streak is no brighter than its sample."""
    rest = np.full((HEIGHT, WIDTH), 0.3, np.float32)
    thrown = _arm(2.0, 0.1)
    rest[HEIGHT // 2, 60] = 0.01
    got = _settled(rest, thrown)
    assert (got <= rest + thrown).all()
    assert got[HEIGHT // 2, 60] > rest[HEIGHT // 2, 60]


def test_nothing_is_darker_than_black_unless_it_was_seen_so() -> None:
    seen, thrown = np.full((HEIGHT, WIDTH), 0.02, np.float32), _arm(2.0)
    seen[HEIGHT // 2, 60] = -0.01
    got = _settled(seen - thrown, thrown)
    assert (seen - thrown).min() < -0.15
    assert got.min() == pytest.approx(-0.01)
    assert (np.delete(got, 60, axis=1) >= -1e-6).all()


def test_clipped_samples_say_nothing_and_stay() -> None:
    rest, thrown = np.full((HEIGHT, WIDTH), 0.1, np.float32), _arm(2.0)
    clipped = np.zeros(rest.shape, np.bool_)
    clipped[40:60, 40:60] = True
    got = _settled(np.where(clipped, np.float32(1), rest), thrown, clipped=clipped)
    np.testing.assert_array_equal(got[clipped], 1)
    np.testing.assert_allclose(got[~clipped], 0.1, atol=1e-6)


def test_a_cut_with_its_margin_has_the_bits_of_the_whole() -> None:
    rng = np.random.default_rng(3)
    rest = rng.uniform(0, 0.2, (HEIGHT, WIDTH)).astype(np.float32)
    thrown = rng.uniform(0, 0.2, (HEIGHT, WIDTH)).astype(np.float32)
    whole = _settled(rest, thrown)
    for first, last in ((MARGIN_PX + BLOCK_PX, 60), (24, HEIGHT), (0, 41)):
        above = max(first // BLOCK_PX * BLOCK_PX - MARGIN_PX, 0)
        below = min(-(-last // BLOCK_PX) * BLOCK_PX + MARGIN_PX, HEIGHT)
        part = _settled(rest[above:below], thrown[above:below])
        np.testing.assert_array_equal(part[first - above : last - above], whole[first:last])


def test_columns_without_doubt_are_left_out_and_change_no_bit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(5)
    sides = 64, 12 * RUN + 5
    rest, thrown = (rng.uniform(0, 0.2, sides).astype(np.float32) for _ in range(2))
    for quiet in (np.s_[:, : RUN + 3], np.s_[:, 4 * RUN : 9 * RUN]):
        thrown[quiet] = 0
    got = _settled(rest, thrown)
    assert np.array_equal(got[:, 5 * RUN : 8 * RUN], rest[:, 5 * RUN : 8 * RUN])
    monkeypatch.setattr(doubt, "RUN", 16 * RUN)
    np.testing.assert_array_equal(got, _settled(rest, thrown))
