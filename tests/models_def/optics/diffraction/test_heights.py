import math

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.heights import (
    FullMap,
    GratingMap,
    RadialMap,
    RankMap,
    ZernikeMap,
    noll_order,
    zernike_basis,
)


def test_a_full_map_is_its_cells() -> None:
    height_um = torch.rand(4, 4)
    assert torch.equal(FullMap(height_um)(), height_um)


def test_a_rank_map_has_its_rank_before_the_sigmoid() -> None:
    made = RankMap(32, rank=3, start=0.3, offset=0.0, seed=2)().detach().double()
    assert 0 < float(made.min()) < float(made.max()) < 1.125
    inside = torch.logit(made / 1.125)
    shares = torch.linalg.svdvals(inside)
    assert float(shares[3] / shares[0]) < 1e-5 < float(shares[2] / shares[0])


def test_rank_one_with_an_offset_is_the_sum_of_two_lines() -> None:
    """v = q = 1 + 0.14 chirp: within 0.2 % of the two gratings that it stands for."""
    chirp = torch.sin(0.02 * torch.arange(128, dtype=torch.float64) ** 2)
    model = RankMap(128).double()
    with torch.no_grad():
        model.v[:, 0] = model.q[:, 0] = 1 + 0.14 * chirp
    made = model().detach()
    rows, columns = made.mean(1, keepdim=True), made.mean(0, keepdim=True)
    lines = rows + columns - made.mean()
    assert float((made - lines).pow(2).mean() / made.var()) < 2e-3


def test_around_zero_a_rank_map_is_stuck() -> None:
    moved = []
    for start in (1e-3, 0.3):
        model = RankMap(16, rank=3, offset=0.0, start=start)
        target = torch.rand(16, 16, generator=torch.Generator().manual_seed(1))
        ((model() - target) ** 2).sum().backward()
        moved.append(
            max(float(p.grad.abs().max()) for p in model.parameters() if p.grad is not None)
        )
    assert moved[0] < 0.02 * moved[1]


@pytest.mark.parametrize("angle", [0.0, 30.0, 90.0, 200.0])
def test_a_grating_changes_along_its_direction_alone(angle: float) -> None:
    radians = math.radians(angle)
    ramp = torch.linspace(-1, 1, 301, dtype=torch.float64)[None]
    made = GratingMap(40, [radians], ramp)().detach()
    place = (torch.arange(40, dtype=torch.float64) + 0.5) / 40 - 0.5
    along = math.cos(radians) * place[None, :] + math.sin(radians) * place[:, None]
    assert torch.allclose(made, along * math.sqrt(2), atol=1e-12)


def test_gratings_are_summed_and_gradients_reach_every_profile() -> None:
    model = GratingMap(16, [0.0, math.pi / 2], torch.rand(2, 9))
    each = [
        GratingMap(16, [a], model.profiles_um.detach()[n : n + 1])()
        for n, a in enumerate(model.angles_rad)
    ]
    assert torch.allclose(model(), sum(each), atol=1e-6)  # type: ignore[arg-type]
    model().sum().backward()
    assert model.profiles_um.grad is not None
    assert float(model.profiles_um.grad.sum()) == pytest.approx(2 * 256, rel=1e-5)


def test_a_radial_profile_is_met_at_its_radius() -> None:
    ramp = torch.linspace(0, 1, 11, dtype=torch.float64)
    made = RadialMap(20, ramp)().detach()
    place = (torch.arange(20, dtype=torch.float64) + 0.5) / 20 - 0.5
    radius = (place[:, None] ** 2 + place[None, :] ** 2).sqrt()
    assert torch.allclose(made, radius * math.sqrt(2), atol=1e-12)


def test_zernike_terms_stand_in_nolls_order() -> None:
    """Noll 1976, table I."""
    expected = [(0, 0), (1, 1), (1, -1), (2, 0), (2, -2), (2, 2), (3, -1), (3, 1), (3, -3), (3, 3)]
    assert [noll_order(term) for term in range(1, 11)] == expected
    assert noll_order(11) == (4, 0)


def test_zernike_terms_are_orthonormal() -> None:
    basis = zernike_basis(400, 11)
    inside = basis[0] > 0
    products = torch.einsum("ahw,bhw->ab", basis, basis) / inside.sum()
    assert torch.allclose(products, torch.eye(11, dtype=torch.float64), atol=0.01)
    defocus = ZernikeMap(64, torch.tensor([0.0, 0.0, 0.0, 1.0], dtype=torch.float64))().detach()
    assert float(defocus[32, 32]) == pytest.approx(-math.sqrt(3), abs=0.01)


def test_what_makes_no_map_is_refused() -> None:
    for wrong in (
        lambda: RankMap(4, rank=0),
        lambda: RankMap(4, most_um=0.0),
        lambda: GratingMap(4, [0.0], torch.zeros(2, 5)),
        lambda: GratingMap(4, [], torch.zeros(0, 5)),
        lambda: GratingMap(4, [0.0], torch.zeros(1, 1)),
        lambda: RadialMap(4, torch.zeros(1)),
        lambda: ZernikeMap(4, torch.zeros(0)),
        lambda: noll_order(0),
    ):
        with pytest.raises(ContractError):
            wrong()
