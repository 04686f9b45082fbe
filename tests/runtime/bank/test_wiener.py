import numpy as np
import pytest
import scipy.ndimage
from hypothesis import given, settings
from hypothesis import strategies as st

from camkit.bundle.stages import Wiener
from camkit.noise import NoiseModel
from camkit.runtime.bank.baselines import restoration_bank
from camkit.runtime.bank.blocks import (
    Block,
    BlockBank,
    LocalPsf,
    lay_spans,
    taper_edges,
    to_otf,
)
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.bank.richardson_lucy import apply_transfer
from camkit.runtime.bank.wiener import CORNER_FREQUENCY, KERNEL_ERROR, wiener_filter
from camkit.runtime.geometry.sensor_window import SensorWindow
from tests.psf_factory import (
    ISO_100,
    PITCH_UM,
    QUIET,
    blur_directly,
    blur_periodic,
    coma_kernels,
    disc_kernel,
    gaussian_kernel,
    grid_psf,
    local_psf,
    psnr_db,
    streak_kernel,
    texture,
    uniform_psf,
    with_noise,
)

SMALL = Wiener(block_px=64, overlap_px=24, prior_scale=3e-4, prior_exponent=2.5)
DELTA = gaussian_kernel(0.01, 2)


def test_delta_psf_leaves_image_unchanged():
    planes = texture(150, 170)
    bank = restoration_bank(local_psf(DELTA, np.zeros(1), (170, 150)), SMALL, QUIET)
    np.testing.assert_allclose(bank.restore_array(planes), planes, atol=2e-5)


def test_bank_equals_the_full_frame_filter_away_from_borders():
    """One PSF everywhere and one noise-to-signal ratio: blocks of 512 / 160 change nothing."""
    size, kernel = 1024, gaussian_kernel(1.5)
    blurred = blur_periodic(texture(size, size), kernel)
    planes = with_noise(blurred, ISO_100, np.random.default_rng(0))
    fx = np.fft.rfftfreq(size)[None, :]
    f2 = np.fft.fftfreq(size)[:, None] ** 2 + fx**2 + CORNER_FREQUENCY**2

    def gain(otf, rise):
        return (np.conj(otf) / (np.abs(otf) ** 2 + rise)).astype(np.complex64)

    whole = apply_transfer(planes, gain(to_otf(kernel, size), f2**1.25))
    rise = (f2**1.25)[::2, ::2]

    def restore(block: Block):
        return apply_transfer(block.samples, gain(block.otf, rise))

    psf = local_psf(kernel, np.zeros(1), (size, size))
    bank = BlockBank(psf, restore, block_px=512, overlap_px=160)
    assert psnr_db(bank.restore_array(planes), whole, cut_px=96) > 85


def reference(planes, psf, noise):
    """The bank once more: float64, full transforms, no cache, no streaming, no mirrored OTF."""
    h, w = planes.shape[1:]
    out = np.zeros(planes.shape)
    ring = SMALL.overlap_px // 4
    ramp = np.minimum((np.arange(64) + 0.5) / ring, 1)
    ramp = np.sin(np.pi / 2 * np.minimum(ramp, ramp[::-1])) ** 2
    f = np.fft.fftfreq(64)
    rise = (f[:, None] ** 2 + f**2 + CORNER_FREQUENCY**2) ** (SMALL.prior_exponent / 2)
    for row in lay_spans(h, 64, 24):
        for col in lay_spans(w, 64, 24):
            kernel = psf.kernels.at(*psf.position_mm(col.centre, row.centre))
            half = kernel.shape[-1] // 2
            for c in range(3):
                spread = np.zeros((64, 64))
                spread[: 2 * half + 1, : 2 * half + 1] = kernel[c]
                otf = np.fft.fft2(np.roll(spread, (-half, -half), (0, 1)))
                block = planes[c][row.index][:, col.index].astype(np.float64)
                small = block.reshape(16, 4, 16, 4).mean(axis=(1, 3))
                low = np.fft.rfft2(small) * otf[np.r_[0:8, 56:64], :9]
                smooth = np.kron(np.fft.irfft2(low, s=(16, 16)), np.ones((4, 4)))
                block = smooth + np.outer(ramp, ramp) * (block - smooth)
                level = block.mean()
                variance = noise.shot[c] * level + noise.read_variance[c]
                floor = KERNEL_ERROR * (1 - np.abs(otf) ** 2)
                nsr = np.maximum(variance / (SMALL.prior_scale * level**2) * rise, floor)
                nsr[0, 0] = 0
                sharp = np.fft.fft2(block) * np.conj(otf) / (np.abs(otf) ** 2 + nsr)
                inner = np.fft.ifft2(sharp).real[row.inner, col.inner]
                top, left = row.start + row.inner.start, col.start + col.inner.start
                window = np.outer(row.weights, col.weights)
                high, wide = window.shape
                out[c, top : top + high, left : left + wide] += window * inner
    return out


