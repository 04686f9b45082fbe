"""The polynomial part of a surface as a prescription states it, and as the tracer has it."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.shape.q_polynomial import QKind, q_matrix
from camkit.models_def.optics.tracing.series import Series


@dataclass(frozen=True, slots=True, kw_only=True)
class Polynomial:
    """The coefficients of a surface, as the tracer has them.

    Attributes:
        even: Of t, t^2, ...; without `series` of r^2, r^4, ...
        odd: Of u, u^3, ...
        series: How they are used; None for a plain even asphere.
    """

    even: tuple[float, ...] = ()
    odd: tuple[float, ...] = ()
    series: Series | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Asphere:
    """The polynomial part of a surface as stated; see `prescription.Surface`.

    Attributes:
        even: Of r^2, r^4, ...
        odd: Of r, r^3, ...
        q_bfs: Of Q_bfs 0, 1, ... in mm.
        q_con: Of Q_con 0, 1, ... in mm.
        normal_radius_mm: What r is divided by, or None.
    """

    even: tuple[float, ...] = ()
    odd: tuple[float, ...] = ()
    q_bfs: tuple[float, ...] = ()
    q_con: tuple[float, ...] = ()
    normal_radius_mm: float | None = None

    @property
    def q_kind(self) -> QKind | None:
        """The kind of Q polynomials that it has."""
        return "bfs" if self.q_bfs else "con" if self.q_con else None

    def polynomial(self) -> Polynomial:
        """Return it as the tracer has it."""
        kind, radius_mm = self.q_kind, self.normal_radius_mm or 1.0
        if kind is not None:
            terms = self.q_bfs or self.q_con
            even = tuple((q_matrix(kind, len(terms)) @ terms).tolist())
            return Polynomial(
                even=even, series=Series(radius_mm=radius_mm, over_root=kind == "bfs")
            )
        if self.odd or self.normal_radius_mm is not None:
            series = Series(radius_mm=radius_mm, odd=bool(self.odd))
            return Polynomial(even=self.even, odd=self.odd, series=series)
        return Polynomial(even=self.even)

    def check(self, conic: float) -> None:
        """Refuse what has no meaning.

        Raises:
            ContractError: If a number is not finite, two kinds of terms exclude each other, or
                the normalisation radius is missing or alone.
        """
        numbers = (*self.even, *self.odd, *self.q_bfs, *self.q_con)
        if not all(map(math.isfinite, numbers)):
            raise ContractError(f"a surface needs finite coefficients; got {numbers}")
        radius = self.normal_radius_mm
        if radius is not None and not (math.isfinite(radius) and radius > 0):
            raise ContractError(f"normal_radius_mm must be > 0; got {radius}")
        if self.q_kind is None:
            if radius is not None and not numbers:
                raise ContractError("normal_radius_mm without coefficients that it belongs to")
            return
        if radius is None:
            raise ContractError(f"q_{self.q_kind} needs normal_radius_mm, the radius of its rim")
        if self.even or self.odd or (self.q_bfs and self.q_con):
            raise ContractError(
                "q_bfs, q_con and even_asphere with odd_asphere exclude each other; state one"
            )
        if self.q_bfs and conic:
            raise ContractError(f"q_bfs is added to a sphere, the best fit; got conic {conic}")


def q_tensor(kind: QKind, count: int) -> torch.Tensor:
    """Return `q_matrix` as a tensor, float64."""
    return torch.from_numpy(q_matrix(kind, count))


def without_last_zeros(values: Sequence[float]) -> tuple[float, ...]:
    """Return coefficients up to the last that is not 0."""
    count = max((i for i, value in enumerate(values, start=1) if value), default=0)
    return tuple(values[:count])
