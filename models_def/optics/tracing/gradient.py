"""A trace as one node of the autograd graph, in blocks of rays that fit the cache.

Saved for backward are the rays on each surface (24 bytes in float32, 48 in float64, per ray and
surface) while that is less than `KEEP_BYTES`; beyond, only the launched rays are, and each block
is traced again when its gradient is due. So memory is bounded whatever the number of surfaces.
"""

from collections.abc import Sequence
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

from camkit.models_def.optics.tracing.adjoint import pull_back
from camkit.models_def.optics.tracing.gradient_parts import GradientNeeds, Gradients, Slopes
from camkit.models_def.optics.tracing.kernel import (
    LensTensors,
    RayRecord,
    Result,
    TraceSettings,
    numbers,
    rest,
    run,
)
from camkit.models_def.optics.tracing.meeting import State

BLOCK_RAYS: Final = 16_384
KEEP_BYTES: Final = 2**28


class Task(NamedTuple):
    """The backward half of a block; `record` is None if it must be traced again."""

    settings: TraceSettings
    needs: GradientNeeds
    record: RayRecord | None
    slopes: Slopes


class Engine(Protocol):
    """The engine that computes a block: eager here, compiled in `compilation`."""

    def block_rays(self, *, gradient: bool) -> int:
        """Return the most rays of a block; `gradient` if it will be pulled back."""
        ...

    def run(self, settings: TraceSettings, lens: LensTensors, rays: State, fate: Tensor) -> Result:
        """Trace a block; an empty `record.states` means that it need not be kept."""
        ...

    def pull(self, task: Task, lens: LensTensors, rays: State, fate: Tensor) -> Gradients:
        """Return the gradients of a block."""
        ...


class Eager:
    """One torch operation after the other."""

    def block_rays(self, *, gradient: bool) -> int:  # noqa: ARG002
        """Return the rays that fit the cache: every operation writes its result."""
        return BLOCK_RAYS

    def run(self, settings: TraceSettings, lens: LensTensors, rays: State, fate: Tensor) -> Result:
        """Trace a block."""
        return run(settings, numbers(lens, settings), rays, fate)

    def pull(self, task: Task, lens: LensTensors, rays: State, fate: Tensor) -> Gradients:
        """Return the gradients of a block."""
        surfaces = numbers(lens, task.settings)
        record = task.record
        if record is None:
            record = run(task.settings, surfaces, rays, fate).record
        rays = rest(rays, fate, adaptive=task.settings.adaptive)
        return pull_back(task.settings, task.needs, surfaces, rays, record, task.slopes, _sum_to)


def _sum_to(value: Tensor, like: Tensor) -> Tensor:
    return value.sum_to_size(like.shape) if value.shape != like.shape else value


class _Block(NamedTuple):
    """Part of the rays: `size` of them from `start` along a dimension counted from the last."""

    dim: int
    start: int
    size: int

    def of(self, value: Tensor, fixed: int = 0) -> Tensor:
        """Return the part of a tensor that broadcasts against the rays.

        Args:
            value: Its first `fixed` dimensions do not belong to the rays.
            fixed: How many.
        """
        if value.ndim - fixed < -self.dim or value.shape[self.dim] == 1:
            return value
        return value.narrow(self.dim, self.start, self.size)


