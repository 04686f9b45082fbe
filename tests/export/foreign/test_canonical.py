"""Foreign graphs in canonical form compute what they did, or name everything in their way."""

from pathlib import Path

import numpy as np
import onnx
import pytest
import torch
from onnx import TensorProto, helper, numpy_helper
from torch import Tensor, nn
from torch.nn import functional

from camkit.errors import DecodeError, UnsupportedError
from camkit.export.foreign.canonical import TOLERANCE, canonical_draft, canonical_graph
from camkit.export.foreign.onnx_file import ForeignModel, foreign_model, read_model
from camkit.runtime.network.graph import parse_graph
from tests.foreign_networks import DnCNN, Exporter, Mdta, NAFNet, NormedUnet, Sid, exported, seeded


def _model(data: bytes) -> ForeignModel:
    return foreign_model(onnx.load_from_string(data))


def _ops(data: bytes) -> set[str]:
    return {node.op for node in parse_graph(data).nodes}


class ShallowNaf(NAFNet):
    """One level instead of two: the exporter of torch takes a second for each block."""

    def __init__(self) -> None:
        super().__init__(enc_blk_nums=(1,), dec_blk_nums=(1,))


CASES: list[tuple[type[nn.Module], Exporter, int, int, bool, tuple[int, int, int]]] = [
    # network, exporter, channels, opset, half precision, (reach, stride, scale)
    (DnCNN, "dynamo", 3, 20, False, (4, 1, 1)),
    (DnCNN, "legacy", 3, 11, False, (4, 1, 1)),
    (DnCNN, "legacy", 3, 17, True, (4, 1, 1)),
    (Sid, "dynamo", 4, 23, False, (8, 2, 2)),
    (Sid, "legacy", 4, 11, True, (8, 2, 2)),
    (ShallowNaf, "dynamo", 3, 20, False, (6, 2, 1)),
    (NAFNet, "legacy", 3, 17, True, (12, 4, 1)),
    (NormedUnet, "legacy", 3, 11, False, (11, 2, 1)),
    (NormedUnet, "dynamo", 3, 18, False, (11, 2, 1)),
]


@pytest.mark.parametrize(("network", "exporter", "channels", "opset", "half", "facts"), CASES)
def test_networks_of_others_become_canonical_with_the_same_numbers(
    network: type[nn.Module],
    exporter: Exporter,
    channels: int,
    opset: int,
    half: bool,
    facts: tuple[int, int, int],
) -> None:
    data = exported(seeded(network), exporter, channels=channels, opset=opset, half=half)
    made = canonical_graph(_model(data))
    assert made.difference <= TOLERANCE
    assert (made.half_difference is not None) == half
    reach, stride, scale = facts
    assert made.facts.receptive_field_radius_px == reach
    assert (made.facts.stride_px, made.facts.output_scale) == (stride, scale)
    assert bool(made.facts.global_operators) == (network in (NAFNet, ShallowNaf, NormedUnet))
    assert onnx.load_from_string(made.model).opset_import[0].version == 20


def test_attention_over_the_picture_names_all_that_is_in_its_way() -> None:
    draft, obstacles = canonical_draft(_model(exported(seeded(Mdta), "legacy", opset=11)))
    assert draft is not None
    text = "; ".join(obstacles)
    assert "MatMul (2 times): it multiplies tensors of the picture" in text
    assert "Reshape (4 times)" in text
    with pytest.raises(UnsupportedError, match=r"cannot be taken: .*Reshape.*MatMul"):
        canonical_graph(_model(exported(seeded(Mdta))))


