"""First weights are those that were trained, wherever they are read from, or a clear error."""

from dataclasses import replace
from pathlib import Path

import onnx
import pytest
import torch
from onnx import external_data_helper

from camkit.bundle.reader import find_bundle, open_bundle
from camkit.errors import BundleError, ContractError
from camkit.export.onnx_graph import to_onnx
from camkit.models_def.networks.catalog import build_network
from camkit.models_def.training.first_weights import (
    FirstWeights,
    read_first_weights,
    state_of_onnx,
    take_first_weights,
)


def trained(name, **config):
    """Give a network no two tensors of which are equal; an export keeps one of equal ones."""
    network = build_network(name, **config)
    with torch.no_grad():
        for parameter in network.parameters():
            parameter.add_(0.1 * torch.rand_like(parameter))
    return network


def equal(one, two):
    return one.keys() == two.keys() and all(torch.equal(one[k], two[k]) for k in one)


@pytest.fixture(scope="module")
def network():
    return trained("lean_s", bias=True)


@pytest.fixture(scope="module")
def graph(network):
    return to_onnx(network)


def test_export_keeps_every_weight_under_its_name(network, graph):
    assert equal(state_of_onnx(graph), network.state_dict())


def test_bundle_of_a_network_with_prelus_sends_to_its_checkpoint():
    with pytest.raises(ContractError, match="begin at the checkpoint"):
        state_of_onnx(to_onnx(trained("trimmed_unet", widths=[4, 4, 8])))


@pytest.mark.parametrize("size", ["S", "M"])
@pytest.mark.parametrize("bundle", ["duet", "duet-joint", "trio-edof"])
def test_networks_of_a_built_in_bundle_can_be_trained_further(bundle, size):
    first = read_first_weights(Path(bundle), size)
    network = build_network(f"lean_{size.lower()}", bias=True)
    assert set(take_first_weights(network, first)) == set(network.state_dict())
    graph = open_bundle(find_bundle(bundle)).network_bytes("restore", size)
    assert equal(state_of_onnx(graph), network.state_dict())
    assert first.credit("other pictures").startswith(f"; first weights: {bundle} {size}, trained ")
    assert first.credit(first.training_data).endswith("trained on the same")
    pictures = first.training_data.split(";")[0]
    assert pictures not in first.credit(pictures)


def test_parts_of_one_training_are_told_once():
    first = FirstWeights(source="x.pt", whose="x S", training_data="a", state={})
    second = replace(first, training_data="a" + first.credit("a"))
    assert second.credit("a") == first.credit("a") == "; first weights: x S, trained on the same"
    assert second.credit("b").count("first weights") == 2


def test_bundle_without_the_size_names_those_it_has():
    with pytest.raises(ContractError, match="no network of size 'full' for restore; it has: S, M"):
        read_first_weights(Path("duet-joint"), "full")
    with pytest.raises(BundleError, match="did you mean"):
        read_first_weights(Path("duet-jiont"), "M")


def test_a_joint_design_gives_the_network_that_went_with_its_best_lens(tmp_path):
    network = build_network("trimmed_unet", widths=[4, 4, 8])
    path, state = tmp_path / "joint.pt", network.state_dict()
    later = {name: tensor + 1 for name, tensor in state.items()}
    table = {"format": 2, "digest": "d", "best": {"network": state}, "weights": {"network": later}}
    torch.save(table, path)
    full = build_network("full_unet", widths=[4, 4, 8, 8, 8, 8, 8])
    first = read_first_weights(path, "full")
    assert equal(full.outer.state_dict(), state) is False
    assert take_first_weights(full, first) == tuple(f"outer.{name}" for name in state)
    assert equal(full.outer.state_dict(), state)
    assert "the joint design joint" in first.credit("x")
    torch.save({**table, "best": {}, "weights": {"moves": torch.zeros(3)}}, path)
    with pytest.raises(ContractError, match="design without a network"):
        read_first_weights(path, "full")


def test_weights_of_another_shape_are_refused():
    state = build_network("trimmed_unet", widths=[4, 4, 8]).state_dict()
    first = FirstWeights(source="a.pt", whose="a M", training_data="", state=state)
    for name, config in (("trimmed_unet", {"widths": [4, 8, 8]}), ("lean_s", {})):
        with pytest.raises(ContractError, match=r"a\.pt \(a M\) holds another network"):
            take_first_weights(build_network(name, **config), first)


def test_what_is_no_checkpoint_is_an_error(tmp_path):
    path = tmp_path / "x.pt"
    with pytest.raises(ContractError, match="cannot read checkpoint"):
        read_first_weights(path, "M")
    torch.save([1], path)
    with pytest.raises(ContractError, match="is no checkpoint"):
        read_first_weights(path, "M")


def test_weights_outside_the_model_are_refused(graph):
    model = onnx.load_from_string(graph)
    external_data_helper.set_external_data(model.graph.initializer[0], location="weights.bin")
    with pytest.raises(ContractError, match="lies in another file"):
        state_of_onnx(model.SerializeToString())
