"""The engine: sessions from bytes, runs from many threads, refusals that say why."""

import os
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import onnx
import pytest
from onnx import helper

from camkit.errors import BundleError, ContractError, UnsupportedError
from camkit.runtime.network import engine as engine_module
from camkit.runtime.network.engine import NetworkEngine, available_threads, largest_activations
from tests.planes_bundle import finer_model, finer_network
from tests.small_network import small_network


@pytest.fixture(scope="module")
def engine() -> NetworkEngine:
    return NetworkEngine(small_network(), threads=2)


def _window(height: int = 16, width: int = 24, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).random((1, 6, height, width)).astype(np.float32)


def test_output_lands_in_the_given_buffer(engine: NetworkEngine) -> None:
    out = np.full((1, 3, 16, 24), np.nan, np.float32)
    assert engine.run(_window(), out) is out
    assert np.array_equal(out, engine.run(_window()))


def test_strided_window_gives_the_same_bits_as_a_copy(engine: NetworkEngine) -> None:
    big = _window(32, 48)
    assert np.array_equal(
        engine.run(big[:, :, 8:24, 8:32]), engine.run(big[:, :, 8:24, 8:32].copy())
    )


def test_many_callers_of_one_session_get_the_same_bits(engine: NetworkEngine) -> None:
    windows = [_window(64, 64, seed) for seed in range(4)]
    alone = [engine.run(w) for w in windows]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(engine.run, windows * 5))
    assert all(np.array_equal(a, b) for a, b in zip(alone * 5, together, strict=True))


def test_engines_may_be_made_from_many_threads() -> None:
    model = small_network()
    made: list[int] = []
    threads = [
        threading.Thread(target=lambda: made.append(NetworkEngine(model, threads=1).channels))
        for _ in range(4)
    ]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert made == [6] * 4


def test_thread_count_does_not_change_the_bits() -> None:
    one, two = (NetworkEngine(small_network(), threads=n) for n in (1, 2))
    assert np.array_equal(one.run(_window(100, 60)), two.run(_window(100, 60)))


@pytest.mark.parametrize(
    "window",
    [
        np.zeros((6, 16, 16), np.float32),
        np.zeros((1, 3, 16, 16), np.float32),
        np.zeros((1, 6, 16, 16), np.float64),
    ],
)
def test_window_of_another_shape_or_type_is_refused(
    engine: NetworkEngine, window: np.ndarray
) -> None:
    with pytest.raises(ContractError, match="window must be float32"):
        engine.run(window)


def test_side_off_the_stride_is_refused_without_noise_on_stderr(
    engine: NetworkEngine, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(ContractError, match="multiples of its stride"):
        engine.run(_window(18, 24))
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("shape", [(1, 3, 16, 23), (1, 3, 24, 16)])
def test_buffer_of_another_shape_is_refused(engine: NetworkEngine, shape: tuple[int, ...]) -> None:
    with pytest.raises(ContractError, match="out must be"):
        engine.run(_window(), np.zeros(shape, np.float32))


def test_path_instead_of_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.onnx"
    path.write_bytes(small_network())
    with pytest.raises(ContractError, match="as bytes; got str"):
        NetworkEngine(str(path), threads=1)  # type: ignore[arg-type]


@pytest.mark.parametrize("data", [b"", b"not a model", small_network()[:-300]])
def test_damaged_model_is_a_bundle_error(data: bytes) -> None:
    with pytest.raises(BundleError, match="refused the network"):
        NetworkEngine(data, threads=1)


def test_external_weights_are_refused(tmp_path: Path) -> None:
    secret = tmp_path / "secret.bin"
    secret.write_bytes(bytes(65536))
    model = onnx.load_from_string(small_network())
    weight = model.graph.initializer[0]
    weight.ClearField("raw_data")
    weight.data_location = onnx.TensorProto.EXTERNAL
    weight.external_data.add(key="location", value=str(secret))
    with pytest.raises(BundleError, match="refused the network"):
        NetworkEngine(model.SerializeToString(), threads=1)


def test_other_names_are_a_bundle_error() -> None:
    with pytest.raises(BundleError, match='one float "input"'):
        NetworkEngine(small_network(input_name="picture"), threads=1)


@pytest.mark.parametrize(
    "shape",
    [[1, "channels", "height", "width"], [2, 6, "height", "width"], [6, "height", "width"]],
)
def test_tensors_that_are_no_planes_of_stated_channels_are_a_bundle_error(
    shape: list[int | str],
) -> None:
    values = [
        helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, shape)
        for name in ("input", "output")
    ]
    node = helper.make_node("Identity", ["input"], ["output"])
    graph = helper.make_graph([node], "copy", values[:1], values[1:])
    model = helper.make_model(graph, ir_version=10, opset_imports=[helper.make_opsetid("", 20)])
    with pytest.raises(BundleError, match=r"maps \(1, channels, h, w\) .* channels stated"):
        NetworkEngine(model.SerializeToString(), threads=1)


