"""A whole lens fused into one loop by `torch.compile`, forward and backward.

The loop keeps a ray in registers through all surfaces, and the backward loop traces it again
instead of reading it from memory. Both are compiled on first use for a layout of surfaces (which
are aspheric, how many terms, which gradients) and kept between processes (`stored_loop`); numbers
of the lens and of rays may change.
"""

import contextlib
import functools
import itertools
import logging
import shutil
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import torch
from torch import Tensor

from camkit.models_def.optics.tracing.adjoint import pull_back
from camkit.models_def.optics.tracing.gradient import FIXED, Eager, Engine, Task
from camkit.models_def.optics.tracing.gradient_parts import GradientNeeds, Gradients, Slopes
from camkit.models_def.optics.tracing.kernel import (
    NOT_CONVERGED,
    LensTensors,
    RayRecord,
    Result,
    TraceSettings,
    numbers,
    rest,
    run,
)
from camkit.models_def.optics.tracing.meeting import State
from camkit.models_def.optics.tracing.stored_loop import (
    Layout,
    Loop,
    StoredLoop,
    layout_of,
    stored_path,
)

_LOG = logging.getLogger(__name__)
_COMPILERS: Final = ("g++", "clang++", "c++", "cl")
_FORWARD_RAYS: Final = 131_072
_BACKWARD_RAYS: Final = 32_768
_PLAIN: Final = 6
"""So many tensors has a lens of conics and even aspheres."""


@functools.cache
def compiler_fault() -> str | None:
    """Return why nothing can be compiled here, after one trial; None if it can.

    A trial that succeeds is remembered by an empty file beside the stored loops.
    """
    compilers = [path for path in map(shutil.which, _COMPILERS) if path]
    if not compilers:
        return f"no C++ compiler found (looked for {', '.join(_COMPILERS)})"
    done = stored_path(tuple(compilers), "works")
    with contextlib.suppress(OSError):  # such as a home that is not ours
        if done.exists():
            return None
    try:
        torch.compile(lambda x: x * 2 + 1, fullgraph=True)(torch.ones(8))
    except (RuntimeError, OSError, ImportError) as error:
        return f"torch.compile failed: {error}"
    with contextlib.suppress(OSError):
        done.parent.mkdir(parents=True, exist_ok=True)
        done.touch()
    return None


def compiled_engine() -> Engine:
    """Return engine that compiles, or, with a warning, the plain one where that is impossible."""
    fault = compiler_fault()
    if fault is None:
        return Fused()
    _LOG.warning("the tracer is not compiled: %s", fault)
    return Eager()


class Fused:
    """One loop over the rays for the whole lens; a loop per wavelength or lens of a batch."""

    def block_rays(self, *, gradient: bool) -> int:
        """Return large blocks: rays stay in registers; a backward loop writes a column a number."""
        return _BACKWARD_RAYS if gradient else _FORWARD_RAYS

    def run(self, settings: TraceSettings, lens: LensTensors, rays: State, fate: Tensor) -> Result:
        """Trace a block; the plain way if three Newton steps are not enough for some ray."""
        parts = []
        rows = [*_rows(lens, fate.shape)]
        for row in rows:
            values = _columns(v[row.rays].flatten() for v in (*rays, fate))
            lens_numbers = _columns(_loop_inputs(settings, row.lens))
            loop = _forward(replace(settings, adaptive=False), layout_of(lens_numbers))
            parts.append(loop(*lens_numbers, *values))
        end = [_joined(column, rows, fate.shape) for column in zip(*parts, strict=True)]
        if any(settings.aspheric) and bool((end[6] == NOT_CONVERGED).any()):
            return Eager().run(settings, lens, rays, fate)
        return Result(State(*end[:6]), end[7] if settings.path else None, RayRecord(end[6], [], []))

    def pull(self, task: Task, lens: LensTensors, rays: State, fate: Tensor) -> Gradients:
        """Return the gradients of a block, traced again in the same loop."""
        if task.record is not None:
            return Eager().pull(task, lens, rays, fate)
        needs, path = task.needs, task.slopes.path
        columns = (*rays, fate, *task.slopes.end, *([] if path is None else [path]))
        of_rays = [torch.empty_like(rays.x, memory_format=torch.contiguous_format) for _ in rays]
        of_lens = LensTensors(*(torch.zeros_like(v) for v in lens))
        for row in _rows(lens, fate.shape):
            values = _columns(value[row.rays].flatten() for value in columns)
            lens_numbers = _columns(_loop_inputs(task.settings, row.lens))
            settings = replace(task.settings, adaptive=False, path=path is not None)
            loop = _backward(settings, needs, layout_of(lens_numbers))
            slopes = list(loop(*lens_numbers, *values))
            for whole in of_rays if needs.rays else []:
                whole[row.rays] = slopes.pop(0).reshape(whole[row.rays].shape)
            _add(needs, of_lens, row, [float(g.sum()) for g in slopes])
        return Gradients(
            State(*of_rays) if needs.rays else None,
            list(of_lens.curvature),
            list(of_lens.conic),
            [list(terms) for terms in of_lens.even_asphere],
            list(of_lens.thickness),
            list(of_lens.indices),
            [list(terms) for terms in of_lens.odd_asphere],
            [list(terms) for terms in of_lens.phase],
        )


