"""The distance of a scene, found in the capture: closed forms, scenes of known distance, limits."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from camkit.arrays import FloatArray
from camkit.cfa import CfaPattern, cfa_channels
from camkit.noise import NoiseModel
from camkit.runtime.bank import distance
from camkit.runtime.bank.blocks import to_otf
from camkit.runtime.bank.cell_means import cell_means
from camkit.runtime.bank.distance import CELL_PX, find_nearness
from camkit.runtime.bank.kernels_by_distance import MEAN, KernelsByDistance, NearnessMap
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.rows import ArrayRows
from tests.psf_factory import PITCH_UM, gaussian_kernel

DEPTHS_MM = np.array([500.0, 800.0, 2000.0])
FOCI_MM = (600.0, 800.0, 1300.0)
"""Of the three colours: a lens with axial colour."""
NOISE = NoiseModel(shot=(1e-5,) * 3, read_variance=(1e-8,) * 3)
CFA: CfaPattern = "RGGB"


def _kernels(depth_mm: float) -> FieldKernels:
    sigmas_px = [0.8 + 6000 * abs(1 / depth_mm - 1 / focus_mm) for focus_mm in FOCI_MM]
    kernels = np.stack([gaussian_kernel(sigma, radius_px=24)[0] for sigma in sigmas_px])
    return FieldKernels(kernels=kernels[None].astype(np.float32), field_heights_mm=np.zeros(1))


KNOWN = KernelsByDistance(DEPTHS_MM, [_kernels(float(d)) for d in DEPTHS_MM])


def _scene(side: tuple[int, int], seed: int) -> FloatArray:
    """A texture that the colours share, with a little of each one's own, around 0.3."""
    rng = np.random.default_rng(seed)
    fy, fx = np.fft.fftfreq(side[0])[:, None], np.fft.rfftfreq(side[1])[None]
    amplitude = (fy**2 + fx**2 + 0.01**2) ** -0.65
    drawn = [np.fft.irfft2(np.fft.rfft2(rng.normal(size=side)) * amplitude, side) for _ in range(4)]
    shared, *own = (plane / plane.std() for plane in drawn)
    light = [
        level * (1 + 0.3 * shared + 0.05 * plane)
        for level, plane in zip((0.3, 0.4, 0.2), own, strict=True)
    ]
    return np.maximum(light, 0.01).astype(np.float32)


def _blurred(scene: FloatArray, kernels: FieldKernels) -> FloatArray:
    side = max(scene.shape[1:])
    wide = np.pad(scene, ((0, 0), (0, side - scene.shape[1]), (0, side - scene.shape[2])), "wrap")
    seen = np.fft.irfft2(np.fft.rfft2(wide) * to_otf(kernels.kernels[0], side), (side, side))
    return np.asarray(seen[:, : scene.shape[1], : scene.shape[2]], np.float32)


def _window(size_px: tuple[int, int]) -> SensorWindow:
    return SensorWindow(
        size_px=size_px, origin_px=(0, 0), sensor_size_px=size_px, pitch_um=PITCH_UM
    )


def _found(
    planes: FloatArray, cfa: CfaPattern | None, clipped: FloatArray | None = None, threads: int = 1
) -> NearnessMap:
    _, height, width = planes.shape
    over = np.zeros((1, height, width), np.bool_) if clipped is None else clipped
    seen = planes
    if cfa is not None:
        colours = np.array(cfa_channels(cfa))
        rows, columns = np.indices((height, width))
        seen = np.take_along_axis(planes, colours[rows % 2, columns % 2][None], axis=0)
    noisy = seen + np.random.default_rng(5).normal(0, 2e-3, seen.shape).astype(np.float32)
    cells, hit = cell_means(ArrayRows(noisy), ArrayRows(over), cfa, CELL_PX)
    return find_nearness(
        cells, hit, KNOWN, _window((width, height)), noise=NOISE, cfa=cfa, threads=threads
    )


@pytest.mark.parametrize("step", [0, 3, 8, 12, 16])
@pytest.mark.parametrize("cfa", [CFA, "GBRG", None])
def test_the_distance_of_a_scene_is_found(step: int, cfa: CfaPattern | None) -> None:
    planes = _blurred(_scene((512, 768), step), KNOWN.at_step(step))
    found = _found(planes, cfa)
    assert np.abs(found.values - KNOWN.nearness[step]).max() < 1.5 * np.diff(KNOWN.nearness)[0]


def test_two_distances_in_one_scene_are_told_apart() -> None:
    scene = _scene((800, 1600), 3)
    near, far = (_blurred(scene, KNOWN.at_step(step)) for step in (14, 2))
    found = _found(np.concatenate([near[..., :800], far[..., 800:]], axis=-1), CFA)
    step = np.diff(KNOWN.nearness)[0]
    assert abs(found.at(100, 400) - KNOWN.nearness[14]) < 2 * step
    assert abs(found.at(1500, 400) - KNOWN.nearness[2]) < 2 * step
    choice = KNOWN.of_scene(found)
    assert choice.number_at(100, 400) > 11
    assert choice.number_at(1500, 400) < 5


