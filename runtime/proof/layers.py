"""The layers of a check that run something: golden cases, exact tiling, range of activations.

Each gives (True, what was shown), or (False, why there was nothing to show), and raises when the
bundle does not keep its word.
"""

import itertools
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.facts import NetworkFacts
from camkit.bundle.golden import NO_SIZE, GoldenArrays, golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, Bundle, is_built_in
from camkit.errors import BundleError, ParityError
from camkit.progress import counted
from camkit.runtime.machine.limits import PROOF_MB, PROOF_WORK
from camkit.runtime.network.engine import NetworkEngine
from camkit.runtime.network.graph import inspect_graph
from camkit.runtime.network.graph_walk import GraphFacts
from camkit.runtime.network.probe import perturbation_reach, probe_runs
from camkit.runtime.network.ranges import FP16_LIMIT, fits_fp16, node_activations
from camkit.runtime.network.tiling import TileLayout, TileLimits, infer_bands, lay_windows
from camkit.runtime.proof.golden_run import GoldenRun
from camkit.runtime.proof.haze_band import prove_haze
from camkit.runtime.proof.one_window import prove_one_window
from camkit.runtime.rows import ArrayRows

_SEED: Final = 7
_TILES_PX: Final = (64, 40, 1)
"""Sides of the tiles tried, whole cells of the stride: an odd number of them but for the first."""
_SYNTHETIC_PX: Final = 96
_SYNTHETIC_MOST: Final = 8.0
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
    cases = {case.name: case for case in bundle.manifest.golden}
    if not cases:
        return False, "no golden case"
    arrays = _golden(bundle)
    if run is None:
        return False, "nothing to compare: no pipeline was given"
    worst, compared = 0.0, 0
    runs = list(itertools.product(bundle.manifest.sizes or (None,), cases.items()))
    for size, (name, case) in counted(runs, "computing golden cases", "cases"):
        for share in _compared(bundle, case, arrays[name], size, run):
            worst = max(worst, share)
            compared += 1
    if not compared:
        return False, "nothing to compare: no output is stored"
    return True, f"{compared} results, worst at {worst:.3g} of what is allowed"


def _compared(
    bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str | None, run: GoldenRun
) -> Iterator[float]:
    """Compute every stored product of a size, and yield its error."""
    for product in arrays.outputs:
        stored = arrays.output(product, size or NO_SIZE)
        if stored is None:
            continue
        where = f"golden case {case.name}, {product} of size {size or NO_SIZE}"
        work = run(bundle, case, arrays, size)
        # Before any work: a product may be stated finer than memory holds.
        if (shape := work.shape_of(product)) != stored.shape:
            raise ParityError(f"{where}: computed {shape}, stored {stored.shape}")
        yield _compare(work.fill(product=product), stored, case, where)


