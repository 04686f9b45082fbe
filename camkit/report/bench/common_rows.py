"""The rows that serve every camera: its networks, methods without them, no restoration at all.

network     sizes, modes, precisions, providers, threads and tiles
classical   the methods without networks, such as the classical ones on blocks and PSFs
physics     what a bundle restores by its optics alone, where a stage knows that as a method
develop     the other stages alone: the floor of time and quality
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.facts import NetworkFacts
from camkit.report.bench.part import RowMaker
from camkit.report.bench.trial import (
    AXIS_VALUES,
    BASE_SIZE,
    Axes,
    Entrant,
    Ground,
    Skip,
    Trial,
    Vary,
    plain_trial,
    spread_out,
)
from camkit.runtime.kind import part_of
from camkit.runtime.network.engine import OPENVINO
from camkit.runtime.network.openvino_session import missing_bfloat16
from camkit.runtime.plan.decision import DEVELOP, Work
from camkit.runtime.plan.ways import offered_methods, planned
from camkit.runtime.stage_finder import all_methods, stage_module

TrialsAndSkips = tuple[list[Trial], list[Skip]]
DNG: Final = ".dng"
PHYSICS: Final = "physics"
"""`camkit process --method physics`: a solve without the network behind it."""
NET: Final[tuple[str, ...]] = stage_module("network").METHODS
NO_STAGE: Final = "no stage of the bundle has this method"
WHOLE_SHARE: Final = 0.7
"""Of the free memory that one window over the whole picture may take."""


def _without_networks(entrant: Entrant, axes: Axes, ground: Ground) -> TrialsAndSkips:
    """Return every method once, on the first number of threads asked for."""
    if entrant.is_reference:
        return [], []
    stages = entrant.bundle.manifest.stages
    methods = [
        method
        for method in _methods_of(entrant)
        if method not in (DEVELOP, PHYSICS) and not planned(stages, Work(method=method)).networks
    ]
    requested = [method for method in methods if axes.methods is None or method in axes.methods]
    lacking = [m for m in axes.methods or () if m in CLASSICAL.methods and m not in methods]
    return (
        [plain_trial(entrant, axes, ground, CLASSICAL.name, method) for method in requested],
        [Skip(f"{entrant.label} {method}", NO_STAGE) for method in lacking],
    )


def _physics(entrant: Entrant, axes: Axes, ground: Ground) -> TrialsAndSkips:
    return _one_method(entrant, axes, ground, PHYSICS, NO_STAGE)


def _develop(entrant: Entrant, axes: Axes, ground: Ground) -> TrialsAndSkips:
    """Return one trial; captures that are DNG need no bundle to be developed."""
    if not entrant.is_reference and DNG in part_of(entrant.bundle.manifest).suffixes:
        return [replace(plain_trial(entrant, axes, ground, DEVELOP, DEVELOP), path=None)], []
    reason = "nothing stands for what its restoration gives"
    return _one_method(entrant, axes, ground, DEVELOP, reason)


def _one_method(
    entrant: Entrant, axes: Axes, ground: Ground, method: str, lacking: str
) -> TrialsAndSkips:
    """Return the trial of a method, or why there is none where it was asked for."""
    if entrant.is_reference:
        return [], []
    if method not in _methods_of(entrant):
        is_requested = axes.methods is not None
        return [], [Skip(f"{entrant.label} {method}", lacking)] if is_requested else []
    return [plain_trial(entrant, axes, ground, method, method)], []


def _methods_of(entrant: Entrant) -> tuple[str, ...]:
    manifest = entrant.bundle.manifest
    return offered_methods(manifest.stages, manifest.all_planes)


def _networks(entrant: Entrant, axes: Axes, ground: Ground) -> TrialsAndSkips:
    """Return all trials of a bundle; a reference gets its sizes in their base trial only."""
    bundle_sizes = list(entrant.bundle.manifest.sizes)
    sizes = [size for size in axes.sizes or bundle_sizes if size in bundle_sizes]
    skips = [
        Skip(
            f"{entrant.label} {size}", f"the bundle holds {', '.join(bundle_sizes) or 'no network'}"
        )
        for size in axes.sizes or ()
        if size not in bundle_sizes and not entrant.is_reference
    ]
    if entrant.is_reference:
        sizes, axes = bundle_sizes, Axes(vary=False)
    base_size = BASE_SIZE if BASE_SIZE in sizes else (*sizes, "")[0]
    trials = []
    for size in sizes:
        facts = _facts(entrant, size)
        for trial in _trials_of(entrant, size, axes, ground, vary=size == base_size):
            reason = _obstacle(trial, facts, ground)
            if reason is None:
                trials.append(_with_memory(trial, ground))
            else:
                skips.append(Skip(f"{entrant.label} {trial.label}", reason))
    return trials, skips


def _trials_of(
    entrant: Entrant, size: str, axes: Axes, ground: Ground, *, vary: bool
) -> list[Trial]:
    half = ("fp16",) if _has_fp16(_facts(entrant, size)) else ()
    one = (1,) if ground.threads > 1 else ()
    varied = [
        Vary("mode", axes.modes or AXIS_VALUES["modes"], axes.modes is not None),
        Vary("dtype", axes.dtypes or ("fp32", *half), axes.dtypes is not None),
        Vary("provider", axes.providers or ground.providers, axes.providers is not None),
        Vary("threads", axes.threads or (ground.threads, *one), axes.threads is not None),
        Vary("tile_px", axes.tiles_px or (None,), axes.tiles_px is not None),
    ]
    base = replace(plain_trial(entrant, axes, ground, NETWORK.name, NET[0]), size=size)
    return list(spread_out(base, varied, vary=vary and axes.vary))


def _facts(entrant: Entrant, size: str) -> list[NetworkFacts]:
    """Return the facts of one size of every network of a bundle."""
    networks = entrant.bundle.manifest.networks
    return [entrant.bundle.network_facts(role, size) for role in networks]


def _has_fp16(facts: Sequence[NetworkFacts]) -> bool:
    return all(one.fp16_member is not None for one in facts)


def _obstacle(trial: Trial, facts: Sequence[NetworkFacts], ground: Ground) -> str | None:
    """Return why a trial cannot be measured here; None if it can."""
    if trial.dtype == "fp16" and not _has_fp16(facts):
        return "the bundle holds no fp16 graph of this size"
    if trial.mode == "fast" and not all(one.halo_error for one in facts):
        return "the bundle holds no measured halo"
    if trial.threads > ground.threads:
        return f"this process may use {ground.threads} threads"
    if trial.provider not in ground.providers:
        return f"networks here are computed on {', '.join(ground.providers)}"
    if trial.dtype == "bf16":
        return _bfloat16_obstacle(trial)
    return None


def _bfloat16_obstacle(trial: Trial) -> str | None:
    if trial.provider != OPENVINO:
        return f"bf16 is computed by {OPENVINO} alone"
    missing = missing_bfloat16()
    return None if missing is None else f"bf16 needs {missing}"


def _with_memory(trial: Trial, ground: Ground) -> Trial:
    """Return a trial of mode whole with most of the free memory; others keep the default."""
    if trial.mode != "whole" or ground.free_bytes is None:
        return trial
    return replace(trial, max_mem_bytes=max(int(WHOLE_SHARE * ground.free_bytes), 400_000_000))


CLASSICAL: Final = RowMaker(
    name="classical",
    methods=tuple(m for m in all_methods() if m not in (*NET, PHYSICS)),
    trials=_without_networks,
)
NETWORK: Final = RowMaker(name="network", methods=NET, trials=_networks)
COMMON: Final = (
    CLASSICAL,
    RowMaker(name=DEVELOP, methods=(DEVELOP,), trials=_develop),
    NETWORK,
    RowMaker(name=PHYSICS, methods=(PHYSICS,), trials=_physics),
)
