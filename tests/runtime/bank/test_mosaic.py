"""The filter on the mosaic: the best linear estimate, wherever red lies and however it is cut."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from camkit.arrays import FloatArray
from camkit.bundle.stages import Mosaic, Together, Wiener
from camkit.cfa import CfaPattern, cfa_channels
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import Block, BlockBank, to_otf
from camkit.runtime.bank.joint_colours import CORNER_FREQUENCY
from camkit.runtime.bank.mosaic import BAND, mosaic_transfer, restore_mosaic
from camkit.runtime.bank.wiener import wiener_filter
from camkit.runtime.signal.demosaic import demosaic
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

REDS = ((0, 0), (0, 1), (1, 0), (1, 1))
PATTERNS: tuple[CfaPattern, ...] = ("RGGB", "GRBG", "GBRG", "BGGR")
"""Names of the places of red in `REDS`."""
COLOURS = np.array([0, 1, 1, 2])
LEVEL = np.array([0.2, 0.3, 0.12])
VARIANCE = np.array([2e-5, 1e-5, 3e-5])
HEIGHT_MM = 4.0
SMOOTH = Mosaic(within_mm=5.0, smooth_below=6.0, smooth_follow=0.7)
BANK = Wiener(
    prior_scale=3e-4,
    prior_exponent=2.5,
    block_px=48,
    overlap_px=16,
    together=TOGETHER,
    mosaic=Mosaic(within_mm=100.0),
)


def _kernels() -> FloatArray:
    """Return kernels of three colours, lopsided, the last by far the sharpest."""
    kernels = np.zeros((3, 7, 7), np.float32)
    y, x = np.mgrid[-3:4, -3:4]
    for kernel, sigma in zip(kernels, (1.8, 1.2, 0.6), strict=True):
        kernel[:] = np.exp(-(x**2 + y**2) / (2 * sigma**2)) * (1 + 0.2 * x + 0.1 * y) ** 2
    return kernels / kernels.sum((1, 2), keepdims=True)


def _places(red: tuple[int, int]) -> list[tuple[int, int]]:
    y, x = red
    return [(y, x), (y, 1 - x), (1 - y, x), (1 - y, 1 - x)]


def _whole(otf: np.ndarray) -> np.ndarray:
    side = otf.shape[1]
    return np.fft.fft2(np.fft.irfft2(otf.astype(np.complex128), s=(side, side)))


def _prior(side: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return f^2, F times the samples, and V of a field height."""
    f = np.fft.fftfreq(side)
    f2 = f[:, None] ** 2 + f[None] ** 2
    fall = side**2 * (f2 + CORNER_FREQUENCY**2) ** (-TOGETHER.exponent / 2)
    table, part = np.array(SPREAD.variance), HEIGHT_MM / SPREAD.heights_mm[1]
    lines = (1 - part) * table[0] + part * table[1]
    spread = [np.interp(np.sqrt(f2), SPREAD.frequencies, line) for line in lines]
    return f2, fall, np.stack(spread)


