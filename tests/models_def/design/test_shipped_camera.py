"""A camera that ships in a design loop."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design.assembly import parts_of
from camkit.models_def.design.design_recipe import DesignRecipe, to_design
from camkit.models_def.design.loop import DesignLoop
from camkit.models_def.design.loss import DesignLoss, design_loss
from camkit.models_def.design.shipped_camera import Camera, CameraChoice
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.sensors.together import frequencies_squared, spread_at
from camkit.models_def.sensors.tone import encode_srgb
from camkit.models_def.training.kind import read_recipe

RECIPES = Path(__file__).resolve().parents[3] / "models_def" / "recipes"


def behind_the_bank(table: dict[str, Any]) -> DesignRecipe:
    """Return the small design behind the bank of `duet-joint`."""
    table["front"] = {"kind": "together", "filter_margin_px": 16}
    table["camera"] = {"recipe": "duet_joint.toml", "copies": 2, "spread_steps": 4}
    table["network"] = {"name": "lean_s", "config": {"bias": True}}
    table["pixels"] = {"pitch_um": 5.96, "kernel_px": 33}
    table["fabrication"] = {}
    return to_design(table)


def camera(**changes: Any) -> Camera:
    """Return the camera of `duet-joint`; a bound of light is a limit without a gradient."""
    recipe = read_recipe(RECIPES / "duet_joint.toml")
    assert isinstance(recipe, BayerRecipe)
    choice = CameraChoice(recipe="duet_joint.toml")
    return Camera(replace(recipe, light=None, **changes), choice, 16)


def dots(shifts_px: list[int], side: int = 9) -> torch.Tensor:
    """Return kernels (1, field, 3, k, k) of a dot that lies off the middle."""
    kernels = torch.zeros(1, len(shifts_px), 3, side, side)
    for field, shift in enumerate(shifts_px):
        kernels[0, field, :, side // 2, side // 2 + shift] = 1
    return kernels


def test_a_copy_that_is_the_lens_leaves_no_doubt_and_a_shifted_one_that_of_its_phase() -> None:
    of = camera()
    spread = of.measured_spread(dots([0, 0]), [dots([0, 1])])
    assert not spread[0, 0].any()
    # |1 - exp(2 pi i f_x)|^2 = (2 sin(pi f_x))^2, its mean around the directions of a frequency
    angle = np.linspace(0, 2 * np.pi, 1000)
    for n in (5, 6, 7):
        f = of.together.spread.frequencies[n]
        wanted = float(np.mean((2 * np.sin(np.pi * f * np.cos(angle))) ** 2))
        # a mean between the neighbours of a frequency is not the value there
        assert float(spread[0, 1, 0, n]) == pytest.approx(wanted, rel=0.2)


def test_the_stated_doubt_is_that_of_the_recipe_at_each_height() -> None:
    of = camera()
    heights = (0.0, 4.0, 21.0, 99.0)
    table = of.stated_spread(torch.tensor(heights))[0]
    f2 = frequencies_squared((32, 32), torch.zeros(()))
    for height_mm, lines in zip(heights, table, strict=True):
        wanted = spread_at(of.together.spread, height_mm, f2)
        places = np.array(of.together.spread.frequencies)
        found = [np.interp(f2.sqrt().numpy(), places, line) for line in lines.numpy()]
        np.testing.assert_allclose(np.stack(found), wanted.numpy(), atol=1e-6)


def test_without_blur_noise_and_network_a_scene_comes_back() -> None:
    generator = torch.Generator().manual_seed(1)
    rough = torch.rand(1, 3, 12, 12, generator=generator)
    sharp = torch.nn.functional.interpolate(rough, size=(104, 104), mode="bicubic").clamp(0.05, 1)
    of = camera()
    noise = of.noise_at(torch.zeros(1))
    developed = of.capture(sharp, dots([0])[0], noise, torch.zeros(1, 3, 96, 96))
    restored = of.restored(developed, dots([0])[0], torch.zeros(1, 3, 12), noise)
    picture = of.pictures(developed, restored, noise, None)
    wanted = encode_srgb(sharp[..., 20:-20, 20:-20])
    assert picture.shape == wanted.shape == (1, 3, 64, 64)
    assert float((picture - wanted).square().mean().sqrt()) < 0.02


def test_noise_has_the_size_that_the_sensor_states_after_white_balance() -> None:
    of = camera()
    noise = of.noise_at(torch.ones(1))
    grey = torch.full((1, 3, 264, 264), 0.3)
    normal = torch.randn(1, 3, 256, 256, generator=torch.Generator().manual_seed(2))
    clean = of.capture(grey, dots([0])[0], noise, torch.zeros_like(normal))
    noisy = of.capture(grey, dots([0])[0], noise, normal)
    # where a colour is sampled nothing is interpolated: red at even places
    spread = (noisy - clean)[0, 0, ::2, ::2].std()
    model = of.recipe.sensor.noise_at(3200.0).with_gains(of.gains)
    wanted = (0.3 * model.shot[0] + model.read_variance[0]) ** 0.5
    assert float(spread) == pytest.approx(wanted, rel=0.03)


def test_gradients_to_the_lens_are_those_of_finite_differences(table: dict[str, Any]) -> None:
    recipe = behind_the_bank(table)
    lens = parts_of(recipe, folder=RECIPES).lens
    of = camera()
    torch.manual_seed(3)
    network = build_network("lean_s", bias=True).double()
    torch.nn.init.normal_(network.tail.weight, std=0.02)  # type: ignore[union-attr, arg-type]
    sharp = torch.rand(3, 3, 88, 88, dtype=torch.float64)
    noise = of.noise_at(torch.tensor([0.0, 0.5, 1.0]))
    # the size of noise has no gradient, so there is none here
    normal = torch.zeros(3, 3, 56, 56)
    spread = of.stated_spread(torch.tensor([0.0, 5.0, 10.0]))[0]

    def loss(moves: torch.Tensor) -> torch.Tensor:
        with torch.no_grad():
            lens.moves.copy_(moves)
        kernels, _ = lens()
        developed = of.capture(sharp, kernels[0], noise, normal)
        restored = of.restored(developed, kernels[0], spread, noise)
        picture = of.pictures(developed, restored, noise, network)[None]
        return design_loss(
            DesignLoss(kind="log_mse"), picture, encode_srgb(sharp[..., 32:56, 32:56])
        )

    begin = torch.zeros_like(lens.moves)
    (slope,) = torch.autograd.grad(loss(begin), lens.moves)
    for number in range(len(begin)):
        step = torch.zeros_like(begin)
        step[number] = 1e-4
        found = float((loss(begin + step) - loss(begin - step)).detach()) / 2e-4
        assert found == pytest.approx(float(slope[number]), rel=0.02, abs=1e-5)


def test_a_resumed_design_ends_in_the_same_bits_though_its_doubt_is_measured_now_and_then(
    table: dict[str, Any],
) -> None:
    recipe = behind_the_bank(table)
    recipe = replace(recipe, schedule=replace(recipe.schedule, steps=6, valid_steps=6))

    def loop() -> DesignLoop:
        return DesignLoop(parts_of(recipe, folder=RECIPES), recipe.schedule)

    whole, first, second = loop(), loop(), loop()
    list(whole.run())
    list(first.run(3))
    second.load(first.state())
    list(second.run())
    assert bool(whole.parts.lens.moves.detach().any())
    assert torch.equal(whole.parts.lens.moves, second.parts.lens.moves)


def test_first_weights_of_a_bundle_are_those_of_its_network(table: dict[str, Any]) -> None:
    behind_the_bank(table)
    table["network"]["start"] = "duet-joint"
    network = parts_of(to_design(table), folder=RECIPES).network
    assert network is not None
    # a network drawn by chance leaves its last planes as they are
    assert bool(network.tail.weight.detach().any())  # type: ignore[union-attr, operator]


@pytest.mark.parametrize(
    ("key", "entries", "message"),
    [
        ("camera", {"iso": [400.0, 100.0]}, "increasing"),
        ("camera", {"copies": -1}, "copies must be >= 0"),
        ("camera", {"recipe": "thin_plate_stop_lens.toml"}, "design recipe|unknown key|lacks"),
        ("camera", {"recipe": "streak_hdr.toml"}, "behind a mosaic|alone"),
        ("pixels", {"pitch_um": 6.0}, "pitch_um must be that of"),
        ("front", {"kind": "wiener"}, "belong together"),
    ],
)
def test_a_camera_that_does_not_fit_is_refused(
    key: str, entries: dict[str, Any], message: str, table: dict[str, Any]
) -> None:
    behind_the_bank(table)
    table[key] = {**table[key], **entries}
    with pytest.raises(ContractError, match=message):
        parts_of(to_design(table), folder=RECIPES)
