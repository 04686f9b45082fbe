"""D-DBPN: as many parameters as the paper's, units that do what eq. (4.3) and (4.4) say."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.back_projection import (
    BackProjection,
    BackProjectionConfig,
    Projection,
)
from camkit.runtime.network.graph import inspect_graph

SMALL = BackProjectionConfig(stages=3, first_width=16, width=8)


def test_it_has_ten_million_four_hundred_thousand_parameters() -> None:
    """Counted by hand: 13 units of three 8x8, ten merges, features and the picture."""
    unit = 3 * (8 * 8 * 64 * 64 + 64 + 1)
    merges = 2 * sum(given * 64 * 64 + 64 + 1 for given in range(2, 7))
    features = (3 * 3 * 256 + 256 + 1) + (256 * 64 + 64 + 1)
    picture = 7 * 64 * 3 * 3 + 1
    network = BackProjection(BackProjectionConfig())
    found = sum(p.numel() for p in network.parameters())
    assert found == 13 * unit + merges + features + picture
    assert round(found / 1e6, 3) == 10.414


def test_a_picture_becomes_four_times_as_fine() -> None:
    assert BackProjection(SMALL)(torch.rand(2, 1, 5, 7)).shape == (2, 1, 20, 28)


@pytest.mark.parametrize("magnifies", [True, False])
def test_a_unit_adds_the_error_of_its_way_back(magnifies: bool) -> None:
    """The equations written out with the layers of the unit."""
    torch.manual_seed(0)
    unit = Projection(1, 4, magnifies=magnifies)
    x = torch.rand(1, 4, 8, 8)
    first = unit.there(x)
    assert torch.allclose(unit(x), first + unit.error(unit.back(first) - x))
    assert unit(x).shape[-1] == (32 if magnifies else 2)


def test_every_unit_sees_all_earlier_maps() -> None:
    torch.manual_seed(1)
    network = BackProjection(SMALL)
    widths = [
        merge[0].in_channels
        for unit in (*network.ups, *network.downs)
        if isinstance(merge := unit.merge, torch.nn.Sequential)  # type: ignore[union-attr]
    ]
    assert widths == [2 * 8, 2 * 8]
    network(torch.rand(1, 1, 4, 4)).square().mean().backward()
    assert all(p.grad is not None and p.grad.abs().sum() > 0 for p in network.parameters())


def test_its_graph_is_admitted() -> None:
    facts = inspect_graph(to_onnx(BackProjection(SMALL), channels=1, scale=4))
    assert facts.global_operators == ()


def test_impossible_shape_is_refused() -> None:
    with pytest.raises(ContractError, match="must be >= 1; got 0"):
        BackProjectionConfig(stages=0)
