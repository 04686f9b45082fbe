import numpy as np
import pytest
import torch

from camkit.bundle.stages import Wiener
from camkit.models_def.sensors.wiener import taper_edges as taper_torch
from camkit.models_def.sensors.wiener import to_otf as to_otf_torch
from camkit.models_def.sensors.wiener import wiener_restore
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf
from camkit.runtime.bank.wiener import wiener_filter
from tests.psf_factory import (
    ISO_100,
    blur_periodic,
    coma_kernels,
    streak_kernel,
    texture,
    with_noise,
)
from tests.together_factory import TOGETHER

TOLERANCE = 1e-5
KERNELS = coma_kernels(radius_px=10)[0]


def tensors(noise):
    return torch.tensor(noise.shot), torch.tensor(noise.read_variance)


def settings(clip_iterations, clip_reach_px=None, together=None, clip_power=1.0):
    return Wiener(
        clip_power=clip_power,
        together=together,
        block_px=64,
        overlap_px=24,
        prior_scale=3e-4,
        prior_exponent=2.5,
        clip_iterations=clip_iterations,
        clip_reach_px=clip_reach_px,
    )


@pytest.mark.parametrize("size", [64, 66, 63])
@pytest.mark.parametrize(("clip_iterations", "reach"), [(0, None), (6, None), (6, 16), (6, 5)])
@pytest.mark.parametrize("mask_channels", [0, 1, 3])
def test_block_filter_and_torch_agree(size, clip_iterations, reach, mask_channels):
    patches, masks, expected = [], [], []
    for i, kernel in enumerate(KERNELS):
        scene = texture(size, size, seed=i)
        scene[:, 20:24, 20:24] = 8.0
        planes = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(i))
        mask = planes[:mask_channels] >= (1 if i else 99)
        planes = np.minimum(planes, 1)
        otf = to_otf(kernel, size)
        unknown = mask if mask_channels and mask.any() else None
        block = Block(samples=taper_edges(planes, otf, 6), otf=otf, unknown=unknown)
        expected.append(wiener_filter(settings(clip_iterations, reach), ISO_100)(block))
        patches.append(planes)
        masks.append(mask)
    restored = wiener_restore(
        torch.from_numpy(np.stack(patches)),
        torch.from_numpy(KERNELS),
        *tensors(ISO_100),
        settings(clip_iterations, reach),
        torch.from_numpy(np.stack(masks)) if mask_channels else None,
    )
    np.testing.assert_allclose(restored.numpy(), np.stack(expected), atol=TOLERANCE)


@pytest.mark.parametrize("size", [64, 66, 63])
@pytest.mark.parametrize(
    ("clip_iterations", "clip_power"), [(0, 1.0), (6, 1.0), (3, 2.0), (3, 1.5)]
)
@pytest.mark.parametrize("height_mm", [0.0, 7.0])
def test_colours_together_agree(size, clip_iterations, clip_power, height_mm):
    bank = settings(clip_iterations, 16 if clip_iterations else None, TOGETHER, clip_power)
    kernel = KERNELS[1]
    scene = texture(size, size, seed=4)
    scene[:, 20:24, 20:24] = 8.0
    planes = with_noise(blur_periodic(scene, kernel), ISO_100, np.random.default_rng(2))
    mask = planes[:1] >= 1
    planes = np.minimum(planes, 1)
    otf = to_otf(kernel, size)
    block = Block(samples=taper_edges(planes, otf, 6), otf=otf, unknown=mask, height_mm=height_mm)
    restored = wiener_restore(
        torch.from_numpy(planes)[None],
        torch.from_numpy(kernel)[None],
        *tensors(ISO_100),
        bank,
        torch.from_numpy(mask)[None],
        height_mm=height_mm,
    )
    expected = wiener_filter(bank, ISO_100)(block)
    np.testing.assert_allclose(restored[0].numpy(), expected, atol=5 * TOLERANCE)


@pytest.mark.parametrize("channels", [1, 2, 5])
def test_any_number_of_channels_with_one_sided_streaks_agrees(channels):
    """A kernel that is its mirror image would hide a flip on one side."""
    kernel = np.stack([streak_kernel(40.0 * c, 9, 9) for c in range(channels)])
    scene = np.resize(texture(64, 64, seed=3), (channels, 64, 64))
    noise = NoiseModel(shot=(2e-5,) * channels, read_variance=(4e-9,) * channels)
    planes = with_noise(blur_periodic(scene, kernel), noise, np.random.default_rng(1))
    otf = to_otf(kernel, 64)
    block = Block(samples=taper_edges(planes, otf, 6), otf=otf)
    restored = wiener_restore(
        torch.from_numpy(planes)[None],
        torch.from_numpy(kernel)[None],
        *tensors(noise),
        settings(0),
    )
    expected = wiener_filter(settings(0), noise)(block)
    np.testing.assert_allclose(restored[0].numpy(), expected, atol=TOLERANCE)


def test_one_noise_per_patch_agrees_with_one_by_one():
    planes = torch.from_numpy(np.stack([texture(64, 64, seed=i) for i in range(5)]))
    kernels = torch.from_numpy(KERNELS)
    gains = torch.tensor([1.0, 4, 16, 64, 128])[:, None]
    shot, read = (v * gains**p for v, p in zip(tensors(ISO_100), (1, 2), strict=True))
    batch = wiener_restore(planes, kernels, shot, read, settings(0))
    for i in range(5):
        single = wiener_restore(
            planes[i : i + 1], kernels[i : i + 1], shot[i], read[i], settings(0)
        )
        np.testing.assert_allclose(batch[i].numpy(), single[0].numpy(), atol=TOLERANCE)


@pytest.mark.parametrize("size", [64, 66, 63, 3])
def test_tapers_agree(size):
    kernel = KERNELS[-1][:, 9:12, 9:12]
    planes = texture(size, size)
    otf = to_otf_torch(torch.from_numpy(kernel)[None], (size, size))
    np.testing.assert_allclose(
        taper_torch(torch.from_numpy(planes)[None], otf, 12)[0].numpy(),
        taper_edges(planes, to_otf(kernel, size), 12),
        atol=1e-6,
    )
