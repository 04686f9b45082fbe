"""Spectra of pictures in cells, as products of matrices whose sides depend on the capture.

A spectrum lies as real and imaginary parts of two signs of the frequency along rows, each of rows
0 .. n / 2 and columns 0 .. n / 2:

    P = D X E,  D = [cos; sin] of rows, E = [cos, sin] of columns
    +: cc - ss, -(sc + cs)      -: cc + ss, sc - cs
"""

from typing import Final

import numpy as np

from camkit.bundle.haze_golden import MAX_CELLS
from camkit.runtime.portable.graph_builder import GraphBuilder, Value

LONGEST: Final = 2 * MAX_CELLS
"""Sides up to which a fast length is known."""
CellSpectrum = tuple[tuple[Value, Value], tuple[Value, Value]]
"""Of either sign the real and imaginary parts, (t, rows, columns)."""


class SideWaves:
    """The waves along one side of a picture."""

    def __init__(self, graph: GraphBuilder, size: Value, reach: int) -> None:
        """Choose the length of the period, as `camkit.runtime.bank.place_blur` does.

        Args:
            graph: To add to.
            size: (1,) int64, samples of the picture.
            reach: Of its kernels.
        """
        import scipy.fft

        lengths = sorted({scipy.fft.next_fast_len(n, real=True) for n in range(1, LONGEST)})
        self._graph = graph
        table = graph.constant(np.array(lengths, np.int64))
        shorter = graph.node("Less", table, size + reach)
        at = graph.node("ReduceSum", Value(graph, shorter.name, "bool").cast("int64"), keepdims=1)
        self._period = table.gather(at, 0)
        self._at = line(graph, size)
        self.count = self._period / 2 + 1
        frequency = line(graph, self.count)
        single = graph.node("Equal", frequency * frequency * 2, frequency * self._period)
        self._is_single = Value(graph, single.name, "bool").cast("float32")
        self._frequency = frequency

    def of_picture(self) -> list[Value]:
        """Return cosines and sines (n, frequency) at the samples of the picture."""
        return self._waves(self._at)

    def of_kernel(self, reach: int) -> list[Value]:
        """Return those at the samples of a kernel, its middle the origin."""
        return self._waves(self._graph.constant(np.arange(-reach, reach + 1)))

    def doubled(self, single: float, double: float) -> Value:
        """Return a weight for every frequency: one for 0 and that of half the period."""
        return self._is_single * (single - double) + double

    @property
    def period(self) -> Value:
        """Return its length, (1,) float32."""
        return self._period.cast("float32")

    def _waves(self, at: Value) -> list[Value]:
        graph = self._graph
        turned = graph.node("Mod", at.shaped(-1, 1) * self._frequency, self._period)
        wrapped = Value(graph, (turned * 2 > self._period).name, "bool").cast("int64")
        turned = turned - wrapped * self._period
        angle = turned.cast("float32") * (2 * np.pi / self.period)
        return [graph.node(name, angle) for name in ("Cos", "Sin")]


def line(graph: GraphBuilder, count: Value) -> Value:
    """Return 0, 1, 2, ... of a (1,) count of int64."""
    zero, one = graph.constant(0, "int64"), graph.constant(1, "int64")
    return graph.node("Range", zero, count.shaped(), one)


class CellWaves:
    """Takes pictures of one size to their spectra and back."""

    def __init__(self, graph: GraphBuilder, sizes: tuple[Value, Value], reach: int) -> None:
        """Make the matrices of (rows, columns), both (1,) int64."""
        self._graph = graph
        self._rows, self._columns = (SideWaves(graph, size, reach) for size in sizes)
        down, across = self._rows.of_picture(), self._columns.of_picture()
        self._down = graph.joined(down, axis=1).turned(1, 0)
        self._across = graph.joined(across, axis=1)
        weights = self._rows.doubled(0.5, 1.0) / self._rows.period
        self._row_waves = graph.joined([part * weights for part in down], axis=1)
        weights = self._columns.doubled(1.0, 2.0) / self._columns.period
        self._column_waves = graph.joined([part * weights for part in across], axis=1).turned(1, 0)

    def spectrum(self, planes: Value) -> CellSpectrum:
        """Return the spectrum of pictures (t, h, w)."""
        return self._signed(self._down @ (planes @ self._across))

    def kernel_spectrum(self, kernels: Value, reach: int) -> CellSpectrum:
        """Return the spectrum of kernels (t, n, n)."""
        down = self._graph.joined(self._rows.of_kernel(reach), axis=1).turned(1, 0)
        across = self._graph.joined(self._columns.of_kernel(reach), axis=1)
        return self._signed(down @ (kernels @ across))

    def picture(self, spectrum: CellSpectrum) -> Value:
        """Return the pictures (t, h, w) of a spectrum."""
        (re, im), (re_below, im_below) = spectrum
        by_cosines = self._graph.joined([re + re_below, im_below - im], axis=1)
        by_sines = self._graph.joined([(im + im_below) * -1.0, re_below - re], axis=1)
        parts = self._graph.joined([by_cosines, by_sines], axis=2)
        return self._row_waves @ parts @ self._column_waves

    def _signed(self, parts: Value) -> CellSpectrum:
        upper, lower = parts.parts(1, 2)
        (cc, cs), (sc, ss) = upper.parts(2, 2), lower.parts(2, 2)
        return (cc - ss, (sc + cs) * -1.0), (cc + ss, sc - cs)