def _by_solving(samples: FloatArray, otf: np.ndarray, red: tuple[int, int]) -> FloatArray:
    """Return the estimate of one dense 4x4 system at every frequency."""
    side = samples.shape[-1]
    n, (f2, fall, spread), h, places = side // 2, _prior(side), _whole(otf), _places(red)
    a, same = (LEVEL / LEVEL.mean())[COLOURS], COLOURS[:, None] == COLOURS
    scale = TOGETHER.scale * LEVEL.mean() ** 2
    planes = np.stack([samples[c, y::2, x::2] for c, (y, x) in zip(COLOURS, places, strict=True)])
    means = np.array([planes[c == COLOURS].mean(dtype=np.float64) for c in range(3)])
    data = np.fft.fft2(planes - means[COLOURS][:, None, None]) / a[:, None, None]
    found = np.zeros((3, side, side), complex)
    f = np.fft.fftfreq(side)

    def solve(factor: float) -> float:
        measured = expected = 0.0
        for i, j in np.ndindex(n, n):
            system = np.diag(n**2 * VARIANCE[COLOURS] / (a**2 * scale * factor)).astype(complex)
            aliases = []
            for at in ((i, j), (i, j + n), (i + n, j), (i + n, j + n)):
                phase = [np.exp(2j * np.pi * np.dot(at, place) / side) / 4 for place in places]
                u = h[(COLOURS, *at)] * phase
                doubt = TOGETHER.mistrust * spread[(COLOURS, *at)] * np.outer(phase, np.conj(phase))
                of_scene = np.outer(u, u.conj()) * (1 + TOGETHER.own * same)
                system += fall[at] * (of_scene + same * doubt)
                aliases.append((at, u))
            z = np.linalg.solve(system, data[:, i, j])
            for at, u in aliases:
                t = np.array([(u.conj() * z)[c == COLOURS].sum() for c in range(3)])
                light = t.sum() + TOGETHER.own * t
                found[(slice(None), *at)] = LEVEL / LEVEL.mean() * fall[at] * light
                is_low = max(abs(f[at[0]]), abs(f[at[1]])) <= 0.25
                if is_low and BAND[0] ** 2 <= f2[at] < BAND[1] ** 2:
                    measured += fall[at] ** 2 * abs(np.vdot(u, z)) ** 2
                    unit = np.vdot(u, np.linalg.solve(system, u)).real
                    expected += scale * fall[at] ** 2 * unit
        return measured / expected

    k = solve(1.0)
    smooth = min(1.0, k / SMOOTH.smooth_below) ** SMOOTH.smooth_follow
    assert smooth < 1
    solve(k**TOGETHER.follow * smooth)
    found[:, 0, 0] = means * side**2
    return np.asarray(np.fft.ifft2(found).real)


def _restored(planes: FloatArray, otf: np.ndarray, red: tuple[int, int], **changed: Any) -> Any:
    model = TOGETHER.model_copy(update=changed)
    known = mosaic_transfer(otf, HEIGHT_MM, model)
    return restore_mosaic(
        planes, known, red=red, level=LEVEL, variance=VARIANCE, model=model, mosaic=SMOOTH
    )


@pytest.mark.parametrize("side", [16, 18])
@pytest.mark.parametrize("red", REDS)
def test_it_solves_the_system_of_every_frequency(side: int, red: tuple[int, int]) -> None:
    otf = to_otf(_kernels(), side)
    planes = blur_periodic(texture(side, side, seed=1), _kernels())
    expected = _by_solving(planes, otf, red)
    np.testing.assert_allclose(
        _restored(planes, otf, red), expected, atol=1e-4 * np.abs(expected).max()
    )


def test_it_is_the_best_linear_estimate_of_the_samples() -> None:
    """One matrix for a whole small block, of its covariances in space."""
    side, red = 8, (1, 0)
    kernels = _kernels()
    otf, (_, fall, spread), a = to_otf(kernels, side), _prior(side), LEVEL / LEVEL.mean()
    planes = blur_periodic(texture(side, side, seed=1), kernels)

    def circulant(spectrum: np.ndarray) -> np.ndarray:
        response = np.fft.ifft2(spectrum).real
        rows = [np.roll(response, at, (0, 1)).ravel() for at in np.ndindex(side, side)]
        return np.stack(rows, axis=1)

    power = TOGETHER.scale * LEVEL.mean() ** 2 * fall / side**2
    shared = circulant(power)
    scene = np.block(
        [[a[c] * a[d] * shared * (1 + TOGETHER.own * (c == d)) for d in range(3)] for c in range(3)]
    )
    zeros = np.zeros_like(shared)
    blur = [circulant(plane) for plane in _whole(otf)]
    blur = np.block([[blur[c] if c == d else zeros for d in range(3)] for c in range(3)])
    doubt = [circulant(TOGETHER.mistrust * spread[c] * power * a[c] ** 2) for c in range(3)]
    doubt = np.block([[doubt[c] if c == d else zeros for d in range(3)] for c in range(3)])
    sampled, means = np.zeros((3, side, side), bool), np.zeros(3)
    for c, (y, x) in zip(COLOURS, _places(red), strict=True):
        sampled[c, y::2, x::2] = True
    for c in range(3):
        means[c] = planes[c][sampled[c]].mean()
    at = sampled.ravel()
    noise = np.diag(np.repeat(VARIANCE, side * side))
    data = (blur @ scene @ blur.T + doubt + noise)[at][:, at]
    known = (planes - means[:, None, None]).ravel()[at]
    estimate = (scene @ blur.T)[:, at] @ np.linalg.solve(data, known)
    estimate = estimate.reshape(3, side, side)
    estimate += (means - estimate.mean((1, 2)))[:, None, None]
    model = TOGETHER.model_copy(update={"follow": 0.0})
    plain = SMOOTH.model_copy(update={"smooth_follow": 0.0})
    found = restore_mosaic(
        planes,
        mosaic_transfer(otf, HEIGHT_MM, model),
        red=red,
        level=LEVEL,
        variance=VARIANCE,
        model=model,
        mosaic=plain,
    )
    np.testing.assert_allclose(found, estimate, atol=2e-4 * np.abs(estimate).max())


