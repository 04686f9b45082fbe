"""Trials: one way to do the work each, and the axes along which they vary."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

from camkit.bundle.reader import Bundle
from camkit.errors import ContractError
from camkit.runtime.plan.rules.size import REFERENCE

BASE_SIZE: Final = REFERENCE
"""The size that other rows are compared with, where a bundle has it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trial:
    """One row of the bench before it is measured.

    Attributes:
        camera: Label of the bundle whose camera takes the captures.
        bundle: Label of the bundle that does the work.
        path: That bundle; None only develops.
        maker: Name of the row maker: network, classical, develop or what else registers.
        method: As `camkit process --method` takes it, or develop.
        size: Such as S, M or L; None without a network.
        mode: exact, fast or whole; None without a network.
        dtype: fp32, fp16 or bf16; None without a network.
        provider: What computes the network; None without a network.
        threads: Threads in all.
        tile_px: Forced side of the tiles; None for the planned one.
        max_mem_bytes: Memory cap; None for the default.
        base_threads: Threads that need no mention.
        extra: Further fields of `Options` by name, for row makers to come.
    """

    camera: str
    bundle: str
    path: Path | None
    maker: str
    method: str
    size: str | None = None
    mode: str | None = None
    dtype: str | None = None
    provider: str | None = None
    threads: int
    tile_px: int | None = None
    max_mem_bytes: int | None = None
    base_threads: int
    extra: tuple[tuple[str, Any], ...] = ()

    @property
    def accuracy_key(self) -> tuple[object, ...]:
        """Return what decides the pixels: neither threads nor tiles change a bit of them."""
        pixels = self.size, self.mode, self.dtype, self.provider, self.extra
        return (self.camera, self.bundle, self.method, *pixels)

    @property
    def is_variant(self) -> bool:
        """True if it differs from a plain run of its method in more than the method itself."""
        return bool(self._particulars())

    @property
    def label(self) -> str:
        """Name the trial for people, without its camera."""
        name = self.size or self.method
        names = [name] if self.bundle == self.camera else [self.bundle, name]
        return " ".join([*names, *self._particulars()])

    def _particulars(self) -> list[str]:
        words = [v for v in (self.mode, self.dtype, self.provider) if v not in _PLAIN]
        particulars = [word for word in words if word is not None]
        particulars += [f"{name} {value}" for name, value in self.extra]
        if self.tile_px is not None:
            particulars.append(f"tile {self.tile_px}")
        if self.threads != self.base_threads:
            particulars.append(f"{self.threads} thread{'s' * (self.threads != 1)}")
        return particulars

    def options(self) -> dict[str, Any]:
        """Return what differs from the default `Options`, as plain JSON values."""
        options: dict[str, Any] = {
            "method": None if self.path is None else self.method,
            "size": self.size,
            "mode": self.mode,
            "dtype": self.dtype,
            "provider": self.provider,
            "tile_px": self.tile_px,
            "max_mem_bytes": self.max_mem_bytes,
            "threads": self.threads,
        }
        return {k: v for k, v in options.items() if v is not None} | dict(self.extra)


_PLAIN: Final = (None, "exact", "fp32", "cpu")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """The values that a caller asked for; None leaves an axis to the bench.

    Axes that were asked for are multiplied with each other; the others are varied one at a time
    around the base trial, so that the default stays short.

    Attributes:
        sizes: Such as S, M or L; None for all that the bundle holds.
        methods: None for all that are registered.
        best: Where no methods are given, this many of every bundle, the best first; None for all.
        modes: exact, fast, whole.
        dtypes: fp32, fp16, bf16.
        providers: cpu, cuda, tensorrt, openvino.
        threads: Numbers of threads.
        tiles_px: Sides of tiles.
        vary: Whether axes that were not asked for are varied at all.
    """

    sizes: tuple[str, ...] | None = None
    methods: tuple[str, ...] | None = None
    best: int | None = None
    modes: tuple[str, ...] | None = None
    dtypes: tuple[str, ...] | None = None
    providers: tuple[str, ...] | None = None
    threads: tuple[int, ...] | None = None
    tiles_px: tuple[int, ...] | None = None
    vary: bool = True

    def __post_init__(self) -> None:
        for name in ("modes", "dtypes", "providers"):
            values = getattr(self, name)
            allowed = AXIS_VALUES[name]
            if values is not None and (unknown := [v for v in values if v not in allowed]):
                raise ContractError(
                    f"{name} are {', '.join(allowed)}; got {', '.join(map(str, unknown))}"
                )
        for name in ("threads", "tiles_px"):
            values = getattr(self, name)
            if values is not None and min(values, default=0) < 1:
                raise ContractError(f"{name} must be >= 1; got {values}")


AXIS_VALUES: Final[dict[str, tuple[str, ...]]] = {
    "modes": ("exact", "fast", "whole"),
    "dtypes": ("fp32", "fp16", "bf16"),
    "providers": ("cpu", "cuda", "tensorrt", "openvino"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ground:
    """Offers of the machine, where a caller leaves an axis open.

    Attributes:
        threads: Threads that may be used.
        providers: What networks are computed on here, cpu first.
        free_bytes: Memory that is free now; None where the system does not tell.
    """

    threads: int
    providers: tuple[str, ...]
    free_bytes: int | None

    def base_threads(self, axes: Axes) -> int:
        """Return the threads of rows that do not vary them: the first asked for, if there."""
        return min((axes.threads or (self.threads,))[0], self.threads)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entrant:
    """A bundle that takes part.

    Attributes:
        label: Its name in the report.
        bundle: The bundle.
        camera: Label of the bundle whose captures it restores; its own, if it is no reference.
    """

    label: str
    bundle: Bundle
    camera: str

    @property
    def is_reference(self) -> bool:
        """True if it only stands beside another bundle of the same camera."""
        return self.camera != self.label


def plain_trial(entrant: Entrant, axes: Axes, ground: Ground, maker: str, method: str) -> Trial:
    """Return the trial of a method of a bundle, on the first number of threads asked for."""
    threads = ground.base_threads(axes)
    return Trial(
        camera=entrant.camera,
        bundle=entrant.label,
        path=entrant.bundle.path,
        maker=maker,
        method=method,
        threads=threads,
        base_threads=threads,
    )


class Skip(NamedTuple):
    """Something that was asked for and cannot be measured here."""

    what: str
    reason: str


class Vary(NamedTuple):
    """One axis: field of `Trial`, values, and whether the caller asked for them."""

    field: str
    values: tuple[Any, ...]
    is_requested: bool


def spread_out(base: Trial, axes: Sequence[Vary], *, vary: bool) -> Iterator[Trial]:
    """Return a trial for every product of the axes asked for, then those varied one at a time.

    Args:
        base: Gives the fields that no axis sets.
        axes: The first value of each is the base value.
        vary: Whether axes that were not asked for are varied.
    """
    first = {axis.field: axis.values[0] for axis in axes}
    requested = [axis for axis in axes if axis.is_requested]
    for values in product(*(axis.values for axis in requested)):
        fields = first | dict(zip((axis.field for axis in requested), values, strict=True))
        yield replace(base, **fields)
    for axis in axes:
        for value in axis.values[1:] if vary and not axis.is_requested else ():
            yield replace(base, **(first | {axis.field: value}))
