from dataclasses import replace

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import ChannelResponse
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.psf_map import (
    MapGrid,
    PsfMap,
    map_at,
    render_by_map,
    trace_map,
)
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.texture_alignment import align_reference, fit_alignment
from camkit.models_def.optics.render.window import Window


def _delta_map(depths_mm: tuple[float, ...] = (1000.0,)) -> PsfMap:
    kernels = torch.zeros(len(depths_mm), 2, 3, 5, 5)
    kernels[..., 2, 2] = 1
    return PsfMap(
        kernels=kernels,
        depths_mm=np.array(depths_mm),
        field_heights_mm=np.array([0.0, 12.0]),
        illumination=np.tile([1.0, 0.5], (len(depths_mm), 1)),
        pitch_um=6.0,
    )


def test_delta_kernels_give_the_aligned_texture(
    near_duet: Lens, texture: Texture, window: Window
) -> None:
    """One field, for a kernel that is turned is resampled."""
    alignment = fit_alignment(near_duet, window)
    many = _delta_map()
    one = replace(
        many,
        kernels=many.kernels[:, :1],
        field_heights_mm=np.array([0.0]),
        illumination=np.ones((1, 1)),
    )
    made = render_by_map(texture, alignment, one, window, step_px=12)
    aligned = align_reference(texture, alignment, window)
    assert float((made - aligned).abs().max()) < 1e-5


def test_kept_illumination_multiplies_by_the_light_of_the_height(
    near_duet: Lens, texture: Texture, window: Window
) -> None:
    alignment = fit_alignment(near_duet, window)
    kept = render_by_map(texture, alignment, _delta_map(), window, illumination="kept")
    divided = render_by_map(texture, alignment, _delta_map(), window)
    ys, xs = window.centres_mm()
    light = 1 - torch.hypot(xs, ys[:, None]) / 24
    assert float((kept - divided * light).abs().max()) < 1e-6


def test_a_map_between_depths_is_linear_in_diopters() -> None:
    three = _delta_map((500.0, 1000.0, 2000.0))
    marked = replace(
        three, kernels=three.kernels * torch.tensor([1.0, 2.0, 3.0])[:, None, None, None, None]
    )
    for depth_mm, expected in ((400.0, 1.0), (500.0, 1.0), (1000.0, 2.0), (4000.0, 3.0)):
        assert float(map_at(marked, depth_mm).kernels[0, 0, 0, 2, 2]) == pytest.approx(expected)
    # 1.5 diopters lie in the middle between 2 and 1
    assert float(map_at(marked, 1000 / 1.5).kernels[0, 0, 0, 2, 2]) == pytest.approx(1.5)


def test_the_light_of_a_map_falls_from_1_towards_the_corner(
    near_duet: Lens, response: ChannelResponse
) -> None:
    grid = MapGrid(
        depths_mm=np.array([800.0, 1000.0]),
        field_heights_mm=np.array([0.0, 10.0, 20.0]),
        wavelengths_um=np.array([0.45, 0.55, 0.65]),
        kernel_px=33,
        pitch_um=6.0,
        rays=512,
    )
    made = trace_map(near_duet, response, grid)
    assert made.kernels.shape == (2, 3, 3, 33, 33)
    assert made.illumination[:, 0] == pytest.approx(1.0)
    assert (np.diff(made.illumination, axis=1) < 0).all()


def test_gradients_reach_the_kernels(near_duet: Lens, texture: Texture, window: Window) -> None:
    flat = _delta_map()
    kernels = (flat.kernels + 0.01).requires_grad_()
    made = render_by_map(
        texture, fit_alignment(near_duet, window), replace(flat, kernels=kernels), window
    )
    made.square().sum().backward()
    assert kernels.grad is not None
    assert bool((kernels.grad != 0).any())
    assert bool(torch.isfinite(kernels.grad).all())


def test_maps_that_do_not_fit_are_refused(
    near_duet: Lens, texture: Texture, window: Window
) -> None:
    alignment = fit_alignment(near_duet, window)
    with pytest.raises(ContractError, match="one depth"):
        render_by_map(texture, alignment, _delta_map((500.0, 1000.0)), window)
    with pytest.raises(ContractError, match="does not divide"):
        render_by_map(texture, alignment, replace(_delta_map(), pitch_um=4.0), window)
    with pytest.raises(ContractError, match="increase"):
        _delta_map((1000.0, 500.0))
    with pytest.raises(ContractError, match="kernels"):
        replace(_delta_map(), field_heights_mm=np.array([0.0]))