def _compare(got: FloatArray, stored: FloatArray, case: GoldenCase, where: str) -> float:
    """Return the largest difference as a share of what is allowed."""
    allowed = case.atol + case.rtol * max(1.0, float(np.abs(stored).max()))
    difference = float(np.abs(got - stored).max())
    if not difference <= allowed:
        raise ParityError(
            f"{where}: differs from the stored result by {difference:.3g}, allowed is "
            f"{allowed:.3g}; the bundle or a library under it changed"
        )
    return difference / allowed if allowed else 0.0


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
        samples = [_windows(bundle, role, size, run)[0], _noise(facts)]
        count = sum(_prove_equal(engine, facts, sample, what) for sample in samples)
        probe = perturbation_reach(
            engine.run,
            _probe_px(facts),
            np.random.default_rng(_SEED),
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


def _tiles_px(stride: int) -> tuple[int, ...]:
    """Return three sides of tiles on the lattice of a stride.

    Origins of tiles of an odd number of cells, one cell among them, come to lie on every phase of
    a lattice that is twice or four times as coarse: what is exact on multiples of 64 px alone is
    found out.
    """
    first, *others = _TILES_PX
    cells = {math.ceil(first / stride), *(px // stride | 1 for px in others)}
    more = (count for count in range(1, 4) if count not in cells)
    while len(cells) < len(_TILES_PX):
        cells.add(next(more))
    return tuple(count * stride for count in sorted(cells))


def _picture_px(facts: NetworkFacts, tile: int) -> tuple[int, int]:
    """Return odd sides (h, w) that need at least 2 x 2 windows."""
    stride, wide = facts.stride_px, max(_tiles_px(facts.stride_px))
    halo = math.ceil(facts.reach_px / stride) * stride
    return 2 * (halo + tile) + stride + 1, 2 * halo + wide + 2 * stride + 3


def _layouts(facts: NetworkFacts) -> Iterator[tuple[TileLayout, TileLayout]]:
    """Plan the compared windows: tiled and whole, at every side of a tile."""
    limits = TileLimits(
        stride_px=facts.stride_px, halo_px=facts.reach_px, max_bytes=sys.maxsize, whole=True
    )
    for tile in _tiles_px(facts.stride_px):
        size = _picture_px(facts, tile)
        tiled = lay_windows(*size, replace(limits, whole=False, tile_px=tile))
        yield tiled, lay_windows(*size, limits)


def _admit_tiling(graph: GraphFacts, facts: NetworkFacts, what: str) -> None:
    """Refuse a proof of tiling that would take too much."""
    ends = 4 * (facts.input_channels + 4 * facts.output_channels * facts.output_scale**2)
    probe_px = _probe_px(facts) ** 2
    pictures = [math.prod(_picture_px(facts, tile)) for tile in _tiles_px(facts.stride_px)]
    proof = f"proving that size {what} of the network is tiled exactly"
    pixel_bytes = max(graph.bytes_per_pixel, graph.block_bytes_per_pixel) + ends
    PROOF_MB.check(max(*pictures, probe_px) * pixel_bytes / 1e6, proof)
    runs_px = probe_runs(facts.stride_px) * probe_px
    for tiled, whole in _layouts(facts):
        area = tiled.height_px * tiled.width_px
        runs_px += _SAMPLES * round(area * (tiled.work_ratio + whole.work_ratio))
    PROOF_WORK.check(runs_px * (graph.work_per_pixel + 1), proof)


def _prove_equal(engine: NetworkEngine, facts: NetworkFacts, sample: FloatArray, what: str) -> int:
    """Compare tiled with whole at every side of a tile; return the compared windows."""
    count = 0
    for tiled, whole in _layouts(facts):
        height, width = whole.height_px, whole.width_px
        pads = [(0, 0), (0, max(0, height - sample.shape[1])), (0, max(0, width - sample.shape[2]))]
        picture = np.pad(sample, pads, mode="symmetric")[:, :height, :width]
        difference = _infer(engine, picture, tiled) - _infer(engine, picture, whole)
        if difference.any():
            window = f"{tiled.window_width_px}x{tiled.window_height_px}"
            raise ParityError(
                f"size {what}: tiled differs from whole by up to {np.abs(difference).max():.3g} "
                f"with windows of {window} px and a halo of {tiled.halo_px} px; exact tiling is "
                "not kept"
            )
        count += tiled.window_count
    return count


def _infer(engine: NetworkEngine, picture: FloatArray, layout: TileLayout) -> FloatArray:
    rows = ArrayRows(np.ascontiguousarray(picture))
    bands = infer_bands(engine.run, rows, layout, scale=engine.scale)
    return np.concatenate(list(bands), axis=1)


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
        windows = [window[None] for window in _windows(bundle, role, size, run)]
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


def _golden(bundle: Bundle) -> dict[str, GoldenArrays]:
    """Return the arrays of the cases that the manifest lists.

    Raises:
        BundleError: If manifest and golden.safetensors hold other cases.
    """
    arrays = golden_from_bytes(bundle.member(GOLDEN)) if GOLDEN in bundle.names else {}
    names = {case.name for case in bundle.manifest.golden}
    if arrays.keys() != names:
        raise BundleError(
            f"the manifest has the golden cases {', '.join(sorted(names))}; "
            f"{GOLDEN} has {', '.join(sorted(arrays))}"
        )
    return arrays


def _windows(bundle: Bundle, role: str, size: str, run: GoldenRun | None) -> list[FloatArray]:
    """Return inputs of a network: those of the golden captures, else noise."""
    facts = bundle.network_facts(role, size)
    if run is not None and bundle.manifest.golden:
        arrays = _golden(bundle)
        inputs = [
            run(bundle, case, arrays[case.name], size).network_input(role)
            for case in bundle.manifest.golden
        ]
        return [np.ascontiguousarray(_whole_cells(planes, facts.stride_px)) for planes in inputs]
    return [_noise(facts)]


def _noise(facts: NetworkFacts) -> FloatArray:
    """Return noise as the input of a network."""
    side = math.ceil(_SYNTHETIC_PX / facts.stride_px) * facts.stride_px
    rng = np.random.default_rng(_SEED)
    planes = rng.random((facts.input_channels, side, side), dtype=np.float32)
    return np.float32(_SYNTHETIC_MOST) * planes


def _whole_cells(planes: FloatArray, stride: int) -> FloatArray:
    """Cut planes to multiples of the stride; those smaller than a cell are continued to one."""
    missing = [(0, max(0, stride - side)) for side in planes.shape[1:]]
    if any(pad for _, pad in missing):
        planes = np.pad(planes, [(0, 0), *missing], mode="edge")
    _, height, width = planes.shape
    return planes[:, : height // stride * stride, : width // stride * stride]
