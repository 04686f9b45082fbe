"""Lights of cells as lights of pixels: where samples clipped, no more and no less light."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern
from camkit.runtime.kinds.hdr.streaks import spots
from camkit.runtime.kinds.hdr.streaks.cells import COLOURS, cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, recover
from camkit.runtime.kinds.hdr.streaks.spots import LitPixels, lit_pixels
from tests.streak_factory import (
    blurred,
    captured,
    one_light,
    sampled,
    star,
    star_kernels,
    street,
    with_lamps,
)

HALF = (0.5, 0.5)
SIDE = 64


def _laid_out(lit: LitPixels, shape: tuple[int, int]) -> FloatArray:
    planes = np.zeros((COLOURS, *shape), np.float32)
    planes[:, lit.rows, lit.columns] = lit.light
    return planes


def _lamps(cfa: CfaPattern | None) -> tuple[FloatArray, NDArray[np.bool_], Recovery]:
    """Photograph lamps far apart: what clipped, per colour, and what was found."""
    lamps = [
        (12, 12, 1.0, (40.0, 30.0, 20.0)),
        (14, 44, 3.2, (90.0, 60.0, 80.0)),
        (45, 20, 6.0, (9.0, 14.0, 6.0)),
        (44, 50, 0.5, (150.0, 150.0, 150.0)),
    ]
    light = blurred(with_lamps(street(SIDE, SIDE), lamps), star())
    samples, clipped = captured(light, cfa)
    found = recover(cells_of(samples, clipped, sample_sites(cfa)), star_kernels(cfa))
    return light, clipped, found


@pytest.mark.parametrize("cfa", ["RGGB", "GBRG", None])
def test_every_clipped_sample_is_lit_in_its_colour_and_no_other_sample_is(
    cfa: CfaPattern | None,
) -> None:
    _, clipped, found = _lamps(cfa)
    planes = _laid_out(lit_pixels(found), (SIDE, SIDE))
    np.testing.assert_array_equal(sampled(planes, cfa) > 0, clipped)


@pytest.mark.parametrize("cfa", ["RGGB", None])
def test_the_light_of_a_place_is_that_of_its_cells(cfa: CfaPattern | None) -> None:
    """Pixels that would be below white are raised to it, which adds a little at rims."""
    _, _, found = _lamps(cfa)
    planes = _laid_out(lit_pixels(found), (SIDE, SIDE))
    for top in (0, 32):
        for left in (0, 32):
            half_px = np.s_[:, top : top + 32, left : left + 32]
            got = planes[half_px].sum((1, 2))
            half = np.s_[:, top // 2 : top // 2 + 16, left // 2 : left // 2 + 16]
            wanted = 4 * _whole(found)[half].sum((1, 2))
            assert (got >= 0.99 * wanted).all()
            assert (got <= 1.25 * np.maximum(wanted, (planes[half_px] > 0).sum((1, 2))) + 1).all()


def _whole(found: Recovery) -> FloatArray:
    light = np.zeros_like(found.fine.light)
    for region in found.regions:
        light[(slice(None), *region.window.at)] = region.light
    return light


def test_lamps_end_nearer_to_what_they_are_than_even_cells() -> None:
    """Against each cell's light on the pixels about its samples, which is the plain way."""
    light, _, found = _lamps("RGGB")
    truth = np.where(light >= 1, light, 0)
    planes = _laid_out(lit_pixels(found), (SIDE, SIDE))
    plain = _whole(found).repeat(2, axis=1).repeat(2, axis=2)
    got, even = (np.mean((p - truth)[light >= 1] ** 2) for p in (planes, plain))
    assert got < 0.7 * even


def test_between_red_samples_a_pixel_is_lit_if_both_clipped_or_its_own_did() -> None:
    """Red at (2, 2) and (2, 4) of a mosaic; green at (3, 2) clipped as well, at (2, 1) not."""
    samples = np.full((1, 8, 8), 0.3, np.float32)
    for y, x in ((2, 2), (2, 4), (3, 2)):
        samples[0, y, x] = 1
    cells = cells_of(samples, samples >= 1, sample_sites("RGGB"))
    found = replace(one_light(cells.clipped, HALF), fine=cells)
    red = _laid_out(lit_pixels(found), (8, 8))[0] > 0
    wanted = np.zeros((8, 8), np.bool_)
    wanted[2, 2:5] = True
    wanted[3, 2] = True
    np.testing.assert_array_equal(red, wanted)


