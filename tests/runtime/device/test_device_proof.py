"""A provider computes what the bundle says, or no capture at all; the CPU plays the device."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import camkit
from camkit.arrays import FloatArray
from camkit.bundle.golden import GoldenArrays, golden_to_bytes
from camkit.bundle.reader import open_bundle
from camkit.bundle.writer import write_bundle
from camkit.errors import ParityError, UnsupportedError
from camkit.runtime.device import device_proof as proof_module
from camkit.runtime.device.case_results import Agreement
from camkit.runtime.device.device_proof import LEAST_DB, DeviceProof
from camkit.runtime.network import engine as engine_module
from camkit.runtime.proof.golden_run import case_work
from tests.bundle_factory import tiny_golden, tiny_manifest, tiny_members, write_tiny_bundle
from tests.capture_factory import write_tiny_captures

Fault = Callable[[FloatArray], None]


@pytest.fixture(autouse=True)
def _stand_in(monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace a graphics card by onnxruntime's CPU; nothing is proved yet."""
    create = engine_module._create_session

    def on_cpu(model: bytes, threads: int, provider: str = "cpu", **memory: Any) -> Any:
        engine_module._chosen_providers(provider)
        return create(model, threads, **memory)

    names = ("CUDAExecutionProvider", "CPUExecutionProvider")
    monkeypatch.setattr(engine_module, "providers", lambda: names)
    monkeypatch.setattr(engine_module, "_create_session", on_cpu)
    monkeypatch.setattr(proof_module, "_PROOFS", {})


@pytest.fixture
def fault(monkeypatch: pytest.MonkeyPatch) -> Callable[[Fault], None]:
    """Return what makes the device compute wrongly; the CPU goes on as it is."""
    run = engine_module.NetworkEngine._run_bound

    def spoil(change: Fault) -> None:
        def wrong(self: Any, window: FloatArray, out: FloatArray, cancel: Any) -> None:
            run(self, window, out, cancel)
            if self.provider != "cpu":
                change(out)

        monkeypatch.setattr(engine_module.NetworkEngine, "_run_bound", wrong)

    return spoil


def _golden_bundle(folder: Path, *, error: float = 0.0) -> Path:
    """Write the tiny bundle with the result of its golden case, which is off by an error."""
    bundle = open_bundle(write_tiny_bundle(folder))
    (case,) = bundle.manifest.golden
    given = tiny_golden()[case.name]
    picture = case_work(bundle, case, given, "M").fill() + np.float32(error)
    case_arrays = GoldenArrays(
        capture=given.capture, reference=given.reference, outputs={"image": {"M": picture}}
    )
    members = tiny_members() | {"golden.safetensors": golden_to_bytes({case.name: case_arrays})}
    path = folder / "golden.camkit"
    write_bundle(path, tiny_manifest(), members)
    return path


def test_a_device_that_agrees_proves_itself_once_and_the_sidecar_says_what(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pipeline = camkit.load(_golden_bundle(tmp_path), provider="cuda", threads=1)
    proof = pipeline.proof()
    assert proof is not None
    assert proof["golden"][0]["what"] == "golden case typical, image of size M"
    assert [one["psnr_db"] for one in (*proof["cpu"], *proof["tiles"])] == [None, None]
    assert proof["verdict"].startswith("size M in fp32 on cuda (device 0, onnxruntime ")
    assert proof["note"] is None

    write_tiny_captures(tmp_path, ["a"])
    monkeypatch.setattr(proof_module, "_compare", None)  # a batch proves nothing again
    results = camkit.process(
        [str(tmp_path / "*.dng")],
        bundle=str(pipeline.bundle.path),  # type: ignore[union-attr]
        out_dir=tmp_path / "out",
        provider="cuda",
        force_bundle=True,
        threads=1,
    )
    assert [result.status for result in results] == ["ok"], results
    sidecar = json.loads((tmp_path / "out" / "a.camkit.json").read_text())
    assert sidecar["plan"]["network"]["proof"]["M"] == json.loads(json.dumps(proof))


def _shift(out: FloatArray) -> None:
    out += 0.01


def _border(out: FloatArray) -> None:
    out[..., -1] += np.float32(0.01)


def _overflow(out: FloatArray) -> None:
    out[..., 3, 5] = np.nan


@pytest.mark.parametrize("change", [_shift, _border, _overflow])
def test_a_device_that_computes_wrongly_is_refused_before_any_capture(
    change: Fault, fault: Callable[[Fault], None], tmp_path: Path
) -> None:
    fault(change)
    expected = r'cuda .* does not compute tiny as stated.* dB\), allowed is .*provider="cpu"'
    path = _golden_bundle(tmp_path)
    for _ in range(2):
        with pytest.raises(ParityError, match=expected):
            camkit.load(path, provider="cuda", threads=1)
    assert camkit.load(path, threads=1).proof() is None


def test_an_error_of_windows_alone_is_found_by_the_tiles(
    fault: Callable[[Fault], None], tmp_path: Path
) -> None:
    def narrow(out: FloatArray) -> None:
        if out.shape[3] == 72:  # a tile of 64 px with its halo
            out += 0.01

    fault(narrow)
    path = _golden_bundle(tmp_path)
    with pytest.raises(ParityError, match=r"in tiles beside whole differs by 0\.01"):
        camkit.load(path, provider="cuda", threads=1)


def test_a_golden_case_that_does_not_come_out_is_refused_by_name(tmp_path: Path) -> None:
    path = _golden_bundle(tmp_path, error=0.05)
    with pytest.raises(ParityError, match=r"golden case typical, image of size M differs by 0\.05"):
        camkit.load(path, provider="cuda", threads=1)


def test_a_provider_that_is_not_there_is_refused_with_those_that_are(tmp_path: Path) -> None:
    path = write_tiny_bundle(tmp_path)
    with pytest.raises(UnsupportedError, match=r"computes on cpu, cuda.*; got 'tensorrt'"):
        camkit.load(path, provider="tensorrt", threads=1)


@pytest.mark.parametrize(("psnr_db", "is_refused"), [(LEAST_DB + 15, False), (LEAST_DB - 1, True)])
def test_sixteen_bits_state_their_db_and_are_refused_below_the_least(
    psnr_db: float, is_refused: bool
) -> None:
    far = Agreement(what="golden case", difference=0.02, allowed=0.001, psnr_db=psnr_db)
    near = Agreement(what="network", difference=0.0, allowed=0.001, psnr_db=np.inf)
    proof = DeviceProof(
        provider="openvino",
        device="CPU",
        library="openvino 1",
        dtype="bf16",
        size="M",
        golden=(far,),
        cpu=(near,),
        tiles=(near,),
    )
    assert bool(proof.refused) is is_refused
    assert f"{psnr_db:.1f} dB from them" in (proof.note or "")