def test_old_onnxruntime_is_unsupported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(engine_module.ort, "__version__", "1.23.2")
    with pytest.raises(UnsupportedError, match=r">= 1\.24\.1 is needed; got 1\.23\.2"):
        NetworkEngine(small_network(), threads=1)


def test_threads_are_never_more_than_requested_or_granted(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(engine_module, "_CGROUP", tmp_path)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    assert available_threads() == 8
    assert available_threads(3) == 3
    assert available_threads(99) == 8
    (tmp_path / "cpu.max").write_text("250000 100000\n")
    assert available_threads() == 3
    (tmp_path / "cpu.max").write_text("max 100000\n")
    assert available_threads() == 8
    (tmp_path / "cpu.max").unlink()
    (tmp_path / "cpu").mkdir()
    (tmp_path / "cpu" / "cpu.cfs_quota_us").write_text("100000\n")
    (tmp_path / "cpu" / "cpu.cfs_period_us").write_text("100000\n")
    assert available_threads() == 1


@pytest.mark.parametrize("threads", [0, -1])
def test_no_threads_are_refused(threads: int) -> None:
    with pytest.raises(ContractError, match="threads must be >= 1"):
        available_threads(threads)
    with pytest.raises(ContractError, match="threads and scale must be >= 1"):
        NetworkEngine(small_network(), threads=threads)


def test_largest_activations_are_those_of_the_tensors() -> None:
    windows = [_window(seed=1), -3 * _window(seed=2)]
    engine = NetworkEngine(small_network(), threads=1)
    expected = max(float(np.abs(engine.run(w)).max()) for w in windows)
    found = largest_activations(small_network(), ("output",), windows)
    assert found == {"output": pytest.approx(expected, rel=1e-6)}


def _fresh(code: str, home: Path) -> subprocess.CompletedProcess[str]:
    environment = {k: v for k, v in os.environ.items() if k != "ORT_DISABLE_TELEMETRY"}
    environment.update(HOME=str(home), XDG_CACHE_HOME=str(home / "cache"))
    return subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )


def test_telemetry_is_off_and_nothing_is_written_at_home(tmp_path: Path) -> None:
    code = "import os, camkit.runtime.network.engine; print(os.environ['ORT_DISABLE_TELEMETRY'])"
    assert _fresh(code, tmp_path).stdout.strip() == "1"
    assert not [p for p in tmp_path.rglob("*") if p.is_file()]


def test_onnxruntime_imported_before_camkit_is_told(tmp_path: Path) -> None:
    stand_in = (
        "import sys, types, logging; logging.basicConfig()\n"
        "for name in ('', '.capi', '.capi.onnxruntime_pybind11_state'):\n"
        "    module = types.ModuleType('onnxruntime' + name)\n"
        "    module.__path__, module.__getattr__ = [], lambda _: ValueError\n"
        "    sys.modules['onnxruntime' + name] = module\n"
        "sys.modules['onnxruntime.capi'].onnxruntime_pybind11_state = module\n"
    )
    told = "onnxruntime was imported before camkit first loaded a bundle"
    assert told in _fresh(stand_in + "import camkit.runtime.network.engine", tmp_path).stderr
    assert told not in _fresh("import camkit.runtime.network.engine", tmp_path).stderr