@pytest.mark.parametrize("red", REDS)
def test_a_shifted_block_is_restored_to_the_shifted_picture(red: tuple[int, int]) -> None:
    otf = to_otf(_kernels(), 32)
    planes = blur_periodic(texture(32, 32, seed=1), _kernels())
    shifted = _restored(np.roll(planes, red, (1, 2)), otf, red)
    np.testing.assert_allclose(
        np.roll(shifted, (-red[0], -red[1]), (1, 2)), _restored(planes, otf, (0, 0)), atol=2e-5
    )


def _captured(
    scene: FloatArray, kernels: FloatArray, pattern: CfaPattern, seed: int = 0
) -> FloatArray:
    """Return the demosaicked planes of a mosaic that a scene was photographed with."""
    planes = with_noise(blur_periodic(scene, kernels), ISO_100, np.random.default_rng(seed))
    return demosaic(_mosaic(planes, pattern), pattern)


def _mosaic(planes: FloatArray, pattern: CfaPattern) -> FloatArray:
    mosaic = np.empty(planes.shape[1:], np.float32)
    for y, row in enumerate(cfa_channels(pattern)):
        for x, c in enumerate(row):
            mosaic[y::2, x::2] = planes[c, y::2, x::2]
    return mosaic


def test_detail_that_a_demosaic_folds_is_told_by_a_sharp_colour() -> None:
    grey = texture(128, 128, seed=3).mean(axis=0)
    scene = np.asarray(grey * np.array([0.9, 1.0, 0.7], np.float32)[:, None, None], np.float32)
    planes, otf = _captured(scene, _kernels(), "RGGB"), to_otf(_kernels(), 128)
    by_planes, by_samples = (
        wiener_filter(BANK, ISO_100)(Block(samples=planes, otf=otf, red=red))
        for red in (None, (0, 0))
    )
    assert psnr_db(by_samples, scene) > psnr_db(by_planes, scene) + 0.5


@pytest.mark.parametrize(("red", "pattern"), list(zip(REDS, PATTERNS, strict=True)))
def test_a_place_serves_the_blocks_that_mirror_it(
    red: tuple[int, int], pattern: CfaPattern
) -> None:
    psf = local_psf(*coma_kernels(radius_px=6), (151, 110))
    planes = demosaic(_mosaic(texture(110, 151), pattern), pattern)
    bare = BANK.model_copy(update={"overlap_px": 2})
    shared = restoration_bank(psf, bare, ISO_100, red=red).restore_array(planes)
    alone = BlockBank(psf, wiener_filter(bare, ISO_100), block_px=48, overlap_px=2, red=red)
    np.testing.assert_allclose(alone.restore_array(planes), shared, atol=1e-5)
    threads = restoration_bank(psf, bare, ISO_100, red=red, threads=3).restore_array(planes)
    np.testing.assert_array_equal(threads, shared)
    other = restoration_bank(psf, bare, ISO_100, red=REDS[3 - REDS.index(red)])
    assert np.abs(other.restore_array(planes) - shared).max() > 1e-3


