"""The networks of a bundle: sizes, modes, precisions, providers, threads and tiles."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.facts import NetworkFacts
from camkit.report.bench.row_maker import RowMaker
from camkit.report.bench.trial import (
    BASE_SIZE,
    KNOWN,
    Axes,
    Entrant,
    Ground,
    Skip,
    Trial,
    Vary,
    spread_out,
)
from camkit.runtime.stage_finder import stage_module

METHODS: Final[tuple[str, ...]] = stage_module("network").METHODS
WHOLE_SHARE: Final = 0.7
"""Of the free memory that one window over the whole picture may take."""


def make_trials(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Trial], list[Skip]]:
    """Return all trials of a bundle; a reference gets its sizes in their base trial only."""
    held = list(entrant.bundle.manifest.sizes)
    sizes = [size for size in axes.sizes or held if size in held]
    skips = [
        Skip(f"{entrant.label} {size}", f"the bundle holds {', '.join(held) or 'no network'}")
        for size in axes.sizes or ()
        if size not in held and not entrant.is_reference
    ]
    if entrant.is_reference:
        sizes, axes = held, Axes(vary=False)
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
        Vary("mode", axes.modes or KNOWN["modes"], axes.modes is not None),
        Vary("dtype", axes.dtypes or ("fp32", *half), axes.dtypes is not None),
        Vary("provider", axes.providers or ground.providers, axes.providers is not None),
        Vary("threads", axes.threads or (ground.threads, *one), axes.threads is not None),
        Vary("tile_px", axes.tiles_px or (None,), axes.tiles_px is not None),
    ]
    threads = ground.base_threads(axes)
    base = Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        maker=ROWS.name,
        method=METHODS[0],
        size=size,
        threads=threads,
        base_threads=threads,
    )
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
        return f"onnxruntime here computes on {', '.join(ground.providers)}"
    return None


def _with_memory(trial: Trial, ground: Ground) -> Trial:
    """Let the one window of mode whole take most of the free memory; the rest keeps the default."""
    if trial.mode != "whole" or ground.free_bytes is None:
        return trial
    return replace(trial, max_mem_bytes=max(int(WHOLE_SHARE * ground.free_bytes), 400_000_000))


ROWS = RowMaker(name="network", methods=METHODS, trials=make_trials)
