import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.etching import Etching, mask_layers


def test_levels_fill_the_range_and_the_error_is_half_a_step() -> None:
    height_um = torch.linspace(-0.2, 0.1, 100, dtype=torch.float64).reshape(10, 10)
    etching = Etching(range_um=0.3, levels=8)
    made = etching.etched(height_um)
    assert sorted({round(h / etching.step_um) for h in made.flatten().tolist()}) == list(range(8))
    assert float((made - (height_um + 0.2)).abs().max()) <= etching.step_um / 2 + 1e-12
    assert float(made.max()) == pytest.approx(0.3)


def test_what_is_higher_than_the_range_is_cut() -> None:
    made = Etching(range_um=0.3, levels=4).etched(torch.tensor([[0.0, 5.0], [0.1, 0.3]]))
    assert made.flatten().tolist() == pytest.approx([0.0, 0.3, 0.1, 0.3])


def test_wrapped_levels_meet_at_the_ends() -> None:
    etching = Etching(range_um=1.2, levels=4, wraps=True)
    made = etching.etched(torch.tensor([[-0.01, 1.19], [0.31, 2.41]], dtype=torch.float64))
    assert made.flatten().tolist() == pytest.approx([0.0, 0.0, 0.3, 0.0])
    assert etching.step_um == pytest.approx(0.3)


def test_masks_add_up_to_the_levels() -> None:
    level = torch.arange(16).reshape(4, 4)
    layers = mask_layers(level, 16)
    assert layers.shape == (4, 4, 4)
    assert torch.equal(sum(layers[k].long() << k for k in range(4)), level)


def test_a_mask_that_etches_too_deep_does_so_in_all_its_cells() -> None:
    etching = Etching(range_um=0.7, levels=8)
    height_um = torch.linspace(0, 0.7, 64, dtype=torch.float64).reshape(8, 8)
    wrong = etching.etched(height_um, (0.0, 0.1, 0.0)) - etching.etched(height_um)
    second = mask_layers(etching.level(height_um), 8)[1]
    assert torch.allclose(wrong, 0.02 * second.double(), atol=1e-12)


def test_gradients_pass_the_rounding() -> None:
    height_um = torch.rand(5, 5, requires_grad=True)
    (2 * Etching(range_um=0.5, levels=4).etched(height_um)).sum().backward()
    assert height_um.grad is not None
    assert torch.equal(height_um.grad, torch.full((5, 5), 2.0))


def test_what_cannot_be_etched_is_refused() -> None:
    for wrong in ({"range_um": 0.0}, {"range_um": math.nan}, {"levels": 1}, {"levels": 12}):
        with pytest.raises(ContractError):
            Etching(**{"range_um": 1.0, **wrong})  # type: ignore[arg-type]
    with pytest.raises(ContractError, match="not a finite"):
        Etching(range_um=1.0).level(torch.tensor([[math.nan]]))
    with pytest.raises(ContractError, match="4 masks want 4 errors"):
        Etching(range_um=1.0).etched(torch.zeros(2, 2), (0.1,))