def test_lights_rise_from_their_rims() -> None:
    clipped = np.zeros((COLOURS, 10, 10), np.float32)
    clipped[:, 3:7, 3:7] = 1
    (rim, inner), corner = _at(clipped, [(6, 9), (9, 9)]), _at(clipped, [(7, 7)])[0]
    assert inner > 1.5 * rim
    assert rim < corner < inner  # beside it only a corner is dark


def _at(clipped: FloatArray, places: list[tuple[int, int]]) -> list[float]:
    planes = _laid_out(lit_pixels(one_light(clipped, HALF)), (20, 20))
    return [float(planes[1, y, x]) for y, x in places]


def test_no_light_is_below_where_samples_clip() -> None:
    clipped = np.zeros((COLOURS, 8, 8), np.float32)
    clipped[0, 2:5, 2:5] = 1
    found = one_light(clipped, HALF)
    dim = replace(found.regions[0], light=found.regions[0].light / 900)
    light = lit_pixels(replace(found, regions=(dim,))).light
    assert (light[0] == 1).all()
    assert (light[1:] == 0).all()


def test_a_light_within_a_ring_keeps_its_own_light() -> None:
    y, x = np.indices((16, 18))
    away = np.maximum(np.abs(y - 8), np.abs(x - 8))
    clipped = np.zeros((COLOURS, 16, 18), np.float32)
    clipped[0, (away == 0) | (away == 3) | (away == 4)] = 1
    found = one_light(clipped, HALF)
    bright = found.regions[0].light.copy()
    bright[0, 8, 8] = 200
    planes = _laid_out(
        lit_pixels(replace(found, regions=(replace(found.regions[0], light=bright),))), (32, 36)
    )
    assert planes[0, 16:18, 16:18].sum() == pytest.approx(800, rel=1e-4)
    assert planes[0].sum() == pytest.approx(800 + 36 * (away[clipped[0] > 0] > 0).sum(), rel=1e-4)


def test_colours_of_a_place_share_their_shape() -> None:
    """Red was found on one side, green on both: each moves towards the shape of all."""
    clipped = np.zeros((COLOURS, 8, 12), np.float32)
    clipped[:2, 3:5, 3:9] = 1
    found = one_light(clipped, HALF)
    light = found.regions[0].light.copy()
    light[0, :, 6:] = 0.0
    planes = _laid_out(
        lit_pixels(replace(found, regions=(replace(found.regions[0], light=light),))), (16, 24)
    )
    red, green = planes[:2, 6:10]
    assert 1.5 < red[:, 13:17].mean() < 0.7 * red[:, 7:11].mean()
    assert green[:, 13:17].mean() < green[:, 7:11].mean()
    assert planes[0].sum() == pytest.approx(4 * light[0].sum(), rel=0.02)


def test_a_colour_beside_one_that_was_seen_is_bound_by_it() -> None:
    """Green clipped in one more row of cells than red, which was seen there at a tenth of white."""
    clipped = np.zeros((COLOURS, 8, 12), np.float32)
    clipped[1, 2:6, 3:9] = clipped[0, 3:6, 3:9] = 1
    found = one_light(clipped, HALF)
    seen = np.zeros_like(clipped)
    seen[0, :3] = 0.1
    planes = _laid_out(lit_pixels(replace(found, fine=replace(found.fine, light=seen))), (16, 24))
    outside, inside = planes[1, 4], planes[1, 8]
    assert outside[8:16].max() < 0.4 * inside[8:16].min()
    assert planes[1].sum() == pytest.approx(4 * 9 * clipped[1].sum(), rel=0.03)


def test_places_are_looked_at_in_parts_of_any_size(monkeypatch: pytest.MonkeyPatch) -> None:
    _, _, found = _lamps("RGGB")
    whole = lit_pixels(found)
    monkeypatch.setattr(spots, "STRIP_CELLS", 7)
    parts = lit_pixels(found)
    for name in ("rows", "columns", "light"):
        np.testing.assert_array_equal(getattr(whole, name), getattr(parts, name))


def test_without_lights_no_pixel_is_lit() -> None:
    found = one_light(np.zeros((COLOURS, 8, 8), np.float32), HALF)
    for regions in ((), found.regions):
        lit = lit_pixels(replace(found, regions=regions))
        assert lit.rows.size == lit.columns.size == 0
        assert lit.light.shape == (COLOURS, 0)
