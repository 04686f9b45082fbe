"""A plate fitted with its network: it moves, repeatably, and is validated on true counts."""

from collections.abc import Callable
from copy import deepcopy
from typing import Any

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.spad.fitter import FITTING, plate_fitter
from camkit.models_def.kinds.spad.recipe import SpadRecipe, to_spad_recipe
from camkit.models_def.training.fitting import FitRequest
from camkit.models_def.training.sample import Batch


def _request(recipe: SpadRecipe, role: str = "plate", **others: Any) -> FitRequest:
    return FitRequest(recipe=recipe, role=role, entry=recipe.network("S", role), **others)


def _batch(photons: float = 1e3, seed: int = 0) -> Batch:
    sharp = torch.rand(2, 1, 32, 32, generator=torch.Generator().manual_seed(seed))
    deviation = torch.full_like(sharp, photons**-0.5)
    return Batch(
        inputs={"sharp": sharp, "deviation": deviation}, target=sharp, weight=torch.ones(2, 1)
    )


def test_a_step_moves_plate_and_network_and_is_the_same_again(tiny: SpadRecipe) -> None:
    states = []
    for _ in range(2):
        fitter = plate_fitter(_request(tiny))
        before = fitter.weights()
        losses = [fitter.fit(_batch(), step, 0.0) for step in range(3)]
        after = fitter.weights()
        assert not torch.equal(before["plate.logits"], after["plate.logits"])
        assert not torch.equal(before["network.skip.weight"], after["network.skip.weight"])
        states.append((after, losses))
    assert states[0][1] == states[1][1]
    assert all(torch.equal(states[0][0][name], states[1][0][name]) for name in states[0][0])


def test_the_noise_of_a_step_follows_from_its_number(tiny: SpadRecipe) -> None:
    losses = {plate_fitter(_request(tiny)).fit(_batch(30.0), step, 0.0) for step in (0, 1, 0)}
    assert len(losses) == 2


def test_a_resumed_fitter_goes_on_as_one_that_never_stopped(tiny: SpadRecipe) -> None:
    whole = plate_fitter(_request(tiny))
    whole.fit(_batch(), 0, 0.0)
    # the optimiser's state is alive until a checkpoint is written
    saved = (whole.weights(), whole.average(), deepcopy(whole.optimizer_state()))
    resumed = plate_fitter(_request(tiny))
    resumed.load(*saved)
    assert whole.fit(_batch(), 1, 0.5) == resumed.fit(_batch(), 1, 0.5)
    assert torch.equal(whole.average()["plate.logits"], resumed.average()["plate.logits"])


def test_the_loss_is_the_mean_squared_error(
    tiny: SpadRecipe, changed: Callable[..., dict[str, Any]]
) -> None:
    """Of a picture that is even, with so many photons that there is no noise: the borders alone."""
    exact = to_spad_recipe(changed(schedule__precision="float32"))
    fitter = plate_fitter(_request(exact))
    network = fitter.network
    batch = _batch(1e12)
    with torch.no_grad():
        expected = float((network(batch.planes) - batch.target).square().mean())
    assert fitter.fit(batch, 0, 0.0) == pytest.approx(expected, rel=1e-3)
    assert tiny.network("S", "plate").schedule.precision == "bfloat16"


def test_validation_counts_photons_and_always_the_same_ones(tiny: SpadRecipe) -> None:
    fitter = plate_fitter(_request(tiny))
    planes = _batch(100.0).planes[:1]
    dim, again = (fitter.restore(planes) for _ in range(2))
    assert torch.equal(dim, again)
    clean = fitter.averaged(planes).detach()
    gap = (dim - clean)[..., 8:-8, 8:-8]
    assert 0.01 < float(gap.std()) < 0.2


def test_the_log_tells_how_wide_the_plate_is(tiny: SpadRecipe) -> None:
    """A Gaussian cut at 5 of 1.84 is a little narrower than it."""
    notes = plate_fitter(_request(tiny)).notes()
    assert notes["plate_sigma"] == pytest.approx(1.81, abs=0.02)
    assert 0.04 < notes["plate_peak"] < 0.06


def test_other_roles_have_the_fitter_of_the_house(tiny: SpadRecipe) -> None:
    assert FITTING.fitting(_request(tiny, "upscale")) is None
    own = FITTING.fitting(_request(tiny))
    assert own is not None
    assert "plate_sigma" in own.make(None).notes()


def test_a_network_of_another_role_or_another_device_is_refused(
    tiny: SpadRecipe, changed: Callable[..., dict[str, Any]]
) -> None:
    wrong = to_spad_recipe(changed(networks__plate__S__network="sub_pixel_s"))
    with pytest.raises(ContractError, match="begin with joint_ belong to the role plate"):
        FITTING.fitting(_request(wrong))
    with pytest.raises(ContractError, match="trained on the cpu; got cuda"):
        FITTING.fitting(_request(tiny, device="cuda"))
