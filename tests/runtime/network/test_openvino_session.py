"""The door to openvino: refusals everywhere, numbers where it is installed."""

import os
import subprocess
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import onnx
import pytest

from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.runtime.cancel import Cancelled
from camkit.runtime.network import openvino_session
from camkit.runtime.network.engine import NetworkEngine, usable_providers
from camkit.runtime.network.openvino_session import has_openvino, missing_bfloat16
from camkit.runtime.network.tiling import TileLimits, infer_bands, lay_windows
from camkit.runtime.rows import ArrayRows
from tests.small_network import HALO_PX, STRIDE_PX, small_network

BFLOAT16_UNIT = 2.0**-9
installed = pytest.mark.skipif(not has_openvino(), reason="openvino is not installed")


def _engine(*, bfloat16: bool = False, model: bytes | None = None) -> NetworkEngine:
    return NetworkEngine(
        model or small_network(), threads=1, provider="openvino", bfloat16=bfloat16
    )


def _bfloat16_engine() -> NetworkEngine:
    if (missing := missing_bfloat16()) is not None:
        pytest.skip(f"bfloat16 needs {missing}")
    return _engine(bfloat16=True)


def _window(height: int = 64, width: int = 96, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((1, 6, height, width)).astype(np.float32)


def _stand_in(monkeypatch: pytest.MonkeyPatch, *capabilities: str) -> None:
    """Stand openvino in on a processor of these capabilities."""
    core = SimpleNamespace(get_property=lambda *_: list(capabilities))
    monkeypatch.setattr(openvino_session, "has_openvino", lambda: True)
    monkeypatch.setattr(openvino_session, "_core", lambda: core)


def test_without_the_package_it_is_refused_by_name(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(openvino_session, "has_openvino", lambda: False)
    expected = r'provider="openvino" needs the package openvino: run pip install .*provider="cpu"'
    with pytest.raises(UnsupportedError, match=expected):
        _engine()
    assert "package openvino" in (missing_bfloat16() or "")


@pytest.mark.parametrize(("flags_lack", "capability"), [(True, "BF16"), (False, "FP32")])
def test_a_processor_without_bfloat16_is_refused_by_the_flags_that_it_lacks(
    flags_lack: bool, capability: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    _stand_in(monkeypatch, capability)
    monkeypatch.setattr(openvino_session, "lacks_bfloat16", lambda: flags_lack)
    monkeypatch.setattr(openvino_session, "processor_fact", lambda _: "Tester 1")
    expected = r'dtype="bf16" needs .*avx512_bf16 or amx_bf16 \(Tester 1 .*use dtype="fp32"'
    with pytest.raises(UnsupportedError, match=expected):
        _engine(bfloat16=True)


def test_weights_outside_the_model_are_refused_before_openvino_sees_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    _stand_in(monkeypatch)
    model = onnx.load_from_string(small_network())
    weight = model.graph.initializer[0]
    weight.data_location = onnx.TensorProto.EXTERNAL
    weight.external_data.add(key="location", value="secret.bin")
    with pytest.raises(BundleError, match="external data"):
        _engine(model=model.SerializeToString())


def test_its_telemetry_is_kept_out_and_left_to_others(tmp_path: Path) -> None:
    (tmp_path / "openvino").mkdir()
    (tmp_path / "openvino" / "__init__.py").write_text(
        "try:\n    import openvino_telemetry\nexcept ImportError:\n    pass\n"
    )
    (tmp_path / "openvino_telemetry.py").write_text("print('sent')\n")
    path = os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", ""), *sys.path])
    code = (
        "from camkit.runtime.network.openvino_session import _openvino; _openvino(); "
        "print('imported'); import openvino_telemetry"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == ["imported", "sent"]


@installed
def test_it_is_among_the_providers() -> None:
    assert usable_providers()[-1] == "openvino"


@installed
def test_float32_is_that_of_onnxruntime_but_for_rounding() -> None:
    window, engine = _window(), _engine()
    expected = NetworkEngine(small_network(), threads=1).run(window)
    out = np.full_like(expected, np.nan)
    assert engine.run(window, out) is out
    assert np.abs(out - expected).max() < 1e-5
    # windows of another size are compiled for, and those of before again
    assert engine.run(_window(32, 32)).shape == (1, 3, 32, 32)
    assert np.array_equal(engine.run(window), out)


@installed
def test_bfloat16_is_near_and_not_the_same() -> None:
    """Each convolution rounds weights and samples: two rounding units of what it gives."""
    window, engine = _window(), _bfloat16_engine()
    expected = NetworkEngine(small_network(), threads=1).run(window)
    nodes = onnx.load_from_string(small_network()).graph.node
    convolutions = sum(node.op_type == "Conv" for node in nodes)
    error = np.sqrt(np.square(engine.run(window) - expected).mean())
    spread = np.sqrt(np.square(expected).mean())
    assert 1e-5 < error / spread < 2 * convolutions * BFLOAT16_UNIT


@installed
@pytest.mark.parametrize("bfloat16", [False, True])
def test_tiles_are_as_near_the_whole_as_the_numbers_are(bfloat16: bool) -> None:
    engine = _bfloat16_engine() if bfloat16 else _engine()
    picture = _window(160, 224)[0]
    limits = TileLimits(stride_px=STRIDE_PX, halo_px=HALO_PX, tile_px=48)
    layout = lay_windows(160, 224, limits)
    tiled = np.concatenate(list(infer_bands(engine.run, ArrayRows(picture), layout)), axis=1)
    whole = engine.run(picture[None])[0]
    assert np.abs(tiled - whole).max() <= (16 * BFLOAT16_UNIT if bfloat16 else 1e-5)


@installed
def test_a_side_off_the_stride_and_a_stopped_run_end_by_name() -> None:
    engine = _engine()
    with pytest.raises(ContractError, match="multiples of its stride"):
        engine.run(_window(18, 24))
    stop = threading.Event()
    stop.set()
    with pytest.raises(Cancelled):
        engine.run(_window(2048, 2048), cancel=stop)
