import torch
from torch import Tensor

from camkit.models_def.optics.search.least_squares import descend, jacobian

FREE = torch.zeros(2, dtype=torch.bool)


def valley(scaled: Tensor) -> Tensor:
    """Give Rosenbrock's residuals with the minimum at (0.75, 0.5625) of the unit square."""
    x, y = scaled[:, 0] * 4 - 2, scaled[:, 1] * 4 - 1.25
    return torch.stack([10 * (y - x**2), 1 - x], dim=1)


def test_the_bottom_of_a_curved_valley_is_found_from_every_start() -> None:
    starts = torch.tensor([[0.1, 0.9], [0.5, 0.1], [0.9, 0.9]], dtype=torch.float64)
    found = descend(valley, starts, 60, FREE)
    assert float(found.merits.max()) < 1e-12
    wanted = torch.tensor([[0.75, 0.5625]], dtype=torch.float64).expand(3, 2)
    torch.testing.assert_close(found.scaled, wanted, rtol=0, atol=1e-5)


def test_differences_are_derivatives_also_at_the_upper_bound() -> None:
    at = torch.tensor([[0.3, 0.6], [1.0, 1.0]], dtype=torch.float64, requires_grad=True)
    _, found = jacobian(valley, at.detach())
    for start in range(2):
        for row in range(2):
            (exact,) = torch.autograd.grad(valley(at)[start, row], at, retain_graph=True)
            torch.testing.assert_close(found[start, row], exact[start], rtol=1e-3, atol=1e-3)


def test_no_start_ends_worse_and_the_best_comes_first() -> None:
    generator = torch.Generator().manual_seed(2)
    starts = torch.rand(12, 2, generator=generator, dtype=torch.float64)
    before = (valley(starts) ** 2).sum(1)
    found = descend(valley, starts, 2, FREE)
    assert bool((found.merits[1:] >= found.merits[:-1]).all())
    assert float(found.merits.max()) <= float(before.max())
    assert found.evaluations == 12 * (2 * 4 + 1)


def test_held_numbers_and_bounds_are_kept() -> None:
    start = torch.tensor([[0.2, 0.3]], dtype=torch.float64)
    held = torch.tensor([True, False])
    found = descend(valley, start, 30, held).scaled
    assert float(found[0, 0]) == 0.2
    outside = descend(lambda s: s - 2.0, start, 10, FREE).scaled
    torch.testing.assert_close(outside, torch.ones_like(outside))
