import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.training.losses import patch_errors, training_loss


def test_unjudged_pixels_do_not_count():
    target = torch.full((1, 3, 4, 4), 0.5)
    output = target + 0.1
    target[0, :, :2] = -1.0
    output[0, :, :2] = 77.0
    errors = patch_errors(output, target, torch.ones(1, 3))
    assert float(errors) == pytest.approx(0.01, rel=1e-5)


def test_a_patch_without_judged_pixels_gives_zero_and_no_nan_gradient():
    output = torch.rand(1, 3, 4, 4, requires_grad=True)
    target = torch.full((1, 3, 4, 4), -1.0)
    loss = training_loss("log_mse", patch_errors(output, target, torch.ones(1, 3)))
    loss.backward()
    assert torch.equal(output.grad, torch.zeros_like(output))


def test_weight_makes_the_same_signal_error_count_the_same_at_any_gain():
    sharp, wrong = torch.full((1, 3, 4, 4), 0.6), torch.full((1, 3, 4, 4), 0.5)
    errors = []
    for shot in (1 / 45000, 1 / 700):
        weight = torch.full((1, 3), 64 * shot**0.5)
        stable = [torch.sqrt(x / shot) / 64 for x in (wrong, sharp)]
        errors.append(float(patch_errors(*stable, weight)))
    assert errors[0] == pytest.approx(errors[1], rel=1e-4)


def test_log_loss_cares_for_relative_errors():
    small = training_loss("log_mse", torch.tensor([1e-2, 4e-2]))
    swapped = training_loss("log_mse", torch.tensor([2e-2, 2e-2]))
    assert float(small) == pytest.approx(float(swapped), abs=0.05)
    assert float(training_loss("mse", torch.tensor([1e-2, 4e-2]))) == pytest.approx(2.5e-2)


def test_unknown_loss_is_refused():
    with pytest.raises(ContractError, match="log_mse or mse"):
        training_loss("l1", torch.ones(1))
