"""Pairs of the owner's own script prove a contract, and name its mistake."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from onnx import helper

from camkit.errors import ContractError, DecodeError, ParityError
from camkit.export.foreign.contract import Contract, to_contract
from camkit.export.foreign.own_pairs import prove_pairs, read_pairs
from camkit.runtime.network.engine import NetworkEngine
from tests.bundle_factory import make_model

MATRIX = np.array([[1.6, -0.5, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.4, 1.4]])
RNG = np.random.default_rng(8)
WEIGHT = (RNG.random((3, 3, 3, 3)) / 27 * np.array([1, 2, 3])[:, None, None, None]).astype("f4")


def _network(channels: int = 3, weight: np.ndarray = WEIGHT, outputs: int = 3) -> bytes:
    nodes = [helper.make_node("Conv", ["input", "w"], ["output"], "conv", pads=[1] * 4)]
    return make_model(nodes, {"w": weight}, channels=(channels, outputs)).SerializeToString()


def _prove(
    path: Path, contract: Contract, data: bytes, *, matrix: np.ndarray = MATRIX, scale: int = 1
) -> float:
    return prove_pairs(read_pairs(path), contract, data, matrix=matrix, scale=scale, stride_px=1)


def _contract(**given: Any) -> Contract:
    proof = {"space": given.pop("pairs", "srgb")}
    return to_contract({"input": {"planes": "rgb", "space": "srgb", **given}, "proof": proof})


@pytest.fixture
def pairs(tmp_path: Path) -> Path:
    """Compute what a script on sRGB pictures of 0 to 255 gives, in plain numpy."""
    picture = RNG.integers(0, 256, (3, 24, 32), dtype=np.uint8)
    fed = picture.astype(np.float32)[None]
    made = NetworkEngine(_network(), threads=1).run(fed)[0] / 255
    path = tmp_path / "io.npz"
    np.savez(path, input=picture, output=made)
    return path


def test_the_right_contract_agrees(pairs: Path) -> None:
    assert _prove(pairs, _contract(range=[0, 255]), _network()) <= 1e-5


@pytest.mark.parametrize(
    ("given", "mistake"),
    [
        ({"range": [-1, 1]}, r"with range = \[0, 255\]|with range = \[0, 1\]"),
        ({"range": [0, 255], "pairs": "camera-linear"}, 'with proof.space = "srgb"'),
        ({"range": [0, 255], "space": "rec709-linear"}, 'with space = "srgb"'),
    ],
)
def test_a_wrong_range_or_curve_is_named(pairs: Path, given: dict[str, Any], mistake: str) -> None:
    with pytest.raises(ParityError, match=rf"differ by .* They agree .*({mistake})"):
        _prove(pairs, _contract(**given), _network())


def test_a_residual_that_was_forgotten_is_named(tmp_path: Path) -> None:
    picture = RNG.random((3, 24, 32)).astype(np.float32)
    noise = NetworkEngine(_network(), threads=1).run(picture[None])[0]
    np.savez(tmp_path / "io.npz", input=picture, output=picture - noise)
    with pytest.raises(ParityError, match='agree with residual = "subtracted"'):
        _prove(tmp_path / "io.npz", _contract(), _network())


def test_swapped_colours_are_named(tmp_path: Path) -> None:
    picture = RNG.random((3, 24, 32)).astype(np.float32)
    engine = NetworkEngine(_network(), threads=1)
    made = engine.run(np.ascontiguousarray(picture[::-1])[None])[0][::-1]
    np.savez(tmp_path / "io.npz", input=picture, output=made)
    with pytest.raises(ParityError, match="agree with R and B of input and output swapped"):
        _prove(tmp_path / "io.npz", _contract(), _network())


def test_light_of_the_camera_becomes_srgb_by_its_matrix(tmp_path: Path) -> None:
    light = RNG.uniform(0.2, 0.5, (3, 16, 16)).astype(np.float32)
    rec709 = np.einsum("ij,jyx->yxi", MATRIX, light)
    curve = np.where(rec709 <= 0.0031308, 12.92 * rec709, 1.055 * rec709 ** (1 / 2.4) - 0.055)
    fed = np.moveaxis(curve, -1, 0).astype(np.float32)
    made = NetworkEngine(_network(), threads=1).run(np.ascontiguousarray(fed)[None])[0]
    back = np.where(made <= 0.04045, made / 12.92, ((made + 0.055) / 1.055) ** 2.4)
    result = np.einsum("ij,jyx->iyx", np.linalg.inv(MATRIX), back).astype(np.float32)
    np.savez(tmp_path / "io.npz", input=light, output=result)
    assert _prove(tmp_path / "io.npz", _contract(pairs="camera-linear"), _network()) <= 1e-5


def test_the_order_of_a_packed_cell_is_named(tmp_path: Path) -> None:
    mosaic = RNG.random((24, 32)).astype(np.float32)
    fed = np.stack([mosaic[::2, ::2], mosaic[::2, 1::2], mosaic[1::2, 1::2], mosaic[1::2, ::2]])
    weight = (RNG.random((12, 4, 3, 3)) / 20).astype(np.float32)
    nodes = [
        helper.make_node("Conv", ["input", "w"], ["deep"], "conv", pads=[1] * 4),
        helper.make_node("DepthToSpace", ["deep"], ["output"], "fine", blocksize=2, mode="CRD"),
    ]
    data = make_model(nodes, {"w": weight}, channels=(4, 3)).SerializeToString()
    made = NetworkEngine(data, threads=1, scale=2).run(fed[None])[0]
    np.savez(tmp_path / "io.npz", input=mosaic, output=made)
    given = {"planes": "packed", "space": "camera-linear"}
    right = to_contract({"input": given | {"order": ["R", "G1", "B", "G2"]}})
    assert _prove(tmp_path / "io.npz", right, data, scale=2) <= 1e-5
    with pytest.raises(ParityError, match=r'agree with order = \["R", "G1", "B", "G2"\]'):
        _prove(tmp_path / "io.npz", to_contract({"input": given}), data, scale=2)


def test_what_no_common_mistake_explains_is_said(pairs: Path) -> None:
    other = _network(weight=np.float32(0.5) * WEIGHT[::-1].copy())
    with pytest.raises(ParityError, match="None of the common mistakes explains it"):
        _prove(pairs, _contract(range=[0, 255]), other)


def test_arrays_that_are_no_pairs_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "io.npz"
    np.savez(path, input=np.zeros((3, 8, 8)))
    with pytest.raises(DecodeError, match="lacks output; it holds input"):
        read_pairs(path)
    np.savez(path, input=np.zeros((4, 8, 8), np.float32), output=np.zeros((3, 8, 8), np.float32))
    with pytest.raises(ContractError, match=r"begins with 3 channel\(s\)"):
        _prove(path, _contract(), _network())
    path.write_bytes(b"no zip")
    with pytest.raises(DecodeError, match=r"no \.npz"):
        read_pairs(path)
