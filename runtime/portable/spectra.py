"""Spectra of blocks as products of matrices, in four phases of half the side.

A block of side 2 n lies as four planes of n x n, (c, 4, n, n): plane 2 py + px holds the samples of
rows 2 j + py and columns 2 i + px. Its spectrum lies as (c, 4, 2, q, q) real and imaginary parts,
q = n / 2 + 1: alias 2 dy + dx, sign, row d, column k stand for the frequency

    (+-d + n dy, k + n dx) / (2 n) cycles per pixel

so that frequencies which a colour of a mosaic folds onto each other lie at one place of all
aliases. With E the waves of a plane's own rows and columns,

    X_s = sum_p (-1)^(py dy + px dx) E_py x_p E_px        (one step of a fast Fourier transform)

and x follows from X alike. Some frequencies lie there twice: d = 0 with either sign, and d = n / 2
of one alias as -n / 2 of the next; sums over frequencies weigh them by half.
"""

from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.runtime.portable.graph_builder import GraphBuilder, Value

FloatGrid = NDArray[np.float64]
PHASES: Final = ((0, 0), (0, 1), (1, 0), (1, 1))
"""(py, px) of the planes, and (dy, dx) of the aliases."""
Spectrum = tuple[Value, Value]
"""Real and imaginary parts, (c, 4, 2, q, q)."""