def _joined(parts: Sequence[Tensor], rows: Sequence["_Row"], shape: torch.Size) -> Tensor:
    """Join the results of rows of rays."""
    if len(parts) == 1:
        return parts[0].reshape(shape)
    whole = parts[0].new_empty(shape)
    for part, row in zip(parts, rows, strict=True):
        whole[row.rays] = part.reshape(whole[row.rays].shape)
    return whole


class _Row(NamedTuple):
    """Rays that share the numbers of a lens: the lens, and where it and the rays lie."""

    lens: LensTensors
    rays: tuple[int | slice, ...]
    places: tuple[tuple[int | slice, ...], ...]


def _rows(lens: LensTensors, shape: torch.Size) -> Iterator[_Row]:
    dims = range(-len(shape), 0)
    pairs = list(zip(lens, FIXED, strict=True))
    varied = [any(v.ndim - f >= -d and v.shape[d] > 1 for v, f in pairs) for d in dims]
    whole = slice(None)
    ranges: list[Sequence[int | slice]] = [
        range(shape[d]) if vary else (whole,) for d, vary in zip(dims, varied, strict=True)
    ]
    for at in itertools.product(*ranges):
        places: list[tuple[int | slice, ...]] = []
        for v, fixed in pairs:
            index = [0 if v.shape[d] == 1 else at[d] for d in range(fixed - v.ndim, 0)]
            places.append((*[whole] * fixed, *index))
        cut = LensTensors(*(v[place] for v, place in zip(lens, places, strict=True)))
        yield _Row(cut, at, tuple(places))


def _add(needs: GradientNeeds, total: LensTensors, row: _Row, sums: list[float]) -> None:
    """Add the sums over a row, in the order of `_columns`."""
    c, k, even, gap, index, odd, phase = _flags(needs)
    flags = (c, k, even, gap, False, index, odd, phase, False)
    start = 0
    for value, place, flag in zip(total, row.places, flags, strict=True):
        if flag:
            part = value[place]
            count = part.numel()
            part += part.new_tensor(sums[start : start + count]).reshape(part.shape)
            start += count


def _flags(needs: GradientNeeds) -> tuple[bool, ...]:
    first = (needs.curvature, needs.conic, needs.even_asphere, needs.thickness, needs.index)
    return (*first, needs.odd_asphere, needs.phase)


def _loop_inputs(settings: TraceSettings, lens: LensTensors) -> tuple[Tensor, ...]:
    """Return the tensors that a loop reads: each one more is checked at every call."""
    return tuple(lens) if settings.series or settings.phases else tuple(lens[:_PLAIN])


def _whole(values: tuple[Tensor, ...]) -> LensTensors:
    """Return all tensors of a lens, those that it does not use empty."""
    if len(values) > _PLAIN:
        return LensTensors(*values)
    none = values[0].new_zeros(len(values[0]), 0)
    return LensTensors(*values, none, none, none)  # type: ignore[call-arg]


def _columns(values: Iterable[Tensor]) -> list[Tensor]:
    """Return tensors as a loop takes them: their strides and gradients are no part of it."""
    return [value.detach().contiguous() for value in values]


@functools.cache
def _forward(settings: TraceSettings, layout: Layout) -> Loop:
    def fused(*columns: Tensor) -> tuple[Tensor, ...]:
        lens = _whole(columns[:-7])
        result = run(settings, numbers(lens, settings), State(*columns[-7:-1]), columns[-1])
        path = () if result.path is None else (result.path,)
        return (*result.end, result.record.fate, *path)

    return StoredLoop(fused, ("forward", settings, layout))


@functools.cache
def _backward(settings: TraceSettings, needs: GradientNeeds, layout: Layout) -> Loop:
    def fused(*columns: Tensor) -> tuple[Tensor, ...]:
        path = columns[-1] if settings.path else None
        of_rays = columns[-14:-1] if settings.path else columns[-13:]
        lens = _whole(columns[: -14 if settings.path else -13])
        rays, fate, end = State(*of_rays[:6]), of_rays[6], State(*of_rays[7:])
        surfaces = numbers(lens, settings)
        record = run(settings, surfaces, rays, fate).record
        slopes = Slopes(end, path, [None] * len(surfaces))
        still = rest(rays, fate, adaptive=False)
        # sums are left to the caller: a reduction would end the loop
        gradients = pull_back(
            settings, needs, surfaces, still, record, slopes, lambda value, _: value
        )
        even, odd, phase = (
            [term for row in rows for term in row]
            for rows in (gradients.even_asphere, gradients.odd_asphere, gradients.phase)
        )
        lists = [gradients.curvature, gradients.conic, even, gradients.thickness, gradients.indices]
        lists += [odd, phase]
        needed_columns = [v for v, flag in zip(lists, _flags(needs), strict=True) if flag]
        return (*(gradients.rays or ()), *(v for column in needed_columns for v in column))

    return StoredLoop(fused, ("backward", settings, needs, layout))