def test_a_mirrored_picture_is_restored_to_the_mirror_image() -> None:
    psf = local_psf(*coma_kernels(radius_px=6), (150, 110))
    planes = demosaic(_mosaic(texture(110, 150), "GRBG"), "GRBG")
    bare = BANK.model_copy(update={"overlap_px": 2})
    whole = restoration_bank(psf, bare, ISO_100, red=(0, 1)).restore_array(planes)
    mirrored = np.ascontiguousarray(planes[:, ::-1, ::-1])
    turned = restoration_bank(psf, bare, ISO_100, red=(1, 0)).restore_array(mirrored)
    np.testing.assert_allclose(turned[:, ::-1, ::-1], whole, atol=1e-5)


def test_only_blocks_within_the_height_change() -> None:
    psf, planes = local_psf(*coma_kernels(radius_px=6), (300, 200)), texture(200, 300)
    outer = restoration_bank(psf, BANK.model_copy(update={"mosaic": None}), ISO_100, red=(0, 0))
    outer_planes = outer.restore_array(planes)
    np.testing.assert_array_equal(
        restoration_bank(psf, BANK, ISO_100).restore_array(planes), outer_planes
    )
    heights = [np.hypot(*psf.position_mm(x, y)) for x, y in ((0, 0), (149.5, 99.5))]
    near = BANK.model_copy(update={"mosaic": Mosaic(within_mm=float(heights[0]) / 3)})
    mixed = restoration_bank(psf, near, ISO_100, red=(0, 0)).restore_array(planes)
    inner = restoration_bank(psf, BANK, ISO_100, red=(0, 0)).restore_array(planes)
    np.testing.assert_array_equal(mixed[:, :16, :16], outer_planes[:, :16, :16])
    np.testing.assert_array_equal(mixed[:, 95:105, 145:155], inner[:, 95:105, 145:155])
    # no seam: steps between neighbouring pixels are as large as in either
    steps = [np.abs(np.diff(one, axis=2)).max() for one in (mixed, inner, outer_planes)]
    assert steps[0] < 1.05 * max(steps[1:])


@pytest.mark.parametrize("size", [(97, 64), (1, 40), (2, 50)])
def test_even_light_stays_even(size: tuple[int, int]) -> None:
    psf = local_psf(*coma_kernels(radius_px=6), size)
    light = np.array([0.2, 0.5, 0.3], np.float32)[:, None, None]
    planes = np.broadcast_to(light, (3, size[1], size[0])).copy()
    restored = restoration_bank(psf, BANK, ISO_100, red=(0, 1)).restore_array(planes)
    np.testing.assert_allclose(restored, planes, atol=1e-5)
    black = restoration_bank(psf, BANK, ISO_100, red=(0, 1)).restore_array(np.zeros_like(planes))
    np.testing.assert_array_equal(black, 0)


def test_samples_beside_clipped_ones_are_used_as_measured() -> None:
    scene = texture(96, 96, seed=2) * np.float32(0.5)
    scene[:, 40:56, 40:56] += 0.8
    planes = with_noise(blur_periodic(scene, _kernels()), ISO_100, np.random.default_rng(0))
    raw = _mosaic(planes, "RGGB")
    clipped = raw >= 1
    developed = demosaic(np.minimum(raw, 1), "RGGB")
    bank = BANK.model_copy(update={"clip_iterations": 3, "clip_power": 2.0, "clip_reach_px": 16})
    block = Block(samples=developed, otf=to_otf(_kernels(), 96), unknown=clipped[None], red=(0, 0))
    near = np.zeros((96, 96), bool)
    near[30:66, 30:66] = ~clipped[30:66, 30:66]
    by_samples, by_planes = (
        wiener_filter(bank, ISO_100)(one)[:, near] for one in (block, replace(block, red=None))
    )
    assert psnr_db(by_samples, scene[:, near]) > psnr_db(by_planes, scene[:, near]) + 0.5


def test_a_bank_on_the_mosaic_needs_the_numbers_of_all_colours() -> None:
    with pytest.raises(ValidationError, match="mosaic needs together"):
        Wiener(prior_scale=1.0, prior_exponent=2.0, mosaic=SMOOTH)
    (need,) = BANK.needs()
    assert need.version == (2, 10)
    assert Together.model_validate(TOGETHER.model_dump()) == TOGETHER
