"""The layers of a check that run something: golden cases, exact tiling, range of activations.

Each gives (True, what was shown), or (False, why there was nothing to show), and raises when the
bundle does not keep its word.
"""

import math
from collections.abc import Iterator
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.reader import Bundle, is_built_in
from camkit.errors import ParityError
from camkit.runtime.device.case_results import GoldenRun, case_results, golden_arrays
from camkit.runtime.device.tile_windows import (
    SEED,
    compared_layouts,
    continued,
    infer,
    network_windows,
    noise_planes,
    picture_px,
    tiles_px,
)
from camkit.runtime.machine.limits import PROOF_MB, PROOF_WORK
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.graph_walk import GraphFacts
from camkit.runtime.network.probe import perturbation_reach, probe_runs
from camkit.runtime.network.ranges import FP16_LIMIT, fits_fp16, node_activations
from camkit.runtime.proof.haze_band import prove_haze
from camkit.runtime.proof.one_window import prove_one_window

_SAMPLES: Final = 2
"""Pictures on which tiled is compared with whole: a golden case, and noise."""
# Activations of the same input on another processor differ by rounding only.
_RANGE_RTOL: Final = 1e-3

Result = tuple[bool, str]


def prove_golden(bundle: Bundle, *, run: GoldenRun | None) -> Result:
    """Compute the golden cases again.

    Args:
        bundle: The bundle.
        run: The whole pipeline, or None to prove nothing.

    Raises:
        BundleError: If manifest and golden.safetensors hold other cases, or the case of the haze
            is not of this bundle.
        ParityError: If a result is further from the stored one than its case allows.
    """
    coarse = prove_haze(bundle) if bundle.manifest.has_haze else None
    is_proved, what = _prove_cases(bundle, run)
    if coarse is None:
        return is_proved, what
    return True, f"{coarse}; {what}"


def _prove_cases(bundle: Bundle, run: GoldenRun | None) -> Result:
    """Compute the captures of the cases again; see `prove_golden`."""
    if not bundle.manifest.golden:
        return False, "no golden case"
    golden_arrays(bundle)
    if run is None:
        return False, "nothing to compare: no pipeline was given"
    shares = []
    for result in case_results(bundle, run, tuple(bundle.manifest.sizes) or (None,)):
        if not result.holds:
            raise ParityError(
                f"{result.what}: differs from the stored result by {result.difference:.3g}, "
                f"allowed is {result.allowed:.3g}; the bundle or a library under it changed"
            )
        shares.append(result.share)
    if not shares:
        return False, "nothing to compare: no output is stored"
    return True, f"{len(shares)} results, worst at {max(shares):.3g} of what is allowed"


def prove_tiling(bundle: Bundle, *, run: GoldenRun | None, threads: int) -> Result:
    """Check for every network that tiled equals whole and that its reach is as stated.

    Raises:
        ParityError: If a single bit differs, a pixel acts further than stated, or a network that
            sees the whole picture would have to be tiled.
        BundleError: If the proof would take more memory or work than is admitted.
    """
    notes = []
    for role, size, facts in _networks(bundle):
        what = _name(bundle, role, size)
        if facts.global_operators:
            notes.append(f"{what}: {prove_one_window(bundle, role, size)}")
            continue
        _admit_tiling(inspect_graph(bundle.network_bytes(role, size)), facts, what)
        engine = _engine(bundle, role, size, threads)
        samples = [next(network_windows(bundle, role, size, run)), noise_planes(facts)]
        count = sum(_prove_equal(engine, facts, sample, what) for sample in samples)
        probe = perturbation_reach(
            engine.run,
            _probe_px(facts),
            np.random.default_rng(SEED),
            stride_px=facts.stride_px,
            channels=facts.input_channels,
            scale=facts.output_scale,
        )
        if probe.halo_px > facts.reach_px:
            raise ParityError(
                f"size {what}: a pixel acts {probe.halo_px} px far, the manifest says "
                f"{facts.reach_px}; export the bundle again"
            )
        notes.append(
            f"{what}: {count} windows equal the whole, halo {facts.reach_px} px "
            f"(probe {probe.halo_px})"
        )
    return bool(notes), "; ".join(notes) or "no network"


def _networks(bundle: Bundle) -> Iterator[tuple[str, str, NetworkFacts]]:
    for role, sizes in bundle.manifest.networks.items():
        for size, facts in sizes.items():
            yield role, size, facts