def test_likelihoods_are_those_of_students_distribution_written_out() -> None:
    rng = np.random.default_rng(2)
    block = rng.uniform(0.2, 0.4, (3, distance.BLOCK_CELLS, distance.BLOCK_CELLS)).astype(
        np.float32
    )
    whole = distance._spectrum(CFA, 3)
    few = replace(
        whole,
        places=whole.places[:4],
        weight=whole.weight[:4],
        fall=whole.fall[:4],
        phases=whole.phases[:, :4],
    )
    otf = np.stack(
        [few.of(to_otf(k.at(0, 0), distance.BLOCK_CELLS)) for k in distance._coarse(KNOWN)]
    )
    got = distance._likelihoods(block, otf, KNOWN.weights, few, NOISE)

    level = block.mean(axis=(1, 2), dtype=np.float64)
    spectrum = np.fft.rfft2((block / level[:, None, None] - 1) * distance._block_window())
    seen = spectrum.reshape(3, -1)[:, few.places] / distance.BLOCK_CELLS
    variance = (1e-5 * level + 1e-8) / (np.array([4, 8, 4]) * level**2)
    wanted = []
    for weights in KNOWN.weights:
        transfer = np.tensordot(weights, otf, axes=1)
        totals = []
        for power in distance.POWERS:
            total = 0.0
            for k in range(4):
                h, scale = transfer[:, k], power * few.fall[k]
                covariance = scale * np.outer(h, h.conj()) + np.diag(
                    scale * (distance.COLOUR_POWER * np.abs(h) ** 2 + distance.MISTRUST) + variance
                )
                y = seen[:, k]
                misfit = (y.conj() @ np.linalg.solve(covariance, y)).real
                tail = (distance.FREEDOM + 3) * np.log1p(misfit / distance.FREEDOM)
                total -= few.weight[k] * (tail + np.linalg.slogdet(covariance)[1])
            totals.append(total)
        wanted.append(max(totals))
    np.testing.assert_allclose(got, np.array(wanted) - max(wanted), atol=2e-2)


def test_kernels_in_cells_keep_their_light() -> None:
    for coarse in distance._coarse(KNOWN):
        np.testing.assert_allclose(coarse.kernels.sum(axis=(-2, -1)), 1, atol=1e-6)


def test_a_wrong_kernel_of_a_known_depth_is_no_less_likely_than_the_mixtures_beside_it() -> None:
    """A pure tone in the middle of the band, where one kernel is zero, outvotes no other."""
    steps = KNOWN.nearness.size
    jagged = np.where(np.arange(steps) % 2, 0.0, -40.0) - 20.0 * np.abs(np.arange(steps) - 8)
    (mean,) = distance._means(jagged[None, None], KNOWN.nearness).ravel()
    assert KNOWN.step_of(float(mean)) == 8


def test_a_few_frequencies_that_no_power_foresees_do_not_decide() -> None:
    planes = _blurred(_scene((512, 768), 11), KNOWN.at_step(8))
    across = np.arange(768, dtype=np.float32)
    grating = 0.15 * np.sin(2 * np.pi * 0.06 * across) * np.array([[[1.0]], [[-1.0]], [[0.3]]])
    found = _found((planes + grating).astype(np.float32), CFA)
    assert np.abs(found.values - KNOWN.nearness[8]).max() < 2 * np.diff(KNOWN.nearness)[0]


def test_what_clipped_is_not_asked_and_its_neighbours_answer() -> None:
    planes = _blurred(_scene((512, 1600), 4), KNOWN.at_step(12))
    clipped = np.zeros((1, 512, 1600), np.bool_)
    clipped[..., :400] = True
    found = _found(np.where(clipped, 1, planes).astype(np.float32), CFA, clipped)
    assert np.abs(found.values - KNOWN.nearness[12]).max() < 2 * np.diff(KNOWN.nearness)[0]


def test_a_capture_with_clipped_highlights_tells_its_distance() -> None:
    """A tenth of the samples clips, a few in every block."""
    planes = _blurred(_scene((512, 768), 4), KNOWN.at_step(12))
    white = np.quantile(planes[1], 0.9)
    clipped = (planes >= white).any(axis=0, keepdims=True)
    found = _found(np.minimum(planes, white).astype(np.float32), CFA, clipped)
    assert np.abs(found.values - KNOWN.nearness[12]).max() < 2 * np.diff(KNOWN.nearness)[0]


def test_where_nothing_tells_the_distance_kernels_are_the_mean() -> None:
    everywhere = np.ones((1, 512, 512), np.bool_)
    found = _found(np.ones((3, 512, 512), np.float32), CFA, everywhere)
    assert np.isnan(found.values).all()
    assert KNOWN.of_scene(found).number_at(100, 400) == MEAN


def test_even_odds_tell_nothing_and_one_sided_odds_do() -> None:
    even = np.zeros((1, 1, KNOWN.nearness.size))
    assert np.isnan(distance._means(even, KNOWN.nearness)).all()
    sided = even - 100.0 * np.arange(KNOWN.nearness.size)
    np.testing.assert_allclose(distance._means(sided, KNOWN.nearness), KNOWN.nearness[0], rtol=0.02)


@pytest.mark.parametrize("side", [(8, 8), (100, 60), (384, 1000)])
def test_captures_of_any_size_have_a_distance(side: tuple[int, int]) -> None:
    found = _found(_scene(side, 6), CFA)
    for x_px, y_px in itertools.product((0, side[1] - 1), (0, side[0] - 1)):
        assert MEAN <= KNOWN.of_scene(found).number_at(x_px, y_px) < KNOWN.nearness.size


@pytest.mark.parametrize(
    ("size_px", "blocks"), [((8, 8), 1), ((384, 384), 1), ((384, 390), 2), ((4000, 6000), 176)]
)
def test_blocks_that_are_asked_cover_the_capture(size_px: tuple[int, int], blocks: int) -> None:
    assert distance.search_blocks(size_px) == blocks


def test_threads_do_not_change_a_bit() -> None:
    planes = _blurred(_scene((512, 900), 7), KNOWN.at_step(5))
    np.testing.assert_array_equal(_found(planes, CFA).values, _found(planes, CFA, threads=3).values)
