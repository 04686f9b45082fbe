import numpy as np
import pytest
import torch
from skimage.metrics import structural_similarity

from camkit.errors import ContractError
from camkit.models_def.design.loss import DesignLoss, design_loss
from camkit.models_def.training.losses import ssim

GENERATOR = torch.Generator().manual_seed(4)
SHARP = torch.rand(2, 3, 40, 40, generator=GENERATOR, dtype=torch.float64)
SOFT = (SHARP + 0.1 * torch.randn(2, 3, 40, 40, generator=GENERATOR, dtype=torch.float64)) * 0.9


def test_ssim_is_that_of_scikit_image() -> None:
    for one, other, found in zip(SHARP.numpy(), SOFT.numpy(), ssim(SHARP, SOFT), strict=True):
        _, full = structural_similarity(
            one,
            other,
            channel_axis=0,
            data_range=1.0,
            gaussian_weights=True,
            sigma=1.5,
            use_sample_covariance=False,
            full=True,
        )
        # ours has no border: the window lies wholly inside
        assert float(found) == pytest.approx(np.mean(full[:, 5:-5, 5:-5]), abs=1e-6)


def test_l1_is_the_weighted_mean_over_depths() -> None:
    pictures = torch.stack([SHARP + 0.1, SHARP + 0.3])
    plain = design_loss(DesignLoss(), pictures, SHARP)
    assert float(plain) == pytest.approx(0.2)
    weighted = design_loss(DesignLoss(depth_weights=(3.0, 1.0)), pictures, SHARP)
    assert float(weighted) == pytest.approx(0.15)


def test_log_mse_weighs_patches_by_their_relative_error() -> None:
    loss = DesignLoss(kind="log_mse")
    once = design_loss(loss, (SHARP + 0.1)[None], SHARP)
    twice = design_loss(loss, (SHARP + 0.2)[None], SHARP)
    assert float(twice - once) == pytest.approx(np.log((0.04 + 1e-4) / (0.01 + 1e-4)))


def test_edof_compares_captures_with_those_of_the_reference_depth() -> None:
    """Eq. (6.16) by hand: two depths, the second is the reference."""
    loss = DesignLoss(kind="edof", depth_weights=(3.0, 0.5), reference_depth=1)
    pictures = torch.stack([SOFT, SHARP])
    apart = 3.0 * float((SOFT - SHARP).abs().mean())
    unlike = 3.0 * (1 - float(ssim(SOFT, SHARP).mean()))
    assert float(design_loss(loss, pictures, SHARP)) == pytest.approx(apart + unlike)


def test_weights_must_fit_the_depths() -> None:
    with pytest.raises(ContractError, match="2 depths need as many weights"):
        design_loss(DesignLoss(depth_weights=(1.0,)), torch.stack([SHARP, SHARP]), SHARP)