@pytest.mark.parametrize("size", [(97, 130), (31, 17), (1, 1)])
def test_bank_equals_a_slow_obvious_twin(size):
    w, h = size
    planes = with_noise(texture(h, w), ISO_100, np.random.default_rng(1))
    psf = local_psf(*coma_kernels(radius_px=7), (w, h))
    restored = restoration_bank(psf, SMALL, ISO_100).restore_array(planes)
    np.testing.assert_allclose(restored, reference(planes, psf, ISO_100), atol=2e-5)


def blur_by_scattering(scene, psf):
    """Let every pixel scatter its own kernel, one after the other."""
    size, reach = scene.shape[1], psf.kernels.kernels.shape[-1] // 2
    canvas = np.zeros((3, size + 2 * reach, size + 2 * reach))
    weight = np.zeros_like(canvas)
    for row in range(size):
        for col in range(size):
            kernel = psf.kernels.at(*psf.position_mm(col, row))
            at = np.s_[:, row : row + 2 * reach + 1, col : col + 2 * reach + 1]
            canvas[at] += scene[:, row, col, None, None] * kernel
            weight[at] += kernel
    inner = np.s_[:, reach:-reach, reach:-reach]
    return (canvas[inner] / weight[inner]).astype(np.float32)


def test_a_varying_blur_is_undone_by_turned_kernels_only():
    size = 80
    scene = texture(size, size, seed=3)
    kernels, heights_mm = coma_kernels(radius_px=8, tail_px=12)
    psf = local_psf(kernels, heights_mm * 0.28, (size, size))
    blurred = blur_by_scattering(scene, psf)
    planes = with_noise(blurred, ISO_100, np.random.default_rng(0))
    tight = SMALL.model_copy(update={"block_px": 48, "overlap_px": 24})
    restored = restoration_bank(psf, tight, ISO_100).restore_array(planes)
    averaged = local_psf(kernels.mean(axis=0), np.zeros(1), (size, size))
    wrong = restoration_bank(averaged, tight, ISO_100).restore_array(planes)
    assert psnr_db(restored, scene, 10) > psnr_db(planes, scene, 10) + 1.5
    assert psnr_db(restored, scene, 10) > psnr_db(wrong, scene, 10) + 1.5


