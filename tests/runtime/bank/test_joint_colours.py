"""Colours restored together: the best linear estimate, and better than each alone."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from camkit.arrays import FloatArray
from camkit.bundle.stages import Together, Wiener
from camkit.bundle.stages.together import BAND, BAND_STEP, Spread
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import Block, BlockBank, to_otf
from camkit.runtime.bank.joint_colours import (
    BINNED_NOISE,
    CORNER_FREQUENCY,
    binned_model,
    restore_together,
    transfer_of,
)
from camkit.runtime.bank.wiener import wiener_filter
from tests.psf_factory import (
    ISO_100,
    blur_periodic,
    coma_kernels,
    local_psf,
    psnr_db,
    texture,
    with_noise,
)
from tests.together_factory import SPREAD, TOGETHER

SIZE = 48
LEVEL = np.array([0.2, 0.3, 0.12])
VARIANCE = np.array([2e-5, 1e-5, 3e-5])


def _kernels() -> FloatArray:
    """Give kernels of three colours, the last by far the sharpest."""
    kernels = np.zeros((3, 21, 21), np.float32)
    y, x = np.mgrid[-10:11, -10:11]
    for kernel, sigma in zip(kernels, (4.0, 2.5, 0.7), strict=True):
        kernel[:] = np.exp(-(x**2 + y**2) / (2 * sigma**2)) * (1 + 0.1 * x / 10)
    return kernels / kernels.sum((1, 2), keepdims=True)


def _by_matrices(planes: FloatArray, otf: np.ndarray, height_mm: float) -> FloatArray:
    """Give the best linear estimate, frequency by frequency, from the covariances themselves."""
    spectrum = np.fft.rfft2(planes.astype(np.float64))
    fy, fx = np.fft.fftfreq(SIZE)[:, None], np.fft.rfftfreq(SIZE)[None]
    f2 = fy**2 + fx**2
    mean = LEVEL.mean()
    a = LEVEL / mean
    table = np.array(SPREAD.variance)
    part = height_mm / SPREAD.heights_mm[1]
    lines = (1 - part) * table[0] + part * table[1]
    spread = np.stack([np.interp(np.sqrt(f2), SPREAD.frequencies, line) for line in lines])
    prior = TOGETHER.scale * mean**2 * (f2 + CORNER_FREQUENCY**2) ** (-TOGETHER.exponent / 2)
    prior *= SIZE**2
    rise = np.exp(
        [n + 4 * s * f2 for n, s in zip(TOGETHER.noise, TOGETHER.noise_rise, strict=True)]
    )
    noise = rise * VARIANCE[:, None, None] * SIZE**2
    light, expected = np.zeros(f2.shape, complex), np.zeros(f2.shape)
    found = np.zeros(spectrum.shape, complex)

    def solve(factor: float) -> None:
        for i, j in np.ndindex(f2.shape):
            scene = prior[i, j] * factor
            of_scene = scene * (np.outer(a, a) + TOGETHER.own * np.diag(a**2))
            h = np.diag(otf[:, i, j].astype(np.complex128))
            doubt = TOGETHER.mistrust * spread[:, i, j] * a**2 * scene
            of_data = h @ of_scene @ h.conj().T + np.diag(noise[:, i, j] + doubt)
            gain = np.linalg.inv(of_data)
            found[:, i, j] = of_scene @ h.conj().T @ gain @ spectrum[:, i, j]
            shared = scene * a @ h.conj().T @ gain
            light[i, j] = shared @ spectrum[:, i, j]
            expected[i, j] = (shared @ of_data @ shared.conj().T).real

    solve(1.0)
    coarse = np.s_[::BAND_STEP, ::BAND_STEP]
    band = (f2[coarse] >= BAND[0] ** 2) & (f2[coarse] <= BAND[1] ** 2)
    ratio = (np.abs(light[coarse]) ** 2)[band].sum() / expected[coarse][band].sum()
    solve(ratio**TOGETHER.follow)
    found[:, 0, 0] = spectrum[:, 0, 0]
    return np.fft.irfft2(found, s=(SIZE, SIZE))


@pytest.mark.parametrize("height_mm", [0.0, 4.0, 10.0])
def test_it_is_the_best_linear_estimate_of_its_model(height_mm: float) -> None:
    otf = to_otf(_kernels(), SIZE)
    planes = with_noise(
        blur_periodic(texture(SIZE, SIZE, seed=1), _kernels()), ISO_100, np.random.default_rng(0)
    )
    known = transfer_of(otf, height_mm, TOGETHER)
    found = restore_together(planes, known, level=LEVEL, variance=VARIANCE, model=TOGETHER)
    expected = _by_matrices(planes, otf, height_mm)
    np.testing.assert_allclose(found, expected, atol=2e-4 * np.abs(expected).max())


def test_a_height_beyond_the_table_is_that_of_its_end() -> None:
    otf, planes = to_otf(_kernels(), SIZE), texture(SIZE, SIZE, seed=1)

    def at(height_mm: float) -> FloatArray:
        known = transfer_of(otf, height_mm, TOGETHER)
        return restore_together(planes, known, level=LEVEL, variance=VARIANCE, model=TOGETHER)

    np.testing.assert_array_equal(at(10.0), at(25.0))
    assert np.abs(at(0.0) - at(10.0)).max() > 1e-5


def _banks(**changed: Any) -> tuple[Wiener, Wiener]:
    plain = Wiener(prior_scale=3e-4, prior_exponent=2.5)
    return plain, plain.model_copy(update={"together": TOGETHER.model_copy(update=changed)})


def test_a_blurred_colour_learns_from_a_sharp_one() -> None:
    grey = texture(128, 128, seed=3).mean(axis=0)
    tint = np.array([0.9, 1.0, 0.7], np.float32)[:, None, None]
    scene = np.asarray(grey * tint, np.float32)
    kernels = _kernels()
    planes = with_noise(blur_periodic(scene, kernels), ISO_100, np.random.default_rng(0))
    block = Block(samples=planes, otf=to_otf(kernels, 128))
    alone, together = (wiener_filter(bank, ISO_100)(block) for bank in _banks())
    assert psnr_db(together[0], scene[0]) > psnr_db(alone[0], scene[0]) + 3
    assert psnr_db(together, scene) > psnr_db(alone, scene) + 2


def test_a_place_serves_the_blocks_that_mirror_it_whatever_the_threads() -> None:
    psf, planes = local_psf(*coma_kernels(radius_px=6), (150, 110)), texture(110, 150)
    mask = planes[:1] > 0.75
    bank = _banks()[1].model_copy(
        update={"block_px": 48, "overlap_px": 16, "clip_iterations": 2, "clip_reach_px": 8}
    )
    whole = restoration_bank(psf, bank, ISO_100).restore_array(planes, mask)
    shared = restoration_bank(psf, bank, ISO_100, threads=3).restore_array(planes, mask)
    np.testing.assert_array_equal(shared, whole)
    # Without a tapered ring, whose coarse picture is no mirror image at its highest frequency.
    bare = bank.model_copy(update={"overlap_px": 2, "clip_reach_px": None})
    whole = restoration_bank(psf, bare, ISO_100).restore_array(planes, mask)
    alone = BlockBank(psf, wiener_filter(bare, ISO_100), block_px=48, overlap_px=2)
    np.testing.assert_allclose(alone.restore_array(planes, mask), whole, atol=2e-6)


def test_kernels_of_one_field_still_mistrust_by_height() -> None:
    psf, planes = local_psf(_kernels(), np.zeros(1), (150, 110)), texture(110, 150)
    bank = _banks()[1].model_copy(update={"block_px": 48, "overlap_px": 16})
    filter_ = wiener_filter(bank, ISO_100)
    alone = BlockBank(psf, filter_, block_px=48, overlap_px=16).restore_array(planes)
    np.testing.assert_array_equal(restoration_bank(psf, bank, ISO_100).restore_array(planes), alone)


def test_mean_levels_and_black_blocks_stay() -> None:
    otf = to_otf(_kernels(), SIZE)
    _, bank = _banks()
    planes = texture(SIZE, SIZE, seed=2)
    restored = wiener_filter(bank, ISO_100)(Block(samples=planes, otf=otf))
    np.testing.assert_allclose(restored.mean((1, 2)), planes.mean((1, 2)), rtol=1e-5)
    black = Block(samples=np.zeros_like(planes), otf=otf)
    np.testing.assert_array_equal(wiener_filter(bank, ISO_100)(black), 0)


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"heights_mm": (0.0, 0.0)}, "heights_mm must increase from 0"),
        ({"heights_mm": (1.0, 2.0)}, "heights_mm must increase from 0"),
        ({"frequencies": (0.0, 0.3, 0.2, 0.5)}, "frequencies must increase from 0"),
        ({"heights_mm": (0.0, 1.0, 2.0)}, "one entry for each of heights_mm"),
        ({"frequencies": (0.0, 0.5)}, r"must be \(height, colour, frequency\)"),
        ({"variance": (((-1.0,) * 4,) * 3,) * 2}, "greater than or equal to 0"),
    ],
)
def test_tables_that_make_no_sense_are_refused(changed: dict[str, Any], told: str) -> None:
    with pytest.raises(ValidationError, match=told):
        Spread(**(SPREAD.model_dump() | changed))


def test_every_colour_needs_its_noise() -> None:
    with pytest.raises(ValidationError, match="one number for each of 3"):
        Together(**(TOGETHER.model_dump() | {"noise": (0.1, 0.2)}))


def test_means_over_squares_have_the_doubts_of_their_frequencies_and_white_noise() -> None:
    model = binned_model(TOGETHER, 2)
    frequencies = np.array(TOGETHER.spread.frequencies)
    np.testing.assert_allclose(model.spread.frequencies, 2 * frequencies)
    assert model.spread.variance == TOGETHER.spread.variance
    assert set(model.noise_rise) == {0.0}
    assert set(model.noise) == {BINNED_NOISE}
