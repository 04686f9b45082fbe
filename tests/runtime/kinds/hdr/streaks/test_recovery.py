"""Lights come back from their streaks, veils go, and what cannot be told is left and said."""

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern
from camkit.runtime.kinds.hdr.streaks import recovery
from camkit.runtime.kinds.hdr.streaks.cells import Cells, cells_of, coarser, sample_sites
from camkit.runtime.kinds.hdr.streaks.recovery import MOST_CLIPPED, Recovery, recover, veil_of
from tests.streak_factory import (
    blurred,
    captured,
    captured_cells,
    star,
    star_kernels,
    street,
    with_lamps,
)

LAMPS = [
    (50, 60, 4.0, (40.0, 30.0, 20.0)),
    (100, 140, 2.0, (200.0, 150.0, 90.0)),
    (40, 180, 1.5, (90.0, 90.0, 90.0)),
]
SIZE = (160, 208)


def _night(
    lamps: list[tuple[int, int, float, tuple[float, float, float]]],
) -> tuple[FloatArray, FloatArray]:
    scene = with_lamps(street(*SIZE), lamps)
    return scene, blurred(scene, star())


@pytest.fixture(scope="module")
def lit() -> tuple[FloatArray, Cells, Recovery]:
    scene, light = _night(LAMPS)
    cells = captured_cells(light)
    return scene, cells, recover(cells, star_kernels())


def _flux(found: Recovery, colour: int, y: int, x: int, within_px: float) -> float:
    """Sum the light of a colour around a place, in pixels."""
    total = 0.0
    for region in found.regions:
        rows, columns = np.indices(region.light.shape[1:])
        offset = found.fine.offset_px[colour]
        off_y = offset[0] + 2 * (rows + region.window.top) - y
        off_x = offset[1] + 2 * (columns + region.window.left) - x
        here = np.hypot(off_y, off_x) <= within_px
        total += 4 * float(region.light[colour][here].sum())
    return total


def test_every_lamp_has_its_light_in_every_colour(
    lit: tuple[FloatArray, Cells, Recovery],
) -> None:
    scene, _, found = lit
    rows, columns = np.indices(SIZE)
    for y, x, radius, _ in LAMPS:
        lamp = np.hypot(rows - y, columns - x) <= radius
        for colour in range(3):
            wanted = float(scene[colour][lamp].sum())
            assert _flux(found, colour, y, x, radius + 6) == pytest.approx(wanted, rel=0.28)


def test_light_lies_in_clipped_cells_alone_and_streaks_reach_from_them(
    lit: tuple[FloatArray, Cells, Recovery],
) -> None:
    _, cells, found = lit
    for region in found.regions:
        clipped = cells.clipped[(slice(None), *region.window.at)] > 0
        assert (region.light[~clipped] == 0).all()
        assert (region.light[clipped] > 0).all()
        assert region.streaks[~clipped].max() > 0.05
    assert sum((r.light > 0).sum() for r in found.regions) == (cells.clipped > 0).sum()


def test_what_a_sidecar_says_is_what_was_found(lit: tuple[FloatArray, Cells, Recovery]) -> None:
    _, cells, found = lit
    told = found.to_json()
    assert told["regions"] == len(found.regions)
    assert told["saturated_fraction"] == pytest.approx(cells.clipped.mean(), abs=1e-6)
    assert told["peak"] == pytest.approx(max(r.light.max() for r in found.regions), abs=0.01)
    inside = sum(r.window.shape[0] * r.window.shape[1] for r in found.regions)
    assert told["window_fraction"] == pytest.approx(inside / cells.light[0].size, abs=1e-4)
    thrown = sum(float(r.streaks.sum()) for r in found.regions)
    hidden = sum(
        float(r.streaks[cells.clipped[(slice(None), *r.window.at)] > 0].sum())
        for r in found.regions
    )
    assert told["clipped_streak_fraction"] == pytest.approx(hidden / thrown, abs=1e-3)
    assert 0 <= told["unexplained"] < 0.05
    assert told["fallbacks"] == 0
    assert found.notes == ()


@pytest.mark.parametrize("cfa", ["RGGB", None])
def test_nothing_clipped_leaves_the_veil_alone(cfa: CfaPattern | None) -> None:
    cells = captured_cells(blurred(street(96, 128), star()), cfa)
    found = recover(cells, star_kernels(cfa))
    assert found.regions == ()
    assert found.notes == ()
    assert found.to_json() == {
        "regions": 0,
        "saturated_fraction": 0.0,
        "clipped_streak_fraction": 0.0,
        "unexplained": 0.0,
        "peak": 1.0,
        "window_fraction": 0.0,
        "fallbacks": 0,
    }
    assert found.veil.shape == coarser(cells).light.shape


def test_the_veil_of_an_even_scene_is_the_light_that_leaves_the_core() -> None:
    """Beyond the frame the scene goes on, so that the border is no darker."""
    kernels = star_kernels()
    known = np.full((3, 30, 40), 0.4, np.float32)
    veil = veil_of(known, kernels.coarse.veil)
    for colour in range(3):
        wanted = 0.4 * kernels.coarse.veil[colour].sum()
        np.testing.assert_allclose(veil[colour], wanted, rtol=1e-4)


def test_each_colour_has_lights_of_its_own() -> None:
    """Only red clips: green and blue are left alone."""
    _, light = _night([(80, 100, 4.0, (30.0, 0.1, 0.1))])
    cells = captured_cells(light)
    (region,) = recover(cells, star_kernels()).regions
    assert cells.clipped[0].any()
    assert not cells.clipped[1:].any()
    assert region.light[0].max() > 10
    assert (region.light[1:] == 0).all()
    assert (region.streaks[1:] == 0).all()


