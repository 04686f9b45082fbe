"""The bank in front of a design's network against the bank that ships."""

from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.models_def.design.shipped_camera import Camera, CameraChoice, Noise
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.kind import read_recipe
from camkit.runtime.bank.blocks import Block, taper_edges, to_otf
from camkit.runtime.bank.wiener import wiener_filter
from tests.psf_factory import blur_periodic, coma_kernels, texture, with_noise

RECIPE = Path(__file__).resolve().parents[2] / "models_def" / "recipes" / "duet_joint.toml"
TOLERANCE = 1e-4


@pytest.mark.parametrize("height_mm", [0.0, 4.1, 12.5, 21.4])
@pytest.mark.parametrize("iso", [100.0, 1600.0])
def test_the_bank_of_a_design_is_that_of_the_runtime(height_mm: float, iso: float) -> None:
    recipe = read_recipe(RECIPE)
    assert isinstance(recipe, BayerRecipe)
    camera = Camera(recipe, CameraChoice(recipe=RECIPE.name), 8)
    noise = recipe.sensor.noise_at(iso).with_gains(camera.gains)
    side = recipe.wiener.block_px
    kernel = coma_kernels(radius_px=20)[0][1]
    blurred = blur_periodic(texture(side, side, seed=3), kernel)
    planes = with_noise(blurred, noise, np.random.default_rng(5)).astype(np.float32)
    otf = to_otf(kernel, side)
    ring_px = recipe.wiener.overlap_px // 4
    block = Block(samples=taper_edges(planes, otf, ring_px), otf=otf, height_mm=height_mm)
    restored = camera.restored(
        torch.from_numpy(planes)[None],
        torch.from_numpy(kernel)[None],
        camera.stated_spread(torch.tensor([height_mm]))[0],
        Noise(shot=torch.tensor([noise.shot]), read=torch.tensor([noise.read_variance])),
    )
    expected = wiener_filter(recipe.wiener, noise)(block)
    np.testing.assert_allclose(restored[0].numpy(), expected, atol=TOLERANCE)
