import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.training.losses import overshoots, patch_errors, training_loss


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
    for plain in ("mse", "l1"):
        assert float(training_loss(plain, torch.tensor([1e-2, 4e-2]))) == pytest.approx(2.5e-2)


def test_unknown_loss_is_refused():
    with pytest.raises(ContractError, match="log_mse, mse or l1"):
        training_loss("l3", torch.ones(1))


def test_what_stays_within_the_range_around_is_no_overshoot():
    target = torch.zeros(1, 1, 9, 9)
    target[..., 5:] = 1.0
    blurred = torch.nn.functional.avg_pool2d(target, 3, 1, 1, count_include_pad=False)
    assert float(overshoots(blurred, target, torch.ones(1, 1))) == 0
    ringing = target.clone()
    ringing[..., 5] += 0.2
    ringing[..., 4] -= 0.1
    found = float(overshoots(ringing, target, torch.full((1, 1), 2.0)))
    assert found == pytest.approx(4 * (0.04 + 0.01) / 9)


def test_pixels_that_nobody_knows_widen_no_range_and_are_not_judged():
    target = torch.full((1, 1, 9, 9), 0.5)
    target[..., 4, 4] = -1.0
    output = torch.full_like(target, 0.5)
    output[..., 4, 4] = 9.0
    assert float(overshoots(output, target, torch.ones(1, 1))) == 0
    output[..., 4, 5] = 0.7
    assert float(overshoots(output, target, torch.ones(1, 1))) == pytest.approx(0.04 / 80)
    nothing = torch.full_like(target, -1.0)
    assert float(overshoots(output, nothing, torch.ones(1, 1))) == 0