def _name(bundle: Bundle, role: str, size: str) -> str:
    return size if len(bundle.manifest.networks) == 1 else f"{size} ({role})"


def _engine(bundle: Bundle, role: str, size: str, threads: int) -> NetworkEngine:
    scale, data = bundle.network_facts(role, size).output_scale, bundle.network_bytes(role, size)
    block_bytes = None if is_built_in(bundle) else inspect_graph(data).block_bytes_per_pixel
    return NetworkEngine(data, threads=threads, scale=scale, block_bytes=block_bytes)


def _admit_tiling(graph: GraphFacts, facts: NetworkFacts, what: str) -> None:
    """Refuse a proof of tiling that would take too much."""
    ends = 4 * (facts.input_channels + 4 * facts.output_channels * facts.output_scale**2)
    probe_px = _probe_px(facts) ** 2
    pictures = [math.prod(picture_px(facts, tile)) for tile in tiles_px(facts.stride_px)]
    proof = f"proving that size {what} of the network is tiled exactly"
    pixel_bytes = max(graph.bytes_per_pixel, graph.block_bytes_per_pixel) + ends
    PROOF_MB.check(max(*pictures, probe_px) * pixel_bytes / 1e6, proof)
    runs_px = probe_runs(facts.stride_px) * probe_px
    for tiled, whole in compared_layouts(facts):
        area = tiled.height_px * tiled.width_px
        runs_px += _SAMPLES * round(area * (tiled.work_ratio + whole.work_ratio))
    PROOF_WORK.check(runs_px * (graph.work_per_pixel + 1), proof)


def _prove_equal(engine: NetworkEngine, facts: NetworkFacts, sample: FloatArray, what: str) -> int:
    """Compare tiled with whole at every side of a tile; return the compared windows."""
    count = 0
    for tiled, whole in compared_layouts(facts):
        picture = continued(sample, whole)
        difference = infer(engine, picture, tiled) - infer(engine, picture, whole)
        if difference.any():
            window = f"{tiled.window_width_px}x{tiled.window_height_px}"
            raise ParityError(
                f"size {what}: tiled differs from whole by up to {np.abs(difference).max():.3g} "
                f"with windows of {window} px and a halo of {tiled.halo_px} px; exact tiling is "
                "not kept"
            )
        count += tiled.window_count
    return count


def _probe_px(facts: NetworkFacts) -> int:
    """Return a window with room for the reach on both sides of the probed cell."""
    stride = facts.stride_px
    return max(4, 2 * (math.ceil(facts.reach_px / stride) + 2)) * stride


def prove_range(bundle: Bundle, *, run: GoldenRun | None) -> Result:
    """Measure activations again and hold them against the manifest and the range of fp16.

    Raises:
        ParityError: If activations on the golden cases exceed the stated ones, or fp16 is
            claimed beyond its range.
        BundleError: If the proof would take more memory than is admitted.
    """
    notes = []
    for role, size, facts in _networks(bundle):
        what = _name(bundle, role, size)
        windows = [window[None] for window in network_windows(bundle, role, size, run)]
        graph = inspect_graph(bundle.network_bytes(role, size))
        area = max(math.prod(window.shape[2:]) for window in windows)
        PROOF_MB.check(4e-6 * area * graph.values_per_pixel, f"measuring the range of size {what}")
        activations = node_activations(bundle.network_bytes(role, size), windows)
        largest = max(activations.values())
        if not math.isfinite(largest):
            raise ParityError(f"size {what}: activations are not finite")
        is_comparable = run is not None and bundle.manifest.golden
        if is_comparable and largest > facts.max_activation * (1 + _RANGE_RTOL):
            raise ParityError(
                f"size {what}: activations reach {largest:.4g} on the golden cases, the manifest "
                f"says {facts.max_activation:.4g}; export the bundle again"
            )
        limits = facts.node_activation | {"stated": facts.max_activation}
        if facts.fp16_safe and not fits_fp16(activations | limits, headroom=facts.fp16_headroom):
            raise ParityError(
                f"size {what}: fp16 is claimed, but {max(largest, *limits.values()):.4g} x "
                f"{facts.fp16_headroom:g} is not below {FP16_LIMIT:g}"
            )
        safe = "fp16 safe" if facts.fp16_safe else "fp32 only"
        notes.append(f"{what}: at most {largest:.4g}, {safe}")
    return bool(notes), "; ".join(notes) or "no network"
