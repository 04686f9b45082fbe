"""The layers of a check that run something: golden cases, exact tiling, range of activations.

Each gives (True, what was shown), or (False, why there was nothing to show), and raises when the
bundle does not keep its word.
"""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.bundle.golden import GoldenArrays, golden_from_bytes
from camkit.bundle.manifest import GoldenCase, Network, NetworkFacts
from camkit.bundle.reader import GOLDEN, Bundle
from camkit.contracts import FloatArray
from camkit.errors import BundleError, ParityError
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.probe import perturbation_reach
from camkit.runtime.network.ranges import FP16_LIMIT, fits_fp16, node_activations
from camkit.runtime.network.tiling import TileLimits, TilePlan, infer_bands, plan_windows
from camkit.runtime.rows import ArrayRows

_SEED: Final = 7
_TILE_PX: Final = 64
_SYNTHETIC_PX: Final = 96
# Activations of the same input on another processor differ by rounding only.
_RANGE_RTOL: Final = 1e-3

Result = tuple[bool, str]


def prove_golden(
    bundle: Bundle,
    *,
    run: Callable[[Bundle, GoldenCase, GoldenArrays, str], FloatArray] | None,
    threads: int,
) -> Result:
    """Compute the golden cases again.

    Args:
        bundle: The bundle.
        run: The whole pipeline, or None to run the stored network inputs only.
        threads: Threads per run of a network.

    Raises:
        BundleError: If manifest and golden.safetensors hold other cases.
        ParityError: If a result is further from the stored one than its case allows.
    """
    cases = {case.name: case for case in bundle.manifest.golden}
    if not cases:
        return False, "no golden case"
    arrays = golden_from_bytes(bundle.member(GOLDEN))
    if arrays.keys() != cases.keys():
        raise BundleError(
            f"the manifest has the golden cases {', '.join(sorted(cases))}; "
            f"{GOLDEN} has {', '.join(sorted(arrays))}"
        )
    worst, compared = 0.0, 0
    for size in bundle.manifest.networks:
        engine = NetworkEngine(bundle.network_bytes(size), threads=threads)
        for name, case in cases.items():
            for got, stored in _golden_pairs(bundle, case, arrays[name], size, run, engine):
                worst = max(worst, _compare(got, stored, case, size))
                compared += 1
    if not compared:
        return False, "nothing to compare: no stored network input, and no pipeline was given"
    return True, f"{compared} results, worst at {worst:.3g} of what is allowed"


def _golden_pairs(
    bundle: Bundle,
    case: GoldenCase,
    arrays: GoldenArrays,
    size: str,
    run: Callable[[Bundle, GoldenCase, GoldenArrays, str], FloatArray] | None,
    engine: NetworkEngine,
) -> list[tuple[FloatArray, FloatArray]]:
    """Give (computed, stored) for the network alone and for the whole pipeline."""
    pairs = []
    if arrays.network_input is not None and size in arrays.network_outputs:
        got = engine.run(np.ascontiguousarray(arrays.network_input[None]))[0]
        pairs.append((got, arrays.network_outputs[size]))
    if run is not None and size in arrays.outputs:
        pairs.append((run(bundle, case, arrays, size), arrays.outputs[size]))
    return pairs


def _compare(got: FloatArray, stored: FloatArray, case: GoldenCase, size: str) -> float:
    """Give the largest difference as a share of what is allowed."""
    where = f"golden case {case.name}, size {size}"
    if got.shape != stored.shape:
        raise ParityError(f"{where}: computed {got.shape}, stored {stored.shape}")
    allowed = case.atol + case.rtol * max(1.0, float(np.abs(stored).max()))
    difference = float(np.abs(got - stored).max())
    if not difference <= allowed:
        raise ParityError(
            f"{where}: differs from the stored result by {difference:.3g}, allowed is "
            f"{allowed:.3g}; the bundle or a library under it changed"
        )
    return difference / allowed if allowed else 0.0


def prove_tiling(bundle: Bundle, *, threads: int) -> Result:
    """Show for every network that tiled equals whole and that its reach is what it says.

    Raises:
        ParityError: If a single bit differs, or a pixel acts further than stated.
    """
    notes = []
    for size, facts in bundle.manifest.networks.items():
        if facts.global_operators:
            notes.append(f"{size}: cannot be tiled ({', '.join(facts.global_operators)})")
            continue
        engine = NetworkEngine(bundle.network_bytes(size), threads=threads)
        count = _prove_equal(engine, facts, _windows(bundle, size)[0], size)
        probe = perturbation_reach(
            engine.run,
            _probe_px(facts),
            np.random.default_rng(_SEED),
            stride_px=facts.stride_px,
            channels=facts.input_channels,
        )
        if probe.halo_px > facts.reach_px:
            raise ParityError(
                f"size {size}: a pixel acts {probe.halo_px} px far, the manifest says "
                f"{facts.reach_px}; export the bundle again"
            )
        notes.append(
            f"{size}: {count} windows equal the whole, halo {facts.reach_px} px "
            f"(probe {probe.halo_px})"
        )
    return bool(notes), "; ".join(notes) or "no network"


