"""The parts of a gradient of a trace: what is asked for, what flows back, what comes out."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from torch import Tensor

from camkit.models_def.optics.tracing.meeting import State

Gather = Callable[[Tensor, Tensor], Tensor]
"""Sums a derivative per ray to the shape of the number that it belongs to."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GradientNeeds:
    """The gradients that are asked for; semi-diameters have none."""

    rays: bool
    curvature: bool
    conic: bool
    even_asphere: bool
    thickness: bool
    index: bool
    odd_asphere: bool
    phase: bool


class Slopes(NamedTuple):
    """The values that flow back: derivatives of the loss by a result; None is zero."""

    end: State
    path: Tensor | None
    states: list[State | None]


class Gradients(NamedTuple):
    """The gradients of rays and lens; a list has an entry per surface (indices: one more)."""

    rays: State | None
    curvature: list[Tensor]
    conic: list[Tensor]
    even_asphere: list[list[Tensor]]
    thickness: list[Tensor]
    indices: list[Tensor]
    odd_asphere: list[list[Tensor]]
    phase: list[list[Tensor]]
