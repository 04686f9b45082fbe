"""State dicts of torch become networks, without running code of the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import nn

from camkit.errors import ContractError, DecodeError
from camkit.export.foreign.canonical import canonical_graph
from camkit.export.foreign.published import published_network
from camkit.export.foreign.state_dict import model_of_state_dict
from camkit.runtime.network.engine import NetworkEngine
from tests.foreign_networks import DnCNN, NAFNet, Sid, seeded


def _saved(path: Path, table: Any) -> Path:
    torch.save(table, path)
    return path


def _difference(path: Path, network: nn.Module, channels: int = 3, **how: Any) -> float:
    made = canonical_graph(model_of_state_dict(path, how.get("module"), how.get("config", {})))
    window = np.random.default_rng(0).random((1, channels, 32, 48)).astype(np.float32)
    engine = NetworkEngine(made.model, threads=1, scale=made.facts.output_scale)
    with torch.no_grad():
        expected = network(torch.from_numpy(window)).numpy()
    return float(np.abs(engine.run(window) - expected).max())


@pytest.mark.parametrize("wrapper", [None, "params", "state_dict"])
def test_a_dncnn_is_known_by_its_keys(tmp_path: Path, wrapper: str | None) -> None:
    network = seeded(DnCNN)
    state = {f"module.{key}": value for key, value in network.state_dict().items()}
    path = _saved(tmp_path / "a.pth", state if wrapper is None else {wrapper: state})
    assert _difference(path, network) < 1e-5


def test_a_nafnet_is_known_by_its_keys(tmp_path: Path) -> None:
    network = seeded(NAFNet, enc_blk_nums=(1,), dec_blk_nums=(1,))
    path = _saved(tmp_path / "a.pth", {"params": network.state_dict(), "iter": 3})
    assert _difference(path, network) < 1e-5


def test_every_block_of_a_nafnet_is_counted() -> None:
    network = seeded(NAFNet, enc_blk_nums=(1, 2), dec_blk_nums=(3, 1), middle_blk_num=2)
    published = published_network(network.state_dict())
    assert published is not None
    name, counted, weights = published
    assert name == "NAFNet"
    counted.load_state_dict(weights)
    window = torch.rand(1, 3, 32, 48, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        assert torch.allclose(counted.eval()(window), network(window), atol=1e-5)


def test_a_class_that_is_named_is_filled(tmp_path: Path) -> None:
    network = seeded(Sid, width=4)
    path = _saved(tmp_path / "a.pth", network.state_dict())
    how = {"module": "tests.foreign_networks:Sid", "config": {"width": 4}}
    assert _difference(path, network, channels=4, **how) < 1e-5


@pytest.mark.parametrize(
    ("module", "config", "message"),
    [
        ("tests.foreign_networks:Sid", {"width": 8}, r"weights do not fit .*of another shape"),
        ("tests.foreign_networks:DnCNN", {}, r"weights do not fit .*missing: 0\.weight.*not in it"),
        ("tests.foreign_networks:Nobody", {}, "cannot be imported"),
        ("tests.foreign_networks:Sid", {"colour": 1}, "cannot be made"),
        ("tests.foreign_networks", {}, "takes package:Class"),
        ("tests.foreign_networks:io.BytesIO", {}, "cannot be imported"),
        ("pathlib:Path", {}, "makes no torch network"),
    ],
)
def test_what_does_not_fit_is_refused(
    tmp_path: Path, module: str, config: dict[str, Any], message: str
) -> None:
    path = _saved(tmp_path / "a.pth", seeded(Sid, width=4).state_dict())
    with pytest.raises(ContractError, match=message):
        model_of_state_dict(path, module, config)


def test_a_network_that_nobody_knows_is_refused(tmp_path: Path) -> None:
    path = _saved(tmp_path / "a.pth", {"strange.0.weight": torch.zeros(4, 3, 3, 3)})
    with pytest.raises(DecodeError, match=r"not known \(strange\.0\.weight, \.\.\.\)"):
        model_of_state_dict(path, None, {})


def test_code_in_a_file_is_never_run_and_torch_gives_no_advice(tmp_path: Path) -> None:
    path = _saved(tmp_path / "a.pth", {"model": seeded(DnCNN)})
    with pytest.raises(ContractError, match="no code of a file is ever run") as caught:
        model_of_state_dict(path, None, {})
    assert "weights_only" not in str(caught.value)


def test_spandrel_brings_networks_that_it_knows(tmp_path: Path) -> None:
    try:
        import spandrel
    except (ImportError, RuntimeError) as error:  # its torchvision need not load
        pytest.skip(f"spandrel does not load here: {error}")
    from spandrel.architectures.SPAN import SPAN

    network = SPAN(num_in_ch=3, num_out_ch=3, feature_channels=8, upscale=2).eval()
    path = _saved(tmp_path / "a.pth", network.state_dict())
    assert spandrel.__name__
    assert model_of_state_dict(path, None, {}).channels == 3
