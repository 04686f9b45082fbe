"""The exported graph: plain, anonymous, reproducible, and equal to torch."""

import logging
import warnings
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from torch import nn

from camkit.errors import ContractError, ParityError, UnsupportedError
from camkit.export.onnx_graph import check_parity, to_fp16, to_onnx
from camkit.models_def.networks.catalog import build_network
from camkit.runtime.network.engine import NetworkEngine, largest_activations
from camkit.runtime.network.graph import inspect_graph, with_node_outputs

LEAN_OPERATORS = {"Conv", "LeakyRelu", "Add", "DepthToSpace", "Slice"}
TRIMMED_OPERATORS = {"Conv", "LeakyRelu", "MaxPool", "ConvTranspose", "Concat", "Add"}


def _network(name: str, seed: int = 0, **config: object) -> nn.Module:
    torch.manual_seed(seed)
    network = build_network(name, **config)
    if hasattr(network, "tail"):
        nn.init.normal_(network.tail.weight, std=0.05)
    return network


@pytest.fixture(scope="module")
def network() -> nn.Module:
    return _network("lean_s")


@pytest.fixture(scope="module")
def model(network: nn.Module) -> bytes:
    return to_onnx(network)


@pytest.fixture(scope="module")
def activations(model: bytes) -> dict[str, float]:
    probed, names = with_node_outputs(model)
    return largest_activations(probed, names, _windows())


def _windows() -> list[np.ndarray]:
    rng = np.random.default_rng(4)
    return [rng.random((1, 6, 32, 48)).astype(np.float32), np.ones((1, 6, 16, 16), np.float32)]


def test_graph_holds_plain_operators_only(model: bytes) -> None:
    assert {n.op_type for n in onnx.load_from_string(model).graph.node} == LEAN_OPERATORS


def test_reference_network_exports_with_pooling_and_transposed_convolutions() -> None:
    data = to_onnx(_network("trimmed_unet", widths=[16, 16, 16], in_channels=3), channels=3)
    assert {n.op_type for n in onnx.load_from_string(data).graph.node} == TRIMMED_OPERATORS
    assert inspect_graph(data).stride_px == 4


def test_versions_names_and_free_sides_are_stamped(model: bytes) -> None:
    proto = onnx.load_from_string(model)
    assert (proto.ir_version, [o.version for o in proto.opset_import]) == (10, [20])
    assert [o.domain for o in proto.opset_import] == [""]
    for value, name in ((proto.graph.input[0], "input"), (proto.graph.output[0], "output")):
        dims = value.type.tensor_type.shape.dim
        assert value.name == name
        assert [d.dim_param for d in dims[2:]] == ["height", "width"]


def test_no_trace_of_the_machine_is_left(model: bytes) -> None:
    proto = onnx.load_from_string(model)
    assert not proto.metadata_props
    assert not any(n.metadata_props or n.doc_string for n in proto.graph.node)
    for trace in (b".py", b"site-packages", str(Path.home()).encode(), b"torch"):
        assert trace not in model


def test_a_second_export_is_silent_equal_and_leaves_the_training_mode(
    network: nn.Module, model: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    level = logging.getLogger("torch.onnx").level
    network.train()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        again = to_onnx(network)
    assert network.training
    assert again == model
    assert (capfd.readouterr(), logging.getLogger("torch.onnx").level) == (("", ""), level)


def test_graph_walk_agrees_with_the_design(model: bytes) -> None:
    facts = inspect_graph(model)
    assert facts.stride_px == 8
    assert facts.mac_per_pixel == pytest.approx(4560)
    assert (facts.global_operators, facts.unblocked_convolutions) == ((), ())
    assert facts.parameters == 77_376


def test_parity_is_far_below_the_tolerance(network: nn.Module, model: bytes) -> None:
    assert check_parity(network.eval(), model, _windows()) < 5e-6


def test_other_weights_are_a_parity_error(model: bytes) -> None:
    with pytest.raises(ParityError, match="differ by"):
        check_parity(_network("lean_s", seed=1).eval(), model, _windows())


def test_value_that_is_not_finite_is_a_parity_error(network: nn.Module, model: bytes) -> None:
    window = _windows()[0]
    window[0, 0, 0, 0] = np.nan
    with pytest.raises(ParityError, match="differ by nan"):
        check_parity(network.eval(), model, [window])


def test_export_without_a_program_is_a_parity_error(
    network: nn.Module, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(torch.onnx, "export", lambda *_, **__: None)
    with pytest.raises(ParityError, match="gave no program"):
        to_onnx(network)


def test_wrong_channels_are_refused(network: nn.Module) -> None:
    with pytest.raises(ContractError, match="takes 6 planes, not 3"):
        to_onnx(network, channels=3)


class _Finer(nn.Module):
    """(1, 1, h, w) -> (1, 2, 2 h, 2 w)."""

    stride_px = 2

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        fine = nn.functional.pixel_shuffle(torch.cat([x] * 4, dim=1), 2)
        return torch.cat([fine, 2 * fine], dim=1)


def test_a_finer_output_of_any_channels_is_exported() -> None:
    data = to_onnx(_Finer(), channels=1, scale=2)
    facts = inspect_graph(data)
    assert (facts.output_channels, facts.output_scale) == (2, 2)
    window = np.random.default_rng(1).random((1, 1, 6, 10)).astype(np.float32)
    assert check_parity(_Finer(), data, [window], scale=2) == 0


def test_an_output_of_another_scale_is_refused() -> None:
    with pytest.raises(ContractError, match=r"\(1, 2, 16, 16\) of \(1, 1, 8, 8\)"):
        to_onnx(_Finer(), channels=1)


def test_half_precision_is_half_the_size_and_near_the_same(
    model: bytes, activations: dict[str, float]
) -> None:
    half = to_fp16(model, activations, headroom=4.0)
    assert len(half) < 0.6 * len(model)
    full, small = (NetworkEngine(data, threads=1) for data in (model, half))
    for window in _windows():
        expected = full.run(window)
        assert np.abs(small.run(window) - expected).max() < 4e-3 * np.abs(expected).max()
    assert inspect_graph(half).stride_px == 8


def test_activation_near_the_limit_forbids_half_precision(
    model: bytes, activations: dict[str, float]
) -> None:
    name = max(activations, key=lambda key: activations[key])
    with pytest.raises(UnsupportedError, match="keep this network in fp32"):
        to_fp16(model, {**activations, name: 4100.0}, headroom=4.0)


def test_unmeasured_activation_forbids_half_precision(
    model: bytes, activations: dict[str, float]
) -> None:
    measured = dict(activations)
    measured.pop("output")
    with pytest.raises(UnsupportedError, match="output reaches inf"):
        to_fp16(model, measured)


def test_weight_beyond_half_precision_is_refused(
    model: bytes, activations: dict[str, float]
) -> None:
    proto = onnx.load_from_string(model)
    weight = proto.graph.initializer[0]
    values = onnx.numpy_helper.to_array(weight).copy()
    values.flat[0] = 1e5
    weight.CopyFrom(onnx.numpy_helper.from_array(values, weight.name))
    with pytest.raises(UnsupportedError, match=r"weight .* leaves the range"):
        to_fp16(proto.SerializeToString(), activations)
