"""The networks of a bundle: sizes, modes, precisions, providers, threads and tiles."""

from dataclasses import replace
from typing import Final

from camkit.bundle.facts import NetworkFacts
from camkit.report.bench.case import (
    BASE_SIZE,
    KNOWN,
    Axes,
    Case,
    Entrant,
    Ground,
    Skip,
    Vary,
    spread_out,
)
from camkit.report.bench.row_kind import RowKind

WHOLE_SHARE: Final = 0.7
"""Of the free memory that one window over the whole picture may take."""


def make_cases(entrant: Entrant, axes: Axes, ground: Ground) -> tuple[list[Case], list[Skip]]:
    """Give all cases of a bundle; a reference gets its sizes in their base case only."""
    held = [size for size in KNOWN["sizes"] if size in entrant.bundle.manifest.networks]
    sizes = [size for size in axes.sizes or held if size in held]
    skips = [
        Skip(f"{entrant.label} {size}", f"the bundle holds {', '.join(held) or 'no network'}")
        for size in axes.sizes or ()
        if size not in held and not entrant.is_reference
    ]
    if entrant.is_reference:
        sizes, axes = held, Axes(vary=False)
    base_size = BASE_SIZE if BASE_SIZE in sizes else (*sizes, "")[0]
    cases = []
    for size in sizes:
        facts = entrant.bundle.network_facts(size)
        for case in _cases_of(entrant, size, axes, ground, vary=size == base_size):
            reason = _obstacle(case, facts, ground)
            if reason is None:
                cases.append(_with_memory(case, ground))
            else:
                skips.append(Skip(f"{entrant.label} {case.label}", reason))
    return cases, skips


def _cases_of(entrant: Entrant, size: str, axes: Axes, ground: Ground, *, vary: bool) -> list[Case]:
    facts = entrant.bundle.network_facts(size)
    half = ("fp16",) if facts.fp16_member is not None else ()
    one = (1,) if ground.threads > 1 else ()
    varied = [
        Vary("mode", axes.modes or KNOWN["modes"], axes.modes is not None),
        Vary("dtype", axes.dtypes or ("fp32", *half), axes.dtypes is not None),
        Vary("provider", axes.providers or ground.providers, axes.providers is not None),
        Vary("threads", axes.threads or (ground.threads, *one), axes.threads is not None),
        Vary("tile_px", axes.tiles_px or (None,), axes.tiles_px is not None),
    ]
    threads = ground.base_threads(axes)
    base = Case(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        kind=KIND.name,
        method="net",
        size=size,
        threads=threads,
        base_threads=threads,
    )
    return list(spread_out(base, varied, vary=vary and axes.vary))


def _obstacle(case: Case, facts: NetworkFacts, ground: Ground) -> str | None:
    """Say why a case cannot be measured here; None if it can."""
    if case.dtype == "fp16" and facts.fp16_member is None:
        return "the bundle holds no fp16 graph of this size"
    if case.mode == "fast" and not facts.halo_error:
        return "the bundle holds no measured halo"
    if case.threads > ground.threads:
        return f"this process may use {ground.threads} threads"
    if case.provider not in ground.providers:
        return f"onnxruntime here computes on {', '.join(ground.providers)}"
    return None


def _with_memory(case: Case, ground: Ground) -> Case:
    """Let the one window of mode whole take most of the free memory; the rest keeps the default."""
    if case.mode != "whole" or ground.free_bytes is None:
        return case
    return replace(case, max_mem_bytes=max(int(WHOLE_SHARE * ground.free_bytes), 400_000_000))


KIND = RowKind(name="network", methods=("net",), cases=make_cases)
