"""Samples: what the array saw of a picture, and the picture."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.recipe import SpadRecipe
from camkit.models_def.kinds.spad.samples import (
    SpadMaker,
    draw_luminance,
    layout_of,
    photograph,
)
from camkit.models_def.kinds.spad.sampling import make_sampling
from camkit.models_def.training.pictures import SceneSource, open_source


@pytest.fixture(scope="module")
def source() -> SceneSource:
    return open_source(None, picture_share=0.0, scenes=2, scene_px=256)


def test_a_sample_is_what_the_array_sees_of_its_target(
    tiny: SpadRecipe, source: SceneSource
) -> None:
    """Away from the rim, where light of the surroundings comes in."""
    sampling = make_sampling("gaussian", phase=1)
    bright = replace(tiny, data=replace(tiny.data, photons_min=4e4, photons_max=4e4))
    sample = SpadMaker(bright, "upscale", sampling, source, 3).make(5)
    assert sample.inputs["light"].shape == (1, 16, 16)
    assert sample.target.shape == (1, 64, 64)
    seen = sampling.see(sample.target[None])[0]
    inner = np.s_[:, 2:-2, 2:-2]
    gap = (sample.inputs["light"] - seen)[inner] / torch.sqrt(seen[inner].clamp(min=1e-3) / 4e4)
    assert float(gap.std()) == pytest.approx(1, abs=0.25)
    assert float(gap.mean()) == pytest.approx(0, abs=0.35)


def test_the_rim_of_a_sample_knows_its_surroundings(tiny: SpadRecipe, source: SceneSource) -> None:
    """The first row sees light that a target continued at its border does not have."""
    sampling = make_sampling("gaussian", sigma=3.0)
    bright = replace(tiny, data=replace(tiny.data, photons_min=1e8, photons_max=1e8))
    gaps = []
    for index in range(6):
        sample = SpadMaker(bright, "upscale", sampling, source, 3).make(index)
        gaps.append((sample.inputs["light"] - sampling.see(sample.target[None])[0]).abs())
    worst = torch.stack(gaps).amax(0)[0]
    assert float(worst[0].max()) > 20 * float(worst[4:-4, 4:-4].max())


def test_sample_i_is_a_function_of_seed_and_i(tiny: SpadRecipe, source: SceneSource) -> None:
    sampling = make_sampling("gaussian")
    makers = [SpadMaker(tiny, "upscale", sampling, source, seed) for seed in (1, 1, 2)]
    one, same, other = (maker.make(3) for maker in makers)
    assert torch.equal(one.inputs["light"], same.inputs["light"])
    assert not torch.equal(one.target, other.target)
    assert not torch.equal(one.target, makers[0].make(4).target)


def test_photons_are_drawn_log_uniformly(tiny: SpadRecipe, source: SceneSource) -> None:
    maker = SpadMaker(tiny, "plate", make_sampling("gaussian"), source, 4)
    photons = [float(maker.make(i).inputs["deviation"][0, 0, 0]) ** -2 for i in range(60)]
    assert min(photons) >= 100
    assert max(photons) <= 1e4 * (1 + 1e-5)
    assert np.median(photons) == pytest.approx(1e3, rel=0.6)


def test_the_sample_of_a_plate_is_the_picture(tiny: SpadRecipe, source: SceneSource) -> None:
    sample = SpadMaker(tiny, "plate", make_sampling("gaussian"), source, 4).make(0)
    assert torch.equal(sample.inputs["sharp"], sample.target)
    sample.stacked(layout_of(tiny, "plate"))


def test_samples_are_of_the_layout_of_their_role(tiny: SpadRecipe, source: SceneSource) -> None:
    for told in (True, False):
        recipe = replace(tiny, data=replace(tiny.data, told=told))
        layout = layout_of(recipe, "upscale")
        assert [port.name for port in layout.inputs] == ["light", "noise"][: 1 + told]
        assert layout.scale == 4
        # turned, the sample would lie at another sub-pixel
        assert not layout.turned
        maker = SpadMaker(recipe, "upscale", make_sampling("low_fill"), source, 1)
        assert maker.make(0).stacked(layout).shape == (1 + told, 16, 16)


def test_crops_are_turned_and_mirrored(source: SceneSource) -> None:
    found = draw_luminance(source, np.random.default_rng(0), 32)
    assert found.shape == (1, 1, 32, 32)
    assert 0 <= float(found.min()) <= float(found.max()) <= 1


def test_full_fill_counts_sixteen_times_as_many() -> None:
    fine = torch.full((1, 1, 400, 400), 0.5)
    exposure, rng = Exposure(photons=20.0), np.random.default_rng(5)
    small, full = (
        photograph(fine, make_sampling(mode), exposure, rng)[:, 0]
        for mode in ("low_fill", "full_fill")
    )
    assert float(small.mean()) == pytest.approx(float(full.mean()), rel=0.01)
    assert float(small.var() / full.var()) == pytest.approx(16, rel=0.08)
