import pytest
import torch

from camkit.models_def.optics.search.beam_launch import LEAD
from camkit.models_def.optics.search.spot_residuals import MERITS, Merit, spot_residuals
from camkit.models_def.optics.trace import Rays


def rays_at(x_mm: torch.Tensor, y_mm: torch.Tensor, lost: int = 0) -> Rays:
    """Give (1, 1, 1, LEAD + ray) rays on the sensor; those that lead lie on the axis."""
    lead = torch.zeros(LEAD, dtype=torch.float64)
    x, y = torch.cat([lead, x_mm]), torch.cat([lead, y_mm])
    fate = torch.zeros(len(x), dtype=torch.int8)
    fate[len(x) - lost :] = 1
    blank = torch.zeros_like(x)
    shaped = {"x": x, "y": y, "z": blank, "l": blank, "m": blank, "n": blank + 1, "fate": fate}
    return Rays(**{name: value[None, None, None] for name, value in shaped.items()})


@pytest.fixture
def spot() -> Rays:
    generator = torch.Generator().manual_seed(1)
    x = torch.rand(200, generator=generator, dtype=torch.float64) * 0.05
    y = torch.randn(200, generator=generator, dtype=torch.float64) * 0.03
    return rays_at(x, y)


def test_rms_is_the_mean_square_distance_from_the_centroid(spot: Rays) -> None:
    x, y = spot.x[0, 0, 0, LEAD:], spot.y[0, 0, 0, LEAD:]
    wanted = (x**2 + (y - y.mean()) ** 2).mean()
    found = spot_residuals(spot, 0.006, "rms").square().sum()
    assert float(found) == pytest.approx(float(wanted), rel=1e-12)


def test_sum_abs_tends_to_the_mean_distance(spot: Rays) -> None:
    x, y = spot.x[0, 0, 0, LEAD:], spot.y[0, 0, 0, LEAD:]
    wanted = torch.hypot(x, y - y.mean()).mean()
    found = spot_residuals(spot, 1e-9, "sum_abs").square().sum()
    assert float(found) == pytest.approx(float(wanted), rel=1e-6)


def test_energy_counts_light_outside_the_core(spot: Rays) -> None:
    tiny = spot_residuals(spot, 1e-6, "energy").square().sum() / 1e-12
    assert float(tiny) == pytest.approx(1.0, rel=1e-2)
    wide = spot_residuals(spot, 10.0, "energy").square().sum()
    assert float(wide) == pytest.approx(
        float(spot_residuals(spot, 10.0, "rms").square().sum()), rel=1e-4
    )


@pytest.mark.parametrize("merit", MERITS)
def test_a_perfect_spot_costs_nothing_and_has_a_finite_slope(merit: Merit) -> None:
    at = torch.zeros(5, dtype=torch.float64, requires_grad=True)
    cost = spot_residuals(rays_at(at, at), 0.006, merit).square().sum()
    cost.backward()  # type: ignore[no-untyped-call]
    assert float(cost.detach()) == 0
    assert at.grad is not None
    assert bool(torch.isfinite(at.grad).all())


@pytest.mark.parametrize("merit", MERITS)
def test_lost_rays_cost_more_than_any_spot(merit: Merit, spot: Rays) -> None:
    x, y = spot.x[0, 0, 0, LEAD:], spot.y[0, 0, 0, LEAD:]
    whole = spot_residuals(spot, 0.006, merit).square().sum()
    spoiled = spot_residuals(rays_at(x, y, lost=20), 0.006, merit).square().sum()
    assert float(spoiled) > float(whole) + 0.05
