"""The thesis's networks between planes of roots, by name."""

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.thesis.chain import ThesisChain
from camkit.models_def.kinds.hdr.thesis.networks import (
    THESIS_NAMES,
    build_thesis_network,
    to_light,
    to_roots,
)
from camkit.models_def.training.kind import training_kind
from tests.models_def.kinds.hdr.thesis.conftest import NETWORKS


def test_roots_and_light_undo_each_other_and_nothing_is_negative():
    light = torch.tensor([-1.0, 0.0, 0.25, 256.0])
    assert to_roots(light).tolist() == [0, 0, 0.5, 16]
    assert to_light(to_roots(light)).tolist() == [0, 0, 0.25, 256]
    assert to_light(torch.tensor([-2.0])).tolist() == [0]


@pytest.mark.parametrize(("role", "inputs", "outputs"), [("split", 3, 6), ("fusion", 6, 3)])
def test_pictures_lie_one_after_the_other_in_the_channels(role, inputs, outputs):
    name, config = NETWORKS[role]
    torch.manual_seed(0)
    network = build_thesis_network(name, **config)
    roots = torch.rand(1, inputs, 16, 32)
    found = network.body(*roots.square().split(3, dim=1))
    wanted = torch.cat(found, dim=1) if role == "split" else found
    assert network(roots).shape == (1, outputs, 16, 32)
    assert torch.allclose(network(roots).square(), wanted, atol=1e-5)


def test_the_kind_builds_every_name_and_those_of_the_catalogue():
    kind = training_kind("hdr")
    assert {name for name, _ in NETWORKS.values()} == set(THESIS_NAMES)
    built = [kind.build_network(name, **config) for name, config in NETWORKS.values()]
    assert [network.stride_px for network in built] == [16, 2, 1, 16]
    assert isinstance(built[-1].body, ThesisChain)
    assert kind.build_network("constant_unet", in_channels=3).in_channels == 3


@pytest.mark.parametrize(
    ("name", "config"), [("thesis_chain", {"fog": {}}), ("thesis_split", {"depth": 3})]
)
def test_an_unknown_field_is_refused(name, config):
    with pytest.raises(ContractError, match=f"{name} does not take this configuration"):
        build_thesis_network(name, **config)
