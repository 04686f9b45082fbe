import numpy as np
import pytest

from camkit.bundle.stages import Wiener
from camkit.errors import UnsupportedError
from camkit.noise import NoiseModel
from camkit.runtime.bank.baselines import (
    admm_tv_filter,
    block_filter,
    restoration_bank,
    richardson_lucy_filter,
)
from camkit.runtime.bank.blocks import Block, to_otf
from tests.psf_factory import (
    ISO_100,
    blur_periodic,
    coma_kernels,
    disc_kernel,
    gaussian_kernel,
    local_psf,
    psnr_db,
    texture,
    with_noise,
)

SETTINGS = Wiener(block_px=64, overlap_px=24, prior_scale=3e-4, prior_exponent=2.5)
METHODS = ("wiener", "rl", "admm-tv", "cross-channel")
KERNEL = gaussian_kernel(1.8)
EVEN_SIDES = np.full((3, 4, 4), 1 / 16, np.float32)


def edges(size=96):
    """Flat patches with sharp edges, which total variation likes."""
    rng = np.random.default_rng(4)
    patches = rng.uniform(0.1, 0.9, (3, size // 12, size // 12))
    return np.kron(patches, np.ones((12, 12))).astype(np.float32)


def blurred_block(scene, kernel=KERNEL, unknown=None):
    planes = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(0))
    return Block(samples=planes, otf=to_otf(kernel, scene.shape[-1]), unknown=unknown)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scene", [edges(), texture(96, 96)], ids=["edges", "texture"])
def test_every_method_sharpens_a_blurred_noisy_picture(method, scene):
    block = blurred_block(scene)
    restored = block_filter(method, SETTINGS, ISO_100)(block)
    assert psnr_db(restored, scene) > psnr_db(block.samples, scene) + 1


def test_total_variation_beats_wiener_on_flat_patches():
    scene = edges()
    block = blurred_block(scene)
    tv, wiener = (block_filter(m, SETTINGS, ISO_100)(block) for m in ("admm-tv", "wiener"))
    assert psnr_db(tv, scene) > psnr_db(wiener, scene) + 1


@pytest.mark.parametrize("method", METHODS)
def test_light_is_neither_made_nor_lost(method):
    block = blurred_block(texture(96, 96))
    restored = block_filter(method, SETTINGS, ISO_100)(block)
    np.testing.assert_allclose(
        restored.mean(axis=(1, 2)), block.samples.mean(axis=(1, 2)), rtol=2e-3
    )


@pytest.mark.parametrize("method", METHODS)
def test_highlights_above_white_are_not_cut(method):
    scene = np.full((3, 64, 64), 0.1, dtype=np.float32)
    scene[:, 30:34, 30:34] = 20.0
    restored = block_filter(method, SETTINGS, ISO_100)(blurred_block(scene))
    assert restored.max() > 1.5 * blur_periodic(scene, KERNEL).max()


def test_richardson_lucy_is_never_negative():
    block = blurred_block(texture(64, 64) - 0.3)
    assert (richardson_lucy_filter(ISO_100)(block) >= 0).all()


@pytest.mark.parametrize("kernel", [KERNEL, EVEN_SIDES], ids=["odd", "even"])
def test_richardson_lucy_comes_closer_to_the_data_with_every_round(kernel):
    """That of scikit-image diverges from even sides (findings/skimage_kernels.sh)."""
    block = blurred_block(texture(64, 64), kernel)
    misfit = []
    for rounds in (0, 3, 10):
        sharp = richardson_lucy_filter(ISO_100, rounds=rounds)(block)
        again = np.fft.irfft2(np.fft.rfft2(sharp) * block.otf, s=(64, 64))
        misfit.append(np.square(again - block.samples).mean())
    assert misfit[0] > misfit[1] > misfit[2]


def test_richardson_lucy_makes_fewer_rounds_in_more_noise():
    loud = NoiseModel(shot=(4e-4,) * 3, read_variance=(1e-6,) * 3)
    block = blurred_block(texture(64, 64))
    gentle, strong = (richardson_lucy_filter(noise)(block) for noise in (loud, ISO_100))
    assert np.abs(np.diff(gentle, axis=2)).mean() < np.abs(np.diff(strong, axis=2)).mean()


def test_total_variation_falls_with_its_weight():
    block = blurred_block(texture(64, 64))
    variation = [
        np.abs(np.diff(admm_tv_filter(ISO_100, weight=weight)(block), axis=2)).sum()
        for weight in (0.3, 3, 30)
    ]
    assert variation[0] > variation[1] > variation[2]


def test_admm_reaches_the_minimum_that_plain_descent_reaches():
    """The objective after ADMM is no worse than after many steps of smoothed descent."""
    scene = edges(48)
    block = blurred_block(scene)
    weight = 3.0
    level = block.samples.mean(axis=(1, 2))
    beta = (weight * (ISO_100.shot[0] * level + ISO_100.read_variance[0]) / level)[:, None, None]

    def gradients(x):
        return np.roll(x, -1, 1) - x, np.roll(x, -1, 2) - x

    def blur(x, otf):
        return np.fft.irfft2(np.fft.rfft2(x) * otf, s=(48, 48))

    def objective(x):
        down, across = gradients(x)
        misfit = 0.5 * np.square(blur(x, block.otf) - block.samples)
        return float((misfit + beta * np.sqrt(down**2 + across**2)).sum())

    descended = block.samples.astype(np.float64)
    for _ in range(1500):
        down, across = gradients(descended)
        length = np.sqrt(down**2 + across**2 + 1e-6)
        pull = np.roll(down / length, 1, 1) - down / length
        pull += np.roll(across / length, 1, 2) - across / length
        misfit = blur(blur(descended, block.otf) - block.samples, np.conj(block.otf))
        descended -= 0.8 * (misfit + beta * pull)
    admm = admm_tv_filter(ISO_100, weight=weight, iterations=200)(block)
    assert objective(admm) <= objective(descended) * 1.01


@pytest.mark.parametrize("method", ["rl", "admm-tv", "cross-channel"])
def test_clipped_samples_are_not_taken_as_data(method):
    scene = 0.3 * texture(96, 96)
    scene[:, 44:50, 44:50] = 30.0
    kernel = disc_kernel(5)
    light = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(0))
    unknown = light >= 1
    otf = to_otf(kernel, 96)
    filter_ = block_filter(method, SETTINGS, ISO_100)
    naive = filter_(Block(samples=np.minimum(light, 1), otf=otf))
    aware = filter_(Block(samples=np.minimum(light, 1), otf=otf, unknown=unknown))
    far = np.ones((96, 96), dtype=bool)
    far[24:72, 24:72] = False
    errors = [np.square(x - scene)[:, far].mean() for x in (aware, naive)]
    assert errors[0] < errors[1]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("size", [(1, 1), (31, 17), (90, 75)])
def test_banks_of_every_method_take_any_size(method, size):
    planes = texture(size[1], size[0])
    psf = local_psf(*coma_kernels(radius_px=7), size)
    bank = restoration_bank(psf, SETTINGS, ISO_100, method=method, threads=2)
    restored = bank.restore_array(planes)
    assert restored.shape == planes.shape
    assert np.isfinite(restored).all()


def test_an_unknown_method_is_refused():
    with pytest.raises(UnsupportedError, match="admm-tv"):
        block_filter("magic", SETTINGS, ISO_100)