def _prove_equal(engine: NetworkEngine, facts: NetworkFacts, sample: FloatArray, size: str) -> int:
    """Compare tiled with whole on a picture of odd sides with at least 2 x 2 windows."""
    stride = facts.stride_px
    halo = math.ceil(facts.reach_px / stride) * stride
    height, width = 2 * (halo + _TILE_PX) + stride + 1, 2 * halo + _TILE_PX + 2 * stride + 3
    pads = [(0, 0), (0, max(0, height - sample.shape[1])), (0, max(0, width - sample.shape[2]))]
    picture = np.pad(sample, pads, mode="symmetric")[:, :height, :width]
    limits = TileLimits(stride_px=stride, halo_px=halo, max_bytes=sys.maxsize, whole=True)
    whole = plan_windows(height, width, limits)
    tiled = plan_windows(height, width, replace(limits, whole=False, tile_px=_TILE_PX))
    difference = _infer(engine, picture, tiled) - _infer(engine, picture, whole)
    if difference.any():
        raise ParityError(
            f"size {size}: tiled differs from whole by up to {np.abs(difference).max():.3g} with "
            f"a halo of {halo} px; exact tiling is not kept"
        )
    return tiled.window_count


def _infer(engine: NetworkEngine, picture: FloatArray, plan: TilePlan) -> FloatArray:
    bands = infer_bands(engine.run, ArrayRows(np.ascontiguousarray(picture)), plan)
    return np.concatenate(list(bands), axis=1)


def _probe_px(facts: NetworkFacts) -> int:
    """Give a window with room for the reach on both sides of the probed cell."""
    stride = facts.stride_px
    return max(4, 2 * (math.ceil(facts.reach_px / stride) + 2)) * stride


def prove_range(bundle: Bundle) -> Result:
    """Measure activations again and hold them against the manifest and the range of fp16.

    Raises:
        ParityError: If activations on the golden cases exceed the stated ones, or fp16 is
            claimed beyond its range.
    """
    notes = []
    for size, facts in bundle.manifest.networks.items():
        windows = [window[None] for window in _windows(bundle, size)]
        found = node_activations(bundle.network_bytes(size), windows)
        largest = max(found.values())
        if not math.isfinite(largest):
            raise ParityError(f"size {size}: activations are not finite")
        if _has_inputs(bundle) and largest > facts.max_activation * (1 + _RANGE_RTOL):
            raise ParityError(
                f"size {size}: activations reach {largest:.4g} on the golden cases, the manifest "
                f"says {facts.max_activation:.4g}; export the bundle again"
            )
        stated = facts.node_activation | {"stated": facts.max_activation}
        if facts.fp16_safe and not fits_fp16(found | stated, headroom=facts.fp16_headroom):
            raise ParityError(
                f"size {size}: fp16 is claimed, but {max(largest, *stated.values()):.4g} x "
                f"{facts.fp16_headroom:g} is not below {FP16_LIMIT:g}"
            )
        safe = "fp16 safe" if facts.fp16_safe else "fp32 only"
        notes.append(f"{size}: at most {largest:.4g}, {safe}")
    return bool(notes), "; ".join(notes) or "no network"


def _has_inputs(bundle: Bundle) -> bool:
    return any(case.network_input is not None for case in _golden(bundle).values())


def _golden(bundle: Bundle) -> dict[str, GoldenArrays]:
    return golden_from_bytes(bundle.member(GOLDEN)) if GOLDEN in bundle.names else {}


def _windows(bundle: Bundle, size: str) -> list[FloatArray]:
    """Give network inputs: the stored ones, else noise over the whole range of the sensor."""
    facts = bundle.network_facts(size)
    stored = [
        np.ascontiguousarray(_whole_cells(case.network_input, facts.stride_px))
        for case in _golden(bundle).values()
        if case.network_input is not None
    ]
    if stored:
        return stored
    stage = bundle.manifest.stage(Network) or Network()
    noise = bundle.manifest.camera.noise_at(bundle.manifest.camera.noise[0].iso)
    white = math.sqrt(1 / noise.shot[0]) / stage.scale
    side = math.ceil(_SYNTHETIC_PX / facts.stride_px) * facts.stride_px
    rng = np.random.default_rng(_SEED)
    planes = rng.random((facts.input_channels, side, side), dtype=np.float32)
    return [np.float32(white) * planes]


def _whole_cells(planes: FloatArray, stride: int) -> FloatArray:
    """Cut planes to multiples of the stride."""
    _, height, width = planes.shape
    return planes[:, : height // stride * stride, : width // stride * stride]