def test_too_much_clipped_is_left_as_the_sensor_saw_it_and_that_is_said() -> None:
    scene = street(96, 128)
    scene[:, :, 80:] = 3
    found = recover(captured_cells(blurred(scene, star())), star_kernels())
    assert found.regions == ()
    assert found.to_json()["fallbacks"] == found.fallbacks == 1
    (note,) = found.notes
    assert f"only up to {MOST_CLIPPED:.0%}" in note
    assert "of the picture is clipped: its lights are not restored" in note


@pytest.mark.parametrize(("y", "x"), [(1, 100), (158, 100), (80, 1), (80, 206)])
def test_a_lamp_at_the_border_is_sought_and_what_lies_beyond_is_warned_of(y: int, x: int) -> None:
    _, light = _night([(y, x, 3.0, (200.0, 200.0, 200.0))])
    found = recover(captured_cells(light), star_kernels())
    assert len(found.regions) == 1
    assert found.notes == (
        "a light reaches the border of the picture: lights beyond it are not restored",
    )
    assert 20 < found.to_json()["peak"] < 600


def test_faint_lights_that_nothing_proves_are_counted_and_a_lamp_beside_them_is_found() -> None:
    faint = [(y, x, 4.0, (1.4, 1.4, 1.4)) for y in (30, 80) for x in (30, 75, 165)]
    _, light = _night([*faint, (80, 120, 2.0, (120.0, 120.0, 120.0))])
    found = recover(captured_cells(light), star_kernels())
    assert found.to_json()["fallbacks"] == found.fallbacks >= len(faint) // 2
    assert found.notes == ()
    assert _flux(found, 1, 80, 120, 6) == pytest.approx(120 * 13, rel=0.28)


@pytest.mark.parametrize("size", [(101, 131), (102, 133), (99, 130), (98, 129)])
def test_a_lamp_at_the_lower_right_of_odd_sizes_is_found(size: tuple[int, int]) -> None:
    """A row of cells that no coarser one covers goes with its neighbour."""
    scene = with_lamps(street(*size), [(size[0] - 3, size[1] - 3, 3.0, (50.0, 50.0, 50.0))])
    cells = captured_cells(blurred(scene, star()))
    found = recover(cells, star_kernels())
    assert sum((r.light > 0).sum() for r in found.regions) == (cells.clipped > 0).sum()


def test_lights_of_a_window_that_is_judged_in_coarse_cells_are_much_the_same(
    monkeypatch: pytest.MonkeyPatch, lit: tuple[FloatArray, Cells, Recovery]
) -> None:
    _, cells, found = lit
    monkeypatch.setattr(recovery, "FINE_CELLS", 100)
    coarse = recover(cells, star_kernels())
    assert [r.window for r in coarse.regions] == [r.window for r in found.regions]
    for one, other in zip(coarse.regions, found.regions, strict=True):
        assert one.light.sum() == pytest.approx(other.light.sum(), rel=0.1)
        assert np.abs(one.light - other.light).sum() < 0.1 * other.light.sum()


def test_the_same_capture_gives_the_same_bits(lit: tuple[FloatArray, Cells, Recovery]) -> None:
    """However its cells were put together."""
    _, cells, found = lit
    samples, clipped = captured(_night(LAMPS)[1], "RGGB")
    parts = [
        cells_of(samples[:, top : top + 14], clipped[:, top : top + 14], sample_sites("RGGB"))
        for top in range(0, SIZE[0], 14)
    ]
    pieced = Cells(
        light=np.concatenate([p.light for p in parts], axis=1),
        clipped=np.concatenate([p.clipped for p in parts], axis=1),
        pitch_px=2,
        offset_px=cells.offset_px,
        pixels=np.concatenate([p.pixels for p in parts], axis=1),
    )
    again = recover(pieced, star_kernels())
    np.testing.assert_array_equal(again.veil, found.veil)
    for one, other in zip(again.regions, found.regions, strict=True):
        assert one.window == other.window
        np.testing.assert_array_equal(one.light, other.light)
        np.testing.assert_array_equal(one.streaks, other.streaks)


def test_lights_far_from_each_other_do_not_know_of_each_other() -> None:
    """But for rounding: one transform more or less spreads the light of a window."""
    kernels = star_kernels()
    left, right = (40, 30, 3.0, (60.0,) * 3), (40, 220, 2.0, (90.0,) * 3)
    scene = with_lamps(np.full((3, 80, 260), 0.1, np.float32), [left, right])
    both = recover(captured_cells(blurred(scene, star())), kernels)
    assert len(both.regions) == 2
    alone = with_lamps(np.full((3, 80, 260), 0.1, np.float32), [left])
    (one,) = recover(captured_cells(blurred(alone, star())), kernels).regions
    assert one.window == both.regions[0].window
    np.testing.assert_allclose(one.light, both.regions[0].light, rtol=0.02, atol=0.02)


class _StopError(Exception):
    """Raised by a caller who has seen enough."""


def test_whoever_is_asked_before_a_window_may_stop() -> None:
    lamps = [(40, 30, 3.0, (60.0,) * 3), (40, 220, 2.0, (90.0,) * 3)]
    scene = with_lamps(np.full((3, 80, 260), 0.1, np.float32), lamps)  # type: ignore[arg-type]
    cells = captured_cells(blurred(scene, star()))
    asked = []

    def pause() -> None:
        asked.append(1)
        if len(asked) == 2:
            raise _StopError

    with pytest.raises(_StopError):
        recover(cells, star_kernels(), pause)
    assert len(asked) == 2