@pytest.mark.parametrize("method", ["wiener", "rl", "admm-tv"])
@pytest.mark.parametrize("symmetry", ["uniform", "grid"])
def test_streaks_of_direct_convolution_are_undone_by_their_own_kernels_only(symmetry, method):
    """Every pixel scatters the streak of its place; the mirror image of it restores nothing."""
    size = 64
    at_mm = np.array([-0.2, 0.2])
    turned = np.stack([streak_kernel(turn, 7, 8) for turn in (15.0, 40.0, 65.0, 90.0)])
    window = SensorWindow(
        size_px=(size, size),
        origin_px=(0, 0),
        sensor_size_px=(size, size),
        pitch_um=PITCH_UM,
        axis_px=(30.0, 35.0),
    )

    def local(kernels):
        psf = uniform_psf(kernels[0])
        if symmetry == "grid":
            psf = grid_psf(kernels.reshape(2, 2, 17, 17), at_mm, at_mm)
        fields = color_kernels(psf, np.array([0.5, 0.6]), np.ones((2, 2)))
        return LocalPsf(kernels=fields, window=window)

    scene = texture(size, size, seed=3)[:2]
    noise = NoiseModel(shot=ISO_100.shot[:2], read_variance=ISO_100.read_variance[:2])
    right, mirrored = local(turned), local(np.ascontiguousarray(turned[:, ::-1, ::-1]))
    planes = with_noise(blur_directly(scene, right), noise, np.random.default_rng(0))
    tight = SMALL.model_copy(update={"block_px": 48, "overlap_px": 24})
    found_db, wrong_db = (
        psnr_db(restoration_bank(psf, tight, noise, method=method).restore_array(planes), scene, 8)
        for psf in (right, mirrored)
    )
    assert found_db > psnr_db(planes, scene, 8) + 1.5
    assert found_db > wrong_db + 4


@pytest.mark.parametrize("method", ["wiener", "admm-tv"])
@pytest.mark.parametrize("channels", [1, 2, 5])
def test_every_channel_is_restored_as_if_alone(channels, method):
    """Not so Richardson-Lucy: the channels of a block share its number of rounds."""
    kernels = np.stack([streak_kernel(50.0 * c, 5, 6) for c in range(channels)])
    planes = np.resize(texture(60, 70, seed=1), (channels, 60, 70))
    noise = NoiseModel(
        shot=tuple(np.linspace(1e-5, 1e-4, channels)), read_variance=(1e-8,) * channels
    )
    saturated = planes > 0.65
    aware = SMALL.model_copy(update={"clip_iterations": 2})

    def restored(which):
        psf = local_psf(kernels[which][None], np.zeros(1), (70, 60))
        part = NoiseModel(shot=noise.shot[which], read_variance=noise.read_variance[which])
        bank = restoration_bank(psf, aware, part, method=method)
        return bank.restore_array(planes[which], saturated[which])

    together = restored(slice(None))
    for c in range(channels):
        np.testing.assert_allclose(together[c], restored(slice(c, c + 1))[0], atol=1e-5)


def test_more_noise_is_restored_more_gently():
    kernel = gaussian_kernel(2.0)
    scene = texture(64, 64)
    block = Block(samples=blur_periodic(scene, kernel), otf=to_otf(kernel, 64))
    # Quieter captures are all held by the same floor, that of the kernel's own error.
    loud = NoiseModel(shot=(1e-3,) * 3, read_variance=(1e-5,) * 3)
    louder = NoiseModel(shot=(1e-2,) * 3, read_variance=(1e-4,) * 3)
    detail = [
        np.abs(np.diff(wiener_filter(SMALL, noise)(block), axis=2)).mean()
        for noise in (ISO_100, loud, louder)
    ]
    assert detail[0] > detail[1] > detail[2]


def test_regularisation_that_follows_the_noise_beats_a_fixed_one():
    kernel, scene = gaussian_kernel(2.0), texture(64, 64, seed=5)
    loud = NoiseModel(shot=(2e-2,) * 3, read_variance=(1e-3,) * 3)
    planes = with_noise(blur_periodic(scene, kernel), loud, np.random.default_rng(0))
    block = Block(samples=planes, otf=to_otf(kernel, 64))
    followed = psnr_db(wiener_filter(SMALL, loud)(block), scene)
    assert followed > psnr_db(wiener_filter(SMALL, ISO_100)(block), scene) + 1
    assert followed > psnr_db(planes, scene)


