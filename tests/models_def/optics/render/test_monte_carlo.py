import math
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import ChannelResponse
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.lens_view import Optics, lens_optics
from camkit.models_def.optics.render.monte_carlo import Illumination, Sampling, render
from camkit.models_def.optics.render.texture import Texture
from camkit.models_def.optics.render.window import Window
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors
from tests.models_def.optics.render.centred import centred_window

SMALL = Sampling(spp=9, passes=2)
RELATIVE_FLOAT32 = 1e-5
# Against central differences in float64. The step is so short that no ray crosses an edge
# between samples of the texture, where its slope jumps.
RELATIVE_DIFFERENCES = 1e-5


def _with_curvatures(lens: Lens, curvature_per_mm: Tensor) -> Optics:
    def tensors(wavelengths_um: Tensor) -> SurfaceTensors:
        return replace(surface_tensors(lens, wavelengths_um), curvature_per_mm=curvature_per_mm)

    return replace(lens_optics(lens), tensors=tensors)


def _curvatures(lens: Lens) -> Tensor:
    return torch.tensor([s.curvature_per_mm for s in lens.surfaces], dtype=torch.float64)


def _square_loss(
    lens: Lens, texture: Texture, response: ChannelResponse, window: Window, sampling: Sampling
) -> Callable[[Tensor], Tensor]:
    def loss(curvature_per_mm: Tensor) -> Tensor:
        picture = render(
            texture, _with_curvatures(lens, curvature_per_mm), response, window, sampling
        )
        return ((picture - 0.4) ** 2).mean()

    return loss


@pytest.mark.parametrize("illumination", ["kept", "divided"])
def test_gradient_of_a_loss_is_that_of_finite_differences(
    near_duet: Lens,
    texture: Texture,
    response: ChannelResponse,
    window: Window,
    illumination: Illumination,
) -> None:
    """With the same random numbers, a curvature of each element."""
    texture = replace(texture, values=texture.values.double())
    sampling = replace(SMALL, dtype=torch.float64, illumination=illumination)
    loss = _square_loss(near_duet, texture, response, window, sampling)
    place = _curvatures(near_duet)
    leaf = place.clone().requires_grad_()
    loss(leaf).backward()
    assert leaf.grad is not None
    step = 1e-11
    for surface in (1, 4):
        move = torch.zeros_like(place)
        move[surface] = step
        difference = float(loss(place + move) - loss(place - move)) / (2 * step)
        assert float(leaf.grad[surface]) == pytest.approx(difference, rel=RELATIVE_DIFFERENCES)


def test_gradient_also_foretells_a_step_in_which_rays_cross_the_stop(
    near_duet: Lens, texture: Texture, response: ChannelResponse, window: Window
) -> None:
    """What it does not see at the edge of the stop is a few percent at most."""
    loss = _square_loss(near_duet, texture, response, window, Sampling(spp=64, passes=6))
    place, move = _curvatures(near_duet), torch.zeros(5, dtype=torch.float64)
    move[4] = 2e-5
    leaf = place.clone().requires_grad_()
    loss(leaf).backward()
    assert leaf.grad is not None
    difference = float(loss(place + move) - loss(place - move)) / (2 * 2e-5)
    assert float(leaf.grad[4]) == pytest.approx(difference, rel=0.05)


def test_gradient_of_the_texture_is_the_adjoint(
    near_duet: Lens, texture: Texture, response: ChannelResponse, window: Window
) -> None:
    """The picture is linear in the texture: <g, A t> = <A^T g, t>."""
    values = texture.values.double().requires_grad_()
    picture = render(
        replace(texture, values=values), lens_optics(near_duet), response, window, SMALL
    )
    seed = torch.rand(picture.shape, generator=torch.Generator().manual_seed(3)).double()
    (picture * seed).sum().backward()
    assert values.grad is not None
    forward, adjoint = (
        float((picture * seed).detach().sum()),
        float((values.grad * values.detach()).sum()),
    )
    assert adjoint == pytest.approx(forward, rel=RELATIVE_FLOAT32)


def test_chunks_do_not_change_the_picture_nor_the_gradient(
    near_duet: Lens, texture: Texture, response: ChannelResponse, window: Window
) -> None:
    pictures, gradients = [], []
    for chunk_rays in (6000, 10**6):
        leaf = _curvatures(near_duet).requires_grad_()
        sampling = Sampling(spp=4, passes=2, chunk_rays=chunk_rays)
        picture = render(texture, _with_curvatures(near_duet, leaf), response, window, sampling)
        picture.square().sum().backward()
        assert leaf.grad is not None
        pictures.append(picture.detach())
        gradients.append(leaf.grad)
    for picture, gradient in zip(pictures[1:], gradients[1:], strict=True):
        assert float((picture - pictures[0]).abs().max()) < 1e-6
        assert torch.allclose(gradient, gradients[0], rtol=1e-3)


def test_fresh_gradients_are_independent_of_the_picture_and_agree_in_the_mean(
    near_duet: Lens, texture: Texture, response: ChannelResponse, window: Window
) -> None:
    def gradient(sampling: Sampling) -> float:
        leaf = _curvatures(near_duet).requires_grad_()
        loss = _square_loss(near_duet, texture, response, window, sampling)(leaf)
        loss.backward()
        assert leaf.grad is not None
        return float(leaf.grad[1])

    many = Sampling(spp=36, passes=2)
    same, fresh = gradient(many), gradient(replace(many, fresh_gradient=True))
    assert same != fresh
    assert fresh == pytest.approx(same, rel=0.2)


def test_stratified_rays_beat_plain_random_ones(
    near_duet: Lens, texture: Texture, response: ChannelResponse, window: Window
) -> None:
    """At equal rays; measured 0.7 of the noise, asked 0.85."""

    def noise(*, stratified: bool) -> float:
        pictures = [
            render(
                texture,
                lens_optics(near_duet),
                response,
                window,
                Sampling(spp=64, passes=1, seed=seed, stratified=stratified),
            )
            for seed in range(3)
        ]
        return math.sqrt(float(torch.stack(pictures).var(0).mean()))

    assert noise(stratified=True) < 0.85 * noise(stratified=False)


def test_an_even_scene_stays_even_when_the_light_is_divided_out(
    near_duet: Lens, response: ChannelResponse, window: Window
) -> None:
    even = Texture(values=torch.full((3, 2, 2), 0.7), pitch_mm=1.0, axis_px=(0.0, 0.0))
    picture = render(even, lens_optics(near_duet), response, window, SMALL)
    assert float((picture - 0.7).abs().max()) < RELATIVE_FLOAT32


def test_pixels_behind_a_rim_are_dark(near_duet: Lens, response: ChannelResponse) -> None:
    """The edges of the elements limit the field, in both normalisations."""
    rims = tuple(
        replace(s, semi_diameter_mm=min(s.semi_diameter_mm, 6.3)) for s in near_duet.surfaces
    )
    narrow = replace(near_duet, surfaces=rims)
    far = replace(centred_window(2, 2, 6.0), top_mm=70.0)
    even = Texture(values=torch.ones(3, 2, 2), pitch_mm=1.0, axis_px=(0.0, 0.0))
    for sampling in (SMALL, replace(SMALL, illumination="kept")):
        assert float(render(even, lens_optics(narrow), response, far, sampling).abs().max()) == 0


def test_impossible_samplings_are_refused() -> None:
    with pytest.raises(ContractError, match="spp"):
        Sampling(spp=0)
    with pytest.raises(ContractError, match="illumination"):
        Sampling(illumination="both")  # type: ignore[arg-type]