class BlockShape:
    """The sizes of a block of some side, its waves, and where its frequencies lie."""

    def __init__(self, side: int) -> None:
        self.side = side
        self.n = side // 2
        self.q = self.n // 2 + 1

    @cached_property
    def frequencies(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return rows and columns, (4, 2, q, q) each, in units of 1 / side."""
        d, k = np.arange(self.q)[:, None], np.arange(self.q)[None]
        rows = [[sign * d + self.n * dy + 0 * k for sign in (1, -1)] for dy, _ in PHASES]
        columns = [[k + self.n * dx + 0 * d for _ in (1, -1)] for _, dx in PHASES]
        return np.array(rows), np.array(columns)

    @cached_property
    def squares(self) -> FloatGrid:
        """Return the squared frequencies, (4, 2, q, q), each folded to its least."""
        rows, columns = self.frequencies
        half = self.n
        fy, fx = (((part + half) % self.side - half) / self.side for part in (rows, columns))
        return np.asarray(fy * fy + fx * fx)

    def waves(self, positions: NDArray[np.floating[Any]]) -> tuple[FloatGrid, FloatGrid]:
        """Return cosines and sines (q, n) of the frequencies d at positions (n,)."""
        angle = np.pi / self.n * np.outer(np.arange(self.q), positions)
        return _clean(np.cos(angle)), _clean(np.sin(angle))


def _clean(waves: FloatGrid) -> FloatGrid:
    waves[np.abs(waves) < 1e-12] = 0
    return waves


def spectrum(
    graph: GraphBuilder, planes: Value, shape: BlockShape, reach: int | None = None
) -> Spectrum:
    """Return the spectrum of planes in four phases.

    Args:
        graph: To add to.
        planes: (c, 4, n, n) of a block, or (c, 4, m, m) of a kernel, see `kernel_span`.
        shape: Of the block.
        reach: From the middle of a kernel to its border; None for a block.
    """
    first, count = (0, shape.n) if reach is None else kernel_span(reach)
    name = "waves" if reach is None else "kernel_waves"
    row_waves, cosines, sines = _wave_tables(graph, name, shape, (first, count))
    rows, q = row_waves @ planes, shape.q
    by_cosines, by_sines = (_aliases(graph, rows @ part, 1) for part in (cosines, sines))
    return _split(graph, by_cosines, by_sines, q)


def phase_spectra(graph: GraphBuilder, planes: Value, phases: Value, shape: BlockShape) -> Spectrum:
    """Return (1, 4, 2, q, q): spectra of single planes, each as if the others were zero.

    Args:
        graph: To add to.
        planes: (4, n, n).
        phases: (4,) int64, the phase of each.
        shape: Of the block.
    """
    tables = _wave_tables(graph, "waves", shape, (0, shape.n))
    row_waves, cosines, sines = (table.gather(phases, 0) for table in tables)
    rows, q = row_waves @ planes, shape.q
    by_cosines, by_sines = ((rows @ part).shaped(1, 4, 2 * q, q) for part in (cosines, sines))
    return _split(graph, by_cosines, by_sines, q)


def _phase_waves(shape: BlockShape, first: int, count: int) -> tuple[FloatGrid, ...]:
    """Return waves of rows (4, 2 q, m), and cosines and sines of columns (4, m, q)."""
    waves = [shape.waves(first + 2.0 * np.arange(count) + p) for p in (0, 1)]
    row_waves = np.stack([np.concatenate(waves[py]) for py, _ in PHASES])
    return row_waves, *(np.stack([waves[px][part].T for _, px in PHASES]) for part in (0, 1))


def _wave_tables(
    graph: GraphBuilder, name: str, shape: BlockShape, span: tuple[int, int]
) -> list[Value]:
    parts = zip(("rows", "cosines", "sines"), _phase_waves(shape, *span), strict=True)
    return [graph.table(f"{name}_{part}", values) for part, values in parts]


def _split(graph: GraphBuilder, by_cosines: Value, by_sines: Value, q: int) -> Spectrum:
    """Return the spectrum of (c, 4, 2 q, q) sums over cosines and sines of the columns."""
    cc, sc = by_cosines.part(2, 0, q), by_cosines.part(2, q, 2 * q)
    cs, ss = by_sines.part(2, 0, q), by_sines.part(2, q, 2 * q)
    return _signs(graph, cc - ss, cc + ss), _signs(graph, (sc + cs) * -1.0, sc - cs)


def kernel_span(reach: int) -> tuple[int, int]:
    """Return the position of the first row of a kernel in four phases, even, and m."""
    first = -(reach + reach % 2)
    return first, (reach - first) // 2 + 1


def planes_of(graph: GraphBuilder, parts: Spectrum, shape: BlockShape) -> Value:
    """Return the (c, 4, n, n) planes of a spectrum."""
    q, n = shape.q, shape.n
    (re, re_below), (im, im_below) = (_unsigned(part, q) for part in parts)
    by_cosines = graph.joined([re + re_below, im_below - im], axis=2)
    by_sines = graph.joined([(im + im_below) * -1.0, re_below - re], axis=2)
    column_weights = np.full(q, 2.0)
    column_weights[[0, -1]] = 1
    row_weights = np.full(q, 1.0)
    row_weights[[0, -1]] = 0.5
    waves = [shape.waves(2.0 * np.arange(n) + p) for p in (0, 1)]
    cosines, sines = (
        np.stack([waves[px][part] * column_weights[:, None] for _, px in PHASES]) for part in (0, 1)
    )
    rows = np.stack(
        [np.concatenate([w * row_weights[:, None] for w in waves[py]]).T for py, _ in PHASES]
    )
    columns = _aliases(graph, by_cosines, 1) @ graph.table("back_cosines", cosines)
    columns = columns + _aliases(graph, by_sines, 1) @ graph.table("back_sines", sines)
    return graph.table("back_rows", rows / (4.0 * n * n)) @ columns


def _aliases(graph: GraphBuilder, planes: Value, axis: int) -> Value:
    """Return sums and differences of four planes: of phases for aliases, or the other way."""
    a, b, c, d = planes.parts(axis, 4)
    upper, upper_difference, lower, lower_difference = a + b, a - b, c + d, c - d
    return graph.joined(
        [
            upper + lower,
            upper_difference + lower_difference,
            upper - lower,
            upper_difference - lower_difference,
        ],
        axis=axis,
    )


def _signs(graph: GraphBuilder, above: Value, below: Value) -> Value:
    axis = np.array([2], np.int64)
    pair = [graph.node("Unsqueeze", part, axis) for part in (above, below)]
    return graph.joined(pair, axis=2)


def _unsigned(part: Value, q: int) -> list[Value]:
    return [half.shaped(0, 4, q, q) for half in part.parts(2, 2)]


def product(a: Spectrum, b: Spectrum) -> Spectrum:
    """Return a b."""
    return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]


def crossed(a: Spectrum, b: Spectrum) -> Spectrum:
    """Return a conj(b)."""
    return a[0] * b[0] + a[1] * b[1], a[1] * b[0] - a[0] * b[1]