def _blocks(shape: torch.Size, device: torch.device, limit: int) -> list[_Block]:
    """Cut the longest dimension so that a block has about `limit` rays, more off the CPU."""
    count = shape.numel()
    limit *= 1 if device.type == "cpu" else 64
    if count <= limit:
        return []
    dim = max(range(len(shape)), key=lambda d: shape[d])
    size = max(1, limit * shape[dim] // count)
    starts = range(0, shape[dim], size)
    return [_Block(dim - len(shape), s, min(size, shape[dim] - s)) for s in starts]


class _Spec(NamedTuple):
    """The inputs that are no tensors: settings, engine, whether rays on surfaces are returned."""

    settings: TraceSettings
    engine: Engine
    with_surfaces: bool


def trace_tensors(
    settings: TraceSettings,
    engine: Engine,
    lens: LensTensors,
    rays: State,
    fate: Tensor,
    *,
    with_surfaces: bool = False,
) -> Result:
    """Trace rays, differentiable by rays and lens (not twice, not in forward mode).

    Args:
        settings: What is static.
        engine: What computes.
        lens: Tensors of one type and device, broadcasting against the rays.
        rays: Of the same type and device.
        fate: int8.
        with_surfaces: Whether `record.states` and `record.fates` of the result are filled.
    """
    spec = _Spec(settings, engine, with_surfaces)
    flat: tuple[Tensor, ...] = _Trace.apply(spec, fate, *rays, *lens)  # type: ignore[no-untyped-call]
    head = 7 + settings.path
    return Result(
        State(*flat[:6]),
        flat[7] if settings.path else None,
        RayRecord(flat[6], *_unflatten(flat[head:])),
    )


def _flatten(record: RayRecord) -> list[Tensor]:
    return [
        v for state, fate in zip(record.states, record.fates, strict=True) for v in (*state, fate)
    ]


def _unflatten(flat: Sequence[Tensor]) -> tuple[list[State], list[Tensor]]:
    states = [State(*flat[i : i + 6]) for i in range(0, len(flat), 7)]
    return states, list(flat[6::7])


def _part(
    block: _Block | None, lens: LensTensors, rays: State, fate: Tensor
) -> tuple[LensTensors, State, Tensor]:
    if block is None:
        return lens, rays, fate
    cut = LensTensors(*(block.of(v, FIXED[i]) for i, v in enumerate(lens)))
    return cut, State(*(block.of(v) for v in rays)), block.of(fate)


# leading dimensions of lens tensors that are not the rays': surface, and term of the polynomial
FIXED: Final = (1, 1, 2, 1, 1, 1, 2, 2, 1)


class _Trace(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, spec: _Spec, fate: Tensor, *tensors: Tensor) -> tuple[Tensor, ...]:
        rays, lens = State(*tensors[:6]), LensTensors(*tensors[6:])
        batches = (v.shape[fixed:] for v, fixed in zip(lens, FIXED, strict=True))
        shapes = [fate.shape, *(v.shape for v in rays), *batches]
        # that of torch loads an algebra system, most of a second
        shape = torch.Size(np.broadcast_shapes(*map(tuple, shapes)))
        rays, fate = State(*(v.expand(shape) for v in rays)), fate.expand(shape)
        size = shape.numel() * len(spec.settings.aspheric) * 6 * rays.x.element_size()
        gradient = any(ctx.needs_input_grad)
        keep = gradient and size <= KEEP_BYTES
        blocks = _blocks(shape, fate.device, spec.engine.block_rays(gradient=gradient))
        parts: list[list[Tensor]] = []
        saved: list[Tensor] = []
        counts: list[int] = []
        whole: list[_Block | None] = [None]
        for block in blocks or whole:
            result = spec.engine.run(spec.settings, *_part(block, lens, rays, fate))
            flat = _flatten(result.record)
            counts.append(len(flat) + 1 if keep and flat else 0)
            saved += [result.record.fate, *flat][: counts[-1]]
            path = [] if result.path is None else [result.path]
            parts.append(
                [*result.end, result.record.fate, *path, *(flat if spec.with_surfaces else [])]
            )
        out = tuple(_join(v, blocks) for v in zip(*parts, strict=True))
        ctx.save_for_backward(fate, *tensors, *saved)
        ctx.spec, ctx.shape, ctx.blocks, ctx.counts = spec, shape, blocks, counts
        ctx.set_materialize_grads(False)
        ctx.mark_non_differentiable(*(v for v in out if v.dtype == torch.int8))
        return out

    @staticmethod
    @once_differentiable
    def backward(ctx: Any, *slopes: Tensor | None) -> tuple[Tensor | None, ...]:
        fate, *tensors = ctx.saved_tensors[:16]
        saved = ctx.saved_tensors[16:]
        rays, lens = State(*(v.expand(ctx.shape) for v in tensors[:6])), LensTensors(*tensors[6:])
        needs = ctx.needs_input_grad[2:]
        gradient_needs = GradientNeeds(
            rays=any(needs[:6]),
            curvature=needs[6],
            conic=needs[7],
            even_asphere=needs[8],
            thickness=needs[9],
            index=needs[11],
            odd_asphere=needs[12],
            phase=needs[13],
        )
        sums = [
            torch.zeros_like(v) if need else None for v, need in zip(lens, needs[6:], strict=True)
        ]
        blocks = ctx.blocks or [None]
        parts: list[State] = []
        for block, count in zip(blocks, ctx.counts, strict=True):
            here, saved = saved[:count], saved[count:]
            record = RayRecord(here[0], *_unflatten(here[1:])) if here else None
            cut = [v if v is None or block is None else block.of(v) for v in slopes]
            part = _part(block, lens, rays, fate)
            task = Task(
                ctx.spec.settings,
                gradient_needs,
                record,
                _slopes(ctx.spec.settings, cut, part[1].x),
            )
            gradients = ctx.spec.engine.pull(task, *part)
            parts.append(gradients.rays)
            _add(sums, gradients, block)
        of_rays: list[Tensor | None] = [None] * 6
        if gradient_needs.rays:
            joined = (_join(v, ctx.blocks) for v in zip(*parts, strict=True))
            of_rays = [v.sum_to_size(t.shape) for v, t in zip(joined, tensors[:6], strict=True)]
        return (None, None, *of_rays, *sums)


def _join(parts: tuple[Tensor, ...], blocks: list[_Block]) -> Tensor:
    return torch.cat(parts, blocks[0].dim) if blocks else parts[0]


def _slopes(settings: TraceSettings, flat: Sequence[Tensor | None], like: Tensor) -> Slopes:
    zero = torch.zeros((), dtype=like.dtype, device=like.device).expand_as(like)

    def state(values: Sequence[Tensor | None]) -> State:
        return State(*(zero if v is None else v for v in values))

    head = 7 + settings.path
    rows = [flat[i : i + 6] for i in range(head, len(flat), 7)]
    states = [None if all(v is None for v in row) else state(row) for row in rows]
    states = states or [None] * len(settings.aspheric)
    return Slopes(state(flat[:6]), flat[7] if settings.path else None, states)


def _add(sums: Sequence[Tensor | None], gradients: Gradients, block: _Block | None) -> None:
    def rows(lists: list[list[Tensor]]) -> list[Tensor]:
        return [torch.stack(row) for row in lists if row]

    columns = [
        gradients.curvature,
        gradients.conic,
        rows(gradients.even_asphere),
        gradients.thickness,
        [],
        gradients.indices,
        rows(gradients.odd_asphere),
        rows(gradients.phase),
        [],
    ]
    for total, values, fixed in zip(sums, columns, FIXED, strict=True):
        if total is not None and values:
            part = total if block is None else block.of(total, fixed)
            part += torch.stack(values)