def test_the_mean_is_kept():
    kernel = gaussian_kernel(2.0)
    planes = texture(64, 64)
    restored = wiener_filter(SMALL, ISO_100)(Block(samples=planes, otf=to_otf(kernel, 64)))
    np.testing.assert_allclose(restored.mean(axis=(1, 2)), planes.mean(axis=(1, 2)), rtol=1e-5)


def test_a_black_picture_stays_black():
    planes = np.zeros((3, 64, 64), dtype=np.float32)
    block = Block(samples=planes, otf=to_otf(gaussian_kernel(2.0), 64))
    np.testing.assert_array_equal(wiener_filter(SMALL, ISO_100)(block), 0)


def lamp_capture():
    """A lamp 30 times above white, its blurred and clipped capture, and what clipped."""
    kernel, scene = disc_kernel(7), 0.3 * texture(128, 128, seed=2)
    rows, cols = np.ogrid[:128, :128]
    scene[:, (rows - 64) ** 2 + (cols - 60) ** 2 <= 16] = 30.0
    light = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(0))
    saturated = light >= 1
    return kernel, scene, np.minimum(light, 1), saturated


def far_error_db(restored, scene, saturated):
    far = scipy.ndimage.distance_transform_edt(~saturated.any(axis=0)) > 12
    return float(-10 * np.log10(np.square(restored - scene)[:, far].mean()))


def test_a_clipped_lamp_does_not_haze_its_surroundings():
    kernel, scene, planes, saturated = lamp_capture()
    block = Block(samples=planes, otf=to_otf(kernel, 128), unknown=saturated)
    as_data = wiener_filter(SMALL, ISO_100)(block)
    aware = SMALL.model_copy(update={"clip_iterations": 6})
    as_unknown = wiener_filter(aware, ISO_100)(block)
    gain_db = far_error_db(as_unknown, scene, saturated) - far_error_db(as_data, scene, saturated)
    assert gain_db > 6
    assert as_unknown.max() > 1.5


def test_blocks_without_clipped_samples_ignore_the_clip_iterations():
    planes = texture(100, 100)
    psf = local_psf(gaussian_kernel(1.5), np.zeros(1), (100, 100))
    aware = SMALL.model_copy(update={"clip_iterations": 6})
    none = np.zeros((100, 100), dtype=bool)
    np.testing.assert_array_equal(
        restoration_bank(psf, aware, ISO_100).restore_array(planes, none),
        restoration_bank(psf, SMALL, ISO_100).restore_array(planes),
    )


@given(st.integers(1, 140), st.integers(1, 140))
@settings(deadline=None, max_examples=12)
def test_any_size_gives_the_same_bits_on_one_and_two_threads(h, w):
    planes = with_noise(texture(h, w), ISO_100, np.random.default_rng(0))
    psf = local_psf(*coma_kernels(radius_px=7), (w, h))
    saturated = planes > 0.7
    aware = SMALL.model_copy(update={"clip_iterations": 2})
    one, two = (
        restoration_bank(psf, aware, ISO_100, threads=n).restore_array(planes, saturated)
        for n in (1, 2)
    )
    assert one.shape == planes.shape
    assert np.isfinite(one).all()
    np.testing.assert_array_equal(one, two)


def test_the_taper_keeps_a_ramp_from_ringing_through_its_block():
    kernel = disc_kernel(5)
    otf = to_otf(kernel, 64)
    ramp = np.ascontiguousarray(
        np.broadcast_to(np.linspace(0.1, 0.9, 64, dtype=np.float32), (3, 64, 64))
    )
    inner = np.s_[:, 16:-16, 16:-16]
    ringing = [
        np.abs(wiener_filter(SMALL, ISO_100)(Block(samples=block, otf=otf)) - ramp)[inner].max()
        for block in (ramp, taper_edges(ramp, otf, 12))
    ]
    assert ringing[1] < 0.3 * ringing[0]
