"""The proof of one provider on this machine, made once a process.

    golden   the golden cases of the bundle come out again, through the whole pipeline
    cpu      the network gives what it gives in onnxruntime on the CPU
    tiles    a picture in windows is that picture in one window, both computed by the device

The numbers of the CPU are what a bundle was checked with, so it needs no proof. A network in
float32 that fails is refused. In 16 bits it differs by more than the golden cases admit: by how
much is stated, and refused below `LEAST_DB`.
"""

import math
import os
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.caller import option_text
from camkit.errors import ContractError, ParityError
from camkit.runtime.device.case_results import Agreement, GoldenRun, agreement, case_results
from camkit.runtime.device.tile_windows import compared_layouts, continued, infer, network_windows
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.job.setup import Setup
from camkit.runtime.kind import part_of
from camkit.runtime.network.engine import NetworkEngine, device_and_library
from camkit.runtime.options import DEFAULT_MAX_MEM_BYTES, Options

AGREED: Final = 1e-4
"""Most |difference| in float32, of the larger of 1 and the largest |value|. TF32 rounds weights
and input to one part in 2048, which exceeds it."""
LEAST_DB: Final = 40.0
"""Of a network in 16 bits: an error of a hundredth of the brightest."""
_ONE_AT_A_TIME: Final = threading.Lock()
Engines = Callable[[str, str], NetworkEngine]
"""Gives the network of a role and size."""
_CPU: Final = "cpu"
_TF32_ALONE: Final = "tensorrt"
_TF32_VARIABLE: Final = "NVIDIA_TF32_OVERRIDE"
"""It has no option against TF32, which the environment switches off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceProof:
    """The comparisons of one device, and how near it came.

    Attributes:
        provider: What computes the network.
        device: What it computes on.
        library: Its name and version.
        dtype: Precision of the network.
        size: Of the network.
        golden: The golden cases; empty where the bundle stores none, or the rest is refused.
        cpu: Each network beside that of onnxruntime on the CPU.
        tiles: Each network in windows beside whole; empty where it is never tiled, or whole it is
            too large for the memory cap.
    """

    provider: str
    device: str
    library: str
    dtype: str
    size: str
    golden: tuple[Agreement, ...] = ()
    cpu: tuple[Agreement, ...]
    tiles: tuple[Agreement, ...]

    @property
    def refused(self) -> tuple[Agreement, ...]:
        """Return what is too far apart to be computed with."""
        everything = (*self.golden, *self.cpu, *self.tiles)
        if self.dtype == "fp32":
            return tuple(one for one in everything if not one.holds)
        return tuple(one for one in everything if not one.psnr_db >= LEAST_DB)

    @property
    def verdict(self) -> str:
        """Return what was shown, for people."""
        compared = {
            "golden cases": self.golden,
            "the CPU": self.cpu,
            "one window against tiles": self.tiles,
        }
        parts = [f"{name} {_nearness(results)}" for name, results in compared.items() if results]
        text = f"size {self.size} in {self.dtype} on {self.provider}"
        return f"{text} ({self.device}, {self.library}): {', '.join(parts)}"

    @property
    def note(self) -> str | None:
        """Return what the user should know: golden cases that 16 bits do not meet."""
        if all(one.holds for one in self.golden):
            return None
        worst = min(one.psnr_db for one in self.golden)
        return (
            f"{self.dtype} on {self.provider} is not within the tolerance of the golden cases: "
            f"{worst:.1f} dB from them"
        )

    def to_json(self) -> dict[str, Any]:
        """Return plain data, for the sidecar; dB are null where bits are equal."""
        record = {
            name: [_record(one) for one in getattr(self, name)]
            for name in ("golden", "cpu", "tiles")
        }
        facts = {name: getattr(self, name) for name in ("device", "library", "verdict", "note")}
        return {**facts, **record}


_PROOFS: Final[dict[tuple[object, ...], DeviceProof]] = {}
"""Of this process, by bundle, size, provider, precision, device, library, TF32 and memory cap."""


def device_proof(
    bundle: Bundle, size: str, engines: Engines, options: Options, *, threads: int
) -> DeviceProof:
    """Check that a provider computes the networks of a size as the bundle says.

    Args:
        bundle: The camera.
        size: Of its networks.
        engines: The very sessions that will compute pictures.
        options: Their provider, precision and memory cap count.
        threads: Threads to compute with.

    Raises:
        ParityError: If it does not.
    """
    device, library = device_and_library(options.provider)
    what = (bundle.sha256, size, options.provider, options.dtype, device, library)
    key = (*what, os.environ.get(_TF32_VARIABLE), options.max_mem_bytes)
    with _ONE_AT_A_TIME:
        if key not in _PROOFS:
            _PROOFS[key] = _compare(bundle, size, engines, options, threads)
        proof = _PROOFS[key]
    if proof.refused:
        raise ParityError(_refusal(bundle, proof))
    return proof


def _compare(
    bundle: Bundle, size: str, engines: Engines, options: Options, threads: int
) -> DeviceProof:
    """Compute everything that is compared."""
    plain = Options(
        size=size,
        threads=threads,
        provider=options.provider,
        dtype=options.dtype,
        max_mem_bytes=options.max_mem_bytes,
    )
    run = _golden_run(bundle, engines, plain)
    of_cpu, of_tiles = [], []
    for role in bundle.manifest.networks:
        if size in bundle.manifest.networks[role]:
            cpu, tiles = _compare_network(bundle, (role, size), engines(role, size), plain, run)
            of_cpu.append(cpu)
            of_tiles.extend(tiles)
    device, library = device_and_library(options.provider)
    proof = DeviceProof(
        provider=options.provider,
        device=device,
        library=library,
        dtype=options.dtype,
        size=size,
        cpu=tuple(of_cpu),
        tiles=tuple(of_tiles),
    )
    # the guard of tiles would end a golden case by a message of its own
    if proof.refused:
        return proof
    return replace(proof, golden=tuple(case_results(bundle, run, [size])))


def _compare_network(
    bundle: Bundle,
    which: tuple[str, str],
    engine: NetworkEngine,
    options: Options,
    run: GoldenRun,
) -> tuple[Agreement, list[Agreement]]:
    """Return a network beside that of the CPU, and in windows beside whole where memory admits."""
    facts = bundle.network_facts(*which)
    sample = next(network_windows(bundle, *which, run))
    on_cpu = NetworkEngine(
        bundle.network_bytes(*which), threads=engine.threads, scale=facts.output_scale
    )
    window = np.ascontiguousarray(sample[None, : engine.channels])
    where = f"network {which[0]} of size {which[1]}"
    cpu = agreement(
        engine.run(window),
        on_cpu.run(window),
        atol=0.0,
        rtol=AGREED,
        what=f"{where} beside the CPU",
    )
    if facts.global_operators or not math.isfinite(cpu.difference):
        return cpu, []
    *_, (tiled, whole) = compared_layouts(facts)
    whole_bytes = whole.height_px * whole.width_px * facts.bytes_per_pixel
    if whole_bytes > (options.max_mem_bytes or DEFAULT_MAX_MEM_BYTES):
        return cpu, []
    picture = continued(sample, whole)[: engine.channels]
    parts = [infer(engine, picture, layout) for layout in (tiled, whole)]
    return cpu, [agreement(*parts, atol=0.0, rtol=AGREED, what=f"{where} in tiles beside whole")]


def _golden_run(bundle: Bundle, engines: Engines, options: Options) -> GoldenRun:
    """Return the pipeline of golden captures on these networks."""
    part = part_of(bundle.manifest)

    def no_speed(_: object) -> Any:
        raise ContractError("nothing is timed while a device is proved")

    def run(_: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str | None) -> Reconstruction:
        setup = Setup(
            bundle=bundle,
            options=replace(options, size=size),
            networks=engines,
            speed=no_speed,
            threads=options.threads or 1,
            usual_stages=tuple(part.stages),
            usual_products=part.products,
        )
        capture = part.from_array(
            np.ascontiguousarray(arrays.capture),
            bundle.manifest,
            iso=case.iso,
            white_balance=case.white_balance,
            origin_px=case.origin_px,
            options=options,
        )
        return Reconstruction(setup, capture, know=part.know)

    return run


def _nearness(results: tuple[Agreement, ...]) -> str:
    if all(one.difference == 0 for one in results):
        return "equal bit for bit"
    worst = max(results, key=lambda one: one.share)
    least_db = min(one.psnr_db for one in results)
    return f"at {worst.share:.2g} of the allowed difference ({least_db:.1f} dB)"


def _record(one: Agreement) -> Mapping[str, Any]:
    psnr_db = None if one.difference == 0 else round(one.psnr_db, 2)
    return {
        "what": one.what,
        "difference": one.difference,
        "allowed": one.allowed,
        "psnr_db": psnr_db,
    }


def _refusal(bundle: Bundle, proof: DeviceProof) -> str:
    """Return why a device is refused."""
    worst = min(proof.refused, key=lambda one: one.psnr_db)
    bound = f"allowed is {worst.allowed:.3g}"
    if proof.dtype != "fp32":
        bound = f"{LEAST_DB:g} dB are needed"
    advice = f"use {option_text('provider', _CPU)}"
    if proof.provider == _TF32_ALONE:
        advice += f" or set {_TF32_VARIABLE}=0, since TensorRT may round to TF32"
    return (
        f"{proof.provider} ({proof.device}, {proof.library}) does not compute "
        f"{bundle.manifest.name} as stated in {len(proof.refused)} comparisons: {worst.what} "
        f"differs by {worst.difference:.3g} ({worst.psnr_db:.1f} dB), {bound}; {advice}"
    )