def test_providers_that_are_not_built_in_are_refused_with_those_that_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(engine_module, "providers", lambda: ("CPUExecutionProvider",))
    with pytest.raises(UnsupportedError, match="computes on cpu; got 'cuda'"):
        NetworkEngine(small_network(), threads=1, provider="cuda")


def test_a_card_is_named_as_onnxruntime_lists_it(monkeypatch: pytest.MonkeyPatch) -> None:
    card = SimpleNamespace(vendor="NVIDIA", device_id=0x2335)
    listed = [SimpleNamespace(ep_name="CUDAExecutionProvider", device=card)]
    monkeypatch.setattr(engine_module.ort, "get_ep_devices", lambda: listed, raising=False)
    library = f"onnxruntime {engine_module.ort.__version__}"
    assert engine_module.device_and_library("cuda") == ("NVIDIA device 0x2335", library)
    assert engine_module.device_and_library("tensorrt") == ("device 0", library)


def test_a_provider_that_does_not_start_is_an_error_and_no_silent_cpu(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: list[object] = []

    class OnCpu:
        def __init__(self, model: bytes, options: object, providers: list[object]) -> None:
            asked.extend(providers)

        def get_providers(self) -> list[str]:
            return ["CPUExecutionProvider"]

    names = ("TensorrtExecutionProvider", "CUDAExecutionProvider", "CPUExecutionProvider")
    monkeypatch.setattr(engine_module, "providers", lambda: names)
    monkeypatch.setattr(engine_module.ort, "InferenceSession", OnCpu)
    with pytest.raises(UnsupportedError, match="tensorrt, but it does not start"):
        NetworkEngine(small_network(), threads=1, provider="tensorrt")
    # what the first provider does not know falls to the next, in true float32
    cuda = ("CUDAExecutionProvider", {"use_tf32": "0"})
    assert asked == ["TensorrtExecutionProvider", cuda, "CPUExecutionProvider"]


@pytest.mark.parametrize("scale", [1, 2, 3])
@pytest.mark.parametrize(("channels", "outputs"), [(1, 1), (6, 3), (4, 5)])
def test_any_channels_and_scale_run_and_land_in_the_given_buffer(
    channels: int, outputs: int, scale: int
) -> None:
    engine = NetworkEngine(finer_network(channels, outputs, scale=scale), threads=1, scale=scale)
    assert (engine.channels, engine.outputs, engine.scale) == (channels, outputs, scale)
    window = np.random.default_rng(0).random((1, channels, 16, 24)).astype(np.float32)
    out = np.full((1, outputs, 16 * scale, 24 * scale), np.nan, np.float32)
    assert engine.run(window, out) is out
    assert np.isfinite(out).all()
    assert np.array_equal(out, engine.run(window))
    with pytest.raises(ContractError, match="out must be"):
        engine.run(window, np.empty((1, outputs, 16 * scale + 1, 24 * scale), np.float32))
    with pytest.raises(ContractError, match=rf"window must be float32 \(1, {channels}, h, w\)"):
        engine.run(np.zeros((1, channels + 1, 16, 24), np.float32))


def test_a_scale_that_the_network_does_not_have_is_refused_at_its_first_window() -> None:
    engine = NetworkEngine(finer_network(1, 1, scale=2), threads=1, scale=1)
    with pytest.raises(ContractError, match="cannot run on a window"):
        engine.run(np.zeros((1, 1, 16, 24), np.float32))
    with pytest.raises(ContractError, match="threads and scale must be >= 1"):
        NetworkEngine(finer_network(1, 1), threads=1, scale=0)


def test_a_finer_output_is_what_the_nodes_say() -> None:
    """DepthToSpace puts the samples of a pixel where it lies, row by row."""
    model = finer_model(1, 1, scale=2)
    picture = np.zeros((1, 1, 32, 32), np.float32)
    picture[0, 0, 16, 20] = 1
    made = NetworkEngine(model.SerializeToString(), threads=1, scale=2).run(picture)[0, 0]
    rows, columns = np.nonzero(made > 1e-6)
    assert 32 - 8 <= rows.min() <= 32 <= rows.max() <= 33 + 8
    assert 40 - 8 <= columns.min() <= 40 <= columns.max() <= 41 + 8
