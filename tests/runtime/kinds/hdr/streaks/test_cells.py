"""Cells are means of what did not clip; a kernel of cells is what the samples of a colour see."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.signal import fftconvolve

from camkit.arrays import FloatArray
from camkit.cfa import CFA_PATTERNS, CfaPattern, cfa_channels
from camkit.errors import ContractError
from camkit.runtime.kinds.hdr.streaks.cells import (
    Cells,
    Sites,
    cell_kernel,
    cells_of,
    coarser,
    coarser_kernel,
    sample_sites,
)

FLOAT32 = 1e-6
PATTERNS: tuple[CfaPattern | None, ...] = (*CFA_PATTERNS, None)
SITES_OF_GREEN_ON_A_DIAGONAL: Sites = ((0, 1), (1, 0))


def _capture(channels: int, height: int, width: int) -> tuple[FloatArray, np.ndarray]:
    rng = np.random.default_rng(2)
    samples = rng.uniform(0, 1.2, (channels, height, width)).astype(np.float32)
    return np.minimum(samples, 1), samples >= 1


def _slow_cells(
    samples: FloatArray, clipped: np.ndarray, cfa: CfaPattern | None
) -> tuple[FloatArray, FloatArray]:
    """Walk through all pixels of every cell."""
    _, height, width = samples.shape
    light = np.zeros((3, height // 2, width // 2), np.float32)
    share = np.zeros_like(light)
    for colour, y, x in np.ndindex(light.shape):
        known, over = [], []
        for dy, dx in np.ndindex(2, 2):
            if cfa is not None and cfa_channels(cfa)[dy][dx] != colour:
                continue
            at = (0 if cfa is not None else colour, 2 * y + dy, 2 * x + dx)
            over.append(clipped[at])
            if not clipped[at]:
                known.append(samples[at])
        share[colour, y, x] = np.mean(over)
        light[colour, y, x] = np.mean(known) if known else 0
    return light, share


@pytest.mark.parametrize("cfa", PATTERNS)
@pytest.mark.parametrize("size", [(8, 6), (7, 9)])
def test_a_cell_holds_the_mean_of_what_did_not_clip_and_the_share_that_did(
    cfa: CfaPattern | None, size: tuple[int, int]
) -> None:
    samples, clipped = _capture(3 if cfa is None else 1, *size)
    cells = cells_of(samples, clipped, sample_sites(cfa))
    light, share = _slow_cells(samples, clipped, cfa)
    assert cells.pitch_px == 2
    np.testing.assert_allclose(cells.light, light, atol=FLOAT32)
    np.testing.assert_array_equal(cells.clipped, share)
    np.testing.assert_allclose(cells.unclipped, light * (1 - share), atol=FLOAT32)
    assert ((share > 0) & (share < 1)).any()


@pytest.mark.parametrize("cfa", PATTERNS)
def test_a_cell_lies_in_the_middle_of_its_samples(cfa: CfaPattern | None) -> None:
    sites = sample_sites(cfa)
    samples, clipped = _capture(3 if cfa is None else 1, 8, 8)
    cells = cells_of(samples, clipped, sites)
    for colour in range(3):
        own = [
            (y, x) for y, x in np.ndindex(2, 2) if cfa is None or cfa_channels(cfa)[y][x] == colour
        ]
        assert sorted(sites[colour]) == own
        assert cells.offset_px[colour] == tuple(np.mean(own, axis=0))
    wide = coarser(cells)
    assert wide.pitch_px == 4
    assert wide.offset_px == tuple((y + 1, x + 1) for y, x in cells.offset_px)


@pytest.mark.parametrize("size", [(8, 12), (11, 14), (6, 7)])
def test_coarser_cells_hold_the_light_of_four_and_leave_an_odd_rest_out(
    size: tuple[int, int],
) -> None:
    cells = cells_of(*_capture(3, *size), sample_sites(None))
    wide = coarser(cells)
    rows, columns = size[0] // 4, size[1] // 4
    assert wide.light.shape == (3, rows, columns)
    for colour, y, x in np.ndindex(3, rows, columns):
        four = (colour, slice(2 * y, 2 * y + 2), slice(2 * x, 2 * x + 2))
        assert wide.clipped[colour, y, x] == cells.clipped[four].mean()
        assert wide.unclipped[colour, y, x] == pytest.approx(
            cells.unclipped[four].mean(), abs=FLOAT32
        )


def test_coarser_cells_of_large_pictures_are_those_of_their_parts() -> None:
    samples = np.random.default_rng(2).uniform(0, 1, (1, 600, 820)).astype(np.float32)
    clipped = np.zeros(samples.shape, bool)
    clipped[:, 250:270, 500:530] = True
    cells = cells_of(samples, clipped, sample_sites("RGGB"))
    whole, part = coarser(cells), np.s_[:, 40:101, 100:170]
    few = coarser(
        cells_of(samples[:, 160:404, 400:680], clipped[:, 160:404, 400:680], sample_sites("RGGB"))
    )
    assert np.array_equal(whole.light[part], few.light)
    assert np.array_equal(whole.clipped[part], few.clipped)
    assert (few.clipped > 0).any()


def test_a_cell_of_which_all_clipped_holds_no_known_light() -> None:
    samples = np.ones((3, 4, 4), np.float32)
    cells = coarser(cells_of(samples, samples >= 1, sample_sites(None)))
    assert (cells.light == 0).all()
    assert (cells.unclipped == 0).all()
    assert (cells.clipped == 1).all()


def _seen_slowly(kernel: FloatArray, sites: Sequence[tuple[int, int]], pitch: int) -> FloatArray:
    """Light a cell of even light, spread it pixel by pixel, and average the samples of each cell.

    A pixel of which a part lies in the cell shines with that part. The cells of pitch 4 are four
    of pitch 2, each of which shines as the one does.
    """
    half, middle = kernel.shape[0] // 2, np.mean(sites, axis=0)
    cells = 2 * (half // pitch) + 7  # more than are lit
    centre = cells // 2
    side = pitch * cells + 2 * half + 4
    lit = np.zeros((side, side))
    corners = [(2 * y, 2 * x) for y in range(pitch // 2) for x in range(pitch // 2)]
    place = np.arange(side) - half - pitch * centre
    for down, right in corners:
        in_y = np.clip(1.5 - np.abs(place - down - middle[0]), 0, 1)
        in_x = np.clip(1.5 - np.abs(place - right - middle[1]), 0, 1)
        lit += np.outer(in_y, in_x)
    spread = np.zeros_like(lit)
    for y, x in np.argwhere(lit):
        rows, columns = slice(y - half, y + half + 1), slice(x - half, x + half + 1)
        spread[rows, columns] += lit[y, x] * kernel
    seen = np.zeros((cells, cells))
    for y, x in np.ndindex(cells, cells):
        seen[y, x] = np.mean(
            [
                spread[half + pitch * y + down + dy, half + pitch * x + right + dx]
                for down, right in corners
                for dy, dx in sites
            ]
        )
    return seen.astype(np.float32)


def _cut(wide: FloatArray, side: int) -> FloatArray:
    beside = (wide.shape[0] - side) // 2
    inner = wide[beside : beside + side, beside : beside + side]
    assert wide.sum() == pytest.approx(inner.sum(), abs=FLOAT32)  # nothing lies beside it
    return inner


@pytest.mark.parametrize("side", [1, 3, 9, 11])
@pytest.mark.parametrize(
    "sites",
    [((0, 0),), ((1, 0),), SITES_OF_GREEN_ON_A_DIAGONAL, ((0, 0), (0, 1), (1, 0), (1, 1))],
    ids=["red", "blue", "green", "planes"],
)
def test_kernels_of_cells_equal_light_that_is_spread_pixel_by_pixel(
    sites: Sites, side: int
) -> None:
    kernel = np.random.default_rng(side).uniform(0, 1, (side, side)).astype(np.float32)
    kernel /= kernel.sum()
    fine = cell_kernel(kernel, sites)
    coarse = coarser_kernel(fine)
    assert fine.shape[0] % 2 == coarse.shape[0] % 2 == 1
    np.testing.assert_allclose(fine, _cut(_seen_slowly(kernel, sites, 2), len(fine)), atol=FLOAT32)
    np.testing.assert_allclose(
        coarse, _cut(_seen_slowly(kernel, sites, 4), len(coarse)), atol=FLOAT32
    )


@pytest.mark.parametrize("cfa", PATTERNS)
def test_kernels_of_cells_neither_make_nor_lose_light(cfa: CfaPattern | None) -> None:
    """Every sample has its own pixel's share of cells, so a cell's light is seen once in all."""
    kernel = np.random.default_rng(0).uniform(0, 1, (21, 21)).astype(np.float32)
    kernel *= 0.97 / kernel.sum()
    for sites in sample_sites(cfa):
        fine = cell_kernel(kernel, sites)
        assert fine.sum() == pytest.approx(0.97, abs=1e-5)
        assert coarser_kernel(fine).sum() == pytest.approx(0.97, abs=1e-5)


def test_a_smooth_scene_spread_in_cells_is_what_cells_of_the_spread_scene_hold() -> None:
    """The whole point of both: cells after blur = kernel of cells after cells."""
    y, x = np.mgrid[:64, :64]
    scene = (0.4 + 0.2 * np.sin(x / 9) * np.cos(y / 7)).astype(np.float32)
    place = np.arange(-6, 7)
    kernel = np.exp(-np.abs(place[:, None]) / 2 - np.abs(place[None, :]) / 3).astype(np.float32)
    kernel /= kernel.sum()
    blurred = fftconvolve(scene, kernel, "same").astype(np.float32)
    nothing = np.zeros((1, 64, 64), bool)
    for cfa in CFA_PATTERNS:
        sites = sample_sites(cfa)
        given, wanted = (cells_of(p[None], nothing, sites) for p in (scene, blurred))
        for colour in range(3):
            spread = fftconvolve(given.light[colour], cell_kernel(kernel, sites[colour]), "same")
            gap = np.abs(spread - wanted.light[colour])[6:-6, 6:-6].max()
            assert gap < 2e-3  # a cell's even light is a little broader than what it stands for
            assert np.abs(given.light[colour] - wanted.light[colour])[6:-6, 6:-6].max() > 10 * gap


@pytest.mark.parametrize(
    ("shape", "mask", "message"),
    [
        ((2, 8, 8), (2, 8, 8), r"samples must be \(1 or 3, h, w\) with a mask"),
        ((8, 8), (8, 8), "samples must be"),
        ((1, 8, 8), (1, 8, 6), "samples must be"),
        ((1, 1, 8), (1, 1, 8), r"needs 2 px on each side; got \(1, 8\)"),
    ],
)
def test_what_is_no_capture_is_refused(
    shape: tuple[int, ...], mask: tuple[int, ...], message: str
) -> None:
    with pytest.raises(ContractError, match=message):
        cells_of(np.zeros(shape, np.float32), np.zeros(mask, bool), sample_sites("RGGB"))


def test_cells_that_no_coarser_one_holds_are_refused() -> None:
    light = np.zeros((3, 1, 5), np.float32)
    cells = Cells(
        light=light,
        clipped=light,
        pitch_px=2,
        offset_px=((0.5, 0.5),) * 3,
        pixels=np.zeros((0, *light.shape[1:]), np.uint8),
    )
    with pytest.raises(ContractError, match="need two on each side"):
        coarser(cells)