class _Unshuffled(nn.Module):
    """Blocks taken apart by Reshape and Transpose, squared, padded, and put together again."""

    def __init__(self, together: bool) -> None:
        super().__init__()
        self.together = together
        self.conv = nn.Conv2d(12, 12, 3)

    def forward(self, x: Tensor) -> Tensor:
        b, c, h, w = x.shape
        split = x.reshape(b, c, h // 2, 2, w // 2, 2)
        order = (0, 3, 5, 1, 2, 4) if self.together else (0, 1, 3, 5, 2, 4)
        deep = split.permute(*order).reshape(b, 4 * c, h // 2, w // 2)
        deep = self.conv(functional.pad(deep**2, (1, 1, 1, 1)))
        fine = deep.reshape(b, c, 2, 2, h // 2, w // 2).permute(0, 1, 4, 2, 5, 3)
        return fine.reshape(b, c, h, w)


@pytest.mark.parametrize("together", [False, True])
def test_reshaped_blocks_become_shuffles_and_zero_pads_part_of_convolutions(together: bool) -> None:
    torch.manual_seed(2)
    made = canonical_graph(_model(exported(_Unshuffled(together).eval(), "legacy", opset=17)))
    expected = {"SpaceToDepth", "Mul", "Conv", "DepthToSpace"}
    assert _ops(made.model) == expected
    assert made.facts.receptive_field_radius_px == 2


@pytest.mark.parametrize(
    ("kernel", "stride", "pad", "growth"), [(2, 2, 0, 0), (3, 2, 1, 1), (4, 2, 1, 0), (6, 4, 1, 0)]
)
def test_transposed_convolutions_lie_on_the_coarse_grid(
    kernel: int, stride: int, pad: int, growth: int
) -> None:
    torch.manual_seed(4)
    up = nn.ConvTranspose2d(8, 4, kernel, stride=stride, padding=pad, output_padding=growth)
    network = nn.Sequential(nn.Conv2d(3, 8, 3, padding=1), up).eval()
    made = canonical_graph(_model(exported(network, "legacy", opset=17)))
    assert _ops(made.model) == {"Conv", "DepthToSpace"}
    assert not made.facts.unblocked_convolutions
    assert made.facts.output_scale == stride


class _Norms(nn.Module):
    """Norms of groups over the picture, and of a pixel over its channels."""

    def __init__(self) -> None:
        super().__init__()
        self.conv = nn.Conv2d(3, 8, 3, padding=1)
        self.groups = nn.GroupNorm(2, 8)
        self.pixel = nn.LayerNorm(8)
        self.last = nn.Conv2d(8, 3, 1)
        for norm in (self.groups, self.pixel):
            nn.init.uniform_(norm.weight, 0.5, 1.5)
            nn.init.uniform_(norm.bias, -0.5, 0.5)

    def forward(self, x: Tensor) -> Tensor:
        y = self.groups(self.conv(x))
        y = self.pixel(y.permute(0, 2, 3, 1)).permute(0, 3, 1, 2)
        return self.last(y)


@pytest.mark.parametrize(("exporter", "opset"), [("dynamo", 20), ("dynamo", 21), ("legacy", 17)])
def test_norms_become_means_over_the_picture_or_the_channels(
    exporter: Exporter, opset: int
) -> None:
    torch.manual_seed(6)
    made = canonical_graph(_model(exported(_Norms().eval(), exporter, opset=opset)))
    assert len(made.facts.global_operators) == 2
    assert "GroupNormalization" not in _ops(made.model)


class _Curves(nn.Module):
    """Pointwise curves as networks that work on display values have them."""

    def forward(self, x: Tensor) -> Tensor:
        y = x.abs() + 0.01
        curve = torch.where(y <= 0.04045, y / 12.92, ((y + 0.055) / 1.055) ** 2.4)
        mask = (x > 0.5).float()
        return curve + torch.log(y) * 0.1 + torch.exp(-y) * mask + functional.gelu(x)


@pytest.mark.parametrize("exporter", ["dynamo", "legacy"])
def test_powers_exponents_logarithms_and_choices_are_pointwise(exporter: Exporter) -> None:
    made = canonical_graph(_model(exported(_Curves().eval(), exporter, opset=18)))
    assert made.facts.receptive_field_radius_px == 0
    assert {"Pow", "Exp", "Log", "Where"} <= _ops(made.model)


@pytest.mark.parametrize("mode", ["reflect", "replicate"])
def test_mirrored_and_edge_pads_reach_as_far_as_the_convolution_behind_them(mode: str) -> None:
    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(3, 3, 5, padding=2, padding_mode=mode)).eval()
    made = canonical_graph(_model(exported(network, "legacy", opset=17)))
    assert "Pad" in _ops(made.model)
    assert made.facts.receptive_field_radius_px == 2


def test_weights_in_a_file_beside_the_model_are_taken_in(tmp_path: Path) -> None:
    proto = onnx.load_from_string(exported(seeded(DnCNN)))
    onnx.save(
        proto, tmp_path / "net.onnx", save_as_external_data=True, location="w", size_threshold=0
    )
    made = canonical_graph(read_model(tmp_path / "net.onnx"))
    assert made.difference <= TOLERANCE
    (tmp_path / "w").unlink()
    with pytest.raises(DecodeError, match=r"net\.onnx"):
        read_model(tmp_path / "net.onnx")


def _one_node(**facts: object) -> onnx.ModelProto:
    graph = helper.make_graph(
        [helper.make_node("Relu", ["x"], ["y"])],
        "one",
        [helper.make_tensor_value_info("x", TensorProto.FLOAT, [2, 3, 48, 48])],
        [helper.make_tensor_value_info("y", TensorProto.FLOAT, [2, 3, 48, 48])],
        [numpy_helper.from_array(np.zeros(1, np.float32), "unused")],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], **facts)


def test_fixed_sides_and_batches_are_opened() -> None:
    assert canonical_graph(foreign_model(_one_node())).difference == 0.0


def test_an_old_opset_and_a_second_output_are_named_together() -> None:
    proto = _one_node()
    proto.opset_import[0].version = 9
    proto.graph.output.append(helper.make_tensor_value_info("x", TensorProto.FLOAT, None))
    _, obstacles = canonical_draft(foreign_model(proto))
    assert len(obstacles) == 2
    assert obstacles[0].startswith("opset 9; 11 to 23 are taken")


def test_a_file_that_is_no_onnx_is_a_decode_error(tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"no onnx at all")
    with pytest.raises(DecodeError):
        read_model(tmp_path / "a.onnx")
