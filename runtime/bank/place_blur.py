"""Blur whose kernel differs from cell to cell of a coarse picture, as few plain convolutions.

    kernels of nodes (rings and azimuths, or a grid) -> few kernels b_k and weights of the nodes
    H x = sum over k of b_k * (a_k x),  a_k interpolated between the nodes, in every cell

The few kernels are the leading directions of the nodes' kernels. Errors are weighed in cells and in
squares of 2, 4, 8, ... cells, since pictures are mostly smooth: what a kernel must keep is where
its light goes, not the value of every cell.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.cancel import check_wish
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.machine.slices import run_parts

AZIMUTHS: Final = 32
"""Nodes on a ring; more changed nothing (docs/decisions: the haze is undone in cells)."""
DOUBLINGS: Final = 5
"""Of single cells to squares of 32."""

EQUAL: Final = 1e-4
"""Directions whose lengths differ less, relatively, are equally long."""

TERMS_AT_ONCE: Final = 4
"""Terms that one thread adds up; the sums are added in their order, whatever the threads."""

FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """Places at which kernels are known, and how every cell lies between them.

    Attributes:
        places_mm: (node, 2): x, y from the axis.
        near: (h, w, m): the nodes that a cell lies between.
        share: (h, w, m) float32: of each; they sum to 1.
    """

    places_mm: FloatGrid
    near: NDArray[np.intp]
    share: FloatArray


def node_places(kernels: FieldKernels) -> FloatGrid:
    """Return the places of the kernels of optics, on every azimuth where they turn: (node, 2)."""
    if kernels.grid_x_mm is not None and kernels.grid_y_mm is not None:
        return np.stack(np.meshgrid(kernels.grid_x_mm, kernels.grid_y_mm), axis=-1).reshape(-1, 2)
    if not kernels.turns:
        return np.zeros((1, 2))
    angle = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    outward = np.stack([np.sin(angle), np.cos(angle)], axis=-1)
    rings = [outward * height_mm for height_mm in kernels.field_heights_mm[1:]]
    return np.concatenate([np.zeros((1, 2)), *rings])


def lay_nodes(kernels: FieldKernels, window: SensorWindow) -> Nodes:
    """Compute the nodes of kernels, see `node_places`.

    Args:
        kernels: Their places and symmetry.
        window: Of the cells on the sensor.
    """
    width, height = window.size_px
    places = node_places(kernels)
    x_mm, y_mm = window.to_mm(np.arange(width)[None, :], np.arange(height)[:, None])
    if kernels.grid_x_mm is not None and kernels.grid_y_mm is not None:
        columns, rows = kernels.grid_x_mm, kernels.grid_y_mm
        row, row_share = _interpolation(rows, np.broadcast_to(y_mm, (height, width)))
        column, column_share = _interpolation(columns, np.broadcast_to(x_mm, (height, width)))
        return _crossed(
            places, (row, row_share), (column, column_share), lambda r, c: r * columns.size + c
        )
    if not kernels.turns:
        single = np.zeros((height, width, 1))
        return Nodes(
            places_mm=places,
            near=single.astype(np.intp),
            share=np.ones_like(single, np.float32),
        )
    heights = kernels.field_heights_mm
    turn = np.arctan2(x_mm, y_mm) / (2 * np.pi) % 1 * AZIMUTHS
    first = np.floor(turn).astype(np.intp)
    azimuth = (first, turn - first)
    return _crossed(
        places,
        _interpolation(heights, np.hypot(x_mm, y_mm)),
        azimuth,
        lambda ring, at: np.where(ring == 0, 0, 1 + (ring - 1) * AZIMUTHS + at % AZIMUTHS),
    )


def _interpolation(knots_mm: FloatGrid, at_mm: FloatGrid) -> tuple[NDArray[np.intp], FloatGrid]:
    """Return the knot below places, and the share of the one above; the ends hold beyond them."""
    if knots_mm.size == 1:
        return np.zeros(at_mm.shape, np.intp), np.zeros(at_mm.shape)
    low = np.clip(np.searchsorted(knots_mm, at_mm, "right") - 1, 0, knots_mm.size - 2)
    share = (at_mm - knots_mm[low]) / (knots_mm[low + 1] - knots_mm[low])
    return low, np.clip(share, 0.0, 1.0)


_Axis = tuple[NDArray[np.intp], FloatGrid]


def _crossed(
    places_mm: FloatGrid,
    down: _Axis,
    across: _Axis,
    number: Callable[[NDArray[np.intp], NDArray[np.intp]], NDArray[np.intp]],
) -> Nodes:
    """Return the four nodes about every cell, of which `number` tells which they are."""
    (row, lower), (column, right) = down, across
    near, share = [], []
    for step, of_row in ((0, 1 - lower), (1, lower)):
        for stride, of_column in ((0, 1 - right), (1, right)):
            weight = of_row * of_column
            node = np.where(weight > 0, number(row + step, column + stride), 0)
            near.append(node)
            share.append(weight)
    return Nodes(
        places_mm=places_mm,
        near=np.stack(near, axis=-1),
        share=np.stack(share, axis=-1).astype(np.float32),
    )


class NodeKernels:
    """The kernels of nodes, with the light that each holds; immutable."""

    def __init__(self, kernels: FieldKernels, light: FloatGrid) -> None:
        """Rotate the kernels of one quadrant; the others mirror them.

        Args:
            kernels: Of sum 1, (field, c, n, n).
            light: (field, c): what they hold.
        """
        self._places_mm = node_places(kernels)
        fields = np.arange(len(self._places_mm))
        if kernels.turns:
            fields = (fields + AZIMUTHS - 1) // AZIMUTHS
        self._light = light[fields]
        self._turns = kernels.turns
        self._rotated: dict[tuple[float, float], FloatArray] = {}
        for place in self._places_mm:
            key = self._key(place)
            if key not in self._rotated:
                check_wish()
                self._rotated[key] = kernels.at(*key)

    def of(self, channel: int) -> FloatArray:
        """Return the kernels (node, n, n) of a channel."""
        node_kernels = []
        for place, light in zip(self._places_mm, self._light, strict=True):
            kernel = self._rotated[self._key(place)][channel]
            if self._turns:
                kernel = kernel[:: -1 if place[1] < 0 else 1, :: -1 if place[0] < 0 else 1]
            node_kernels.append(kernel * np.float32(light[channel]))
        return np.stack(node_kernels)

    def _key(self, place_mm: FloatGrid) -> tuple[float, float]:
        """Return the place, or of turned kernels that which mirrors it."""
        x, y = (round(float(coordinate), 9) for coordinate in place_mm)
        return (abs(x), abs(y)) if self._turns else (x, y)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FewKernels:
    """Kernels whose weighed sums are nearly those of the nodes.

    Attributes:
        kernels: (term, n, n) float32, n odd.
        weights: (node, term) float32.
    """

    kernels: FloatArray
    weights: FloatArray


class PlaceBlur:
    """The blur of one colour of a coarse picture; immutable."""

    def __init__(self, few: FewKernels, nodes: Nodes, *, threads: int = 1) -> None:
        """Interpolate the weights of the few kernels over the picture.

        Args:
            few: By `few_kernels`.
            nodes: For whose kernels they stand.
            threads: Threads to compute with; no influence on the bits.

        Raises:
            ContractError: If they do not stand for one kernel of each node.
        """
        kernels, weights = few.kernels, few.weights
        if len(weights) != len(nodes.places_mm):
            raise ContractError(
                f"{len(nodes.places_mm)} nodes need a kernel each; got {len(weights)}"
            )
        import scipy.fft

        check_wish()
        height, width = nodes.near.shape[:2]
        self._size = height, width
        blend = np.zeros((height, width, len(kernels)), np.float32)
        for near, share in zip(
            np.moveaxis(nodes.near, -1, 0), np.moveaxis(nodes.share, -1, 0), strict=True
        ):
            blend += share[..., None] * weights.take(near, axis=0)
        self._weights = np.ascontiguousarray(np.moveaxis(blend, -1, 0))
        half = kernels.shape[-1] // 2
        # what comes round from the other side falls beside the picture
        self._full = tuple(scipy.fft.next_fast_len(side + half, real=True) for side in self._size)
        self._threads = threads
        self._spectra = np.stack(run_parts(self._spectrum, list(kernels), threads=threads))

    def __call__(self, light: FloatArray) -> FloatArray:
        """Return the blur (h, w) float32 of a picture (h, w); beyond it there is no light."""
        check_wish()

        def some(first: int) -> NDArray[np.complex64]:
            total = np.zeros(self._spectra.shape[1:], np.complex64)
            those = slice(first, first + TERMS_AT_ONCE)
            for weight, spectrum in zip(self._weights[those], self._spectra[those], strict=True):
                lit = self._transform(weight * light)
                lit *= spectrum
                total += lit
            return total

        firsts = range(0, len(self._weights), TERMS_AT_ONCE)
        total, *others = run_parts(some, firsts, threads=self._threads)
        for other in others:
            total += other
        return self._inverse(total)

    def solver(self, damping: float) -> Callable[[FloatArray], FloatArray]:
        """Return an approximate inverse of the blur: the Wiener filter of its mean kernel.

        Args:
            damping: Added to the kernel's power.
        """
        share = self._weights.mean(axis=(1, 2), dtype=np.float64).astype(np.float32)
        mean = np.tensordot(share, self._spectra, axes=1)
        gain = np.conj(mean) / (np.square(np.abs(mean)) + np.float32(damping))
        return lambda picture: self._inverse(self._transform(picture) * gain)

    def _transform(self, picture: FloatArray) -> NDArray[np.complex64]:
        import scipy.fft

        return np.asarray(scipy.fft.rfft2(picture, self._full))

    def _inverse(self, spectrum: NDArray[np.complex64]) -> FloatArray:
        import scipy.fft

        height, width = self._size
        picture = scipy.fft.irfft2(spectrum, self._full)[:height, :width]
        return np.ascontiguousarray(picture, np.float32)

    def _spectrum(self, kernel: FloatArray) -> NDArray[np.complex64]:
        rows, columns = self._full
        place = np.arange(kernel.shape[-1]) - kernel.shape[-1] // 2
        padded = np.zeros(self._full, np.float32)
        np.add.at(padded, (place[:, None] % rows, place % columns), kernel)
        return self._transform(padded)


def few_kernels(kernels: FloatArray, terms: int) -> FewKernels:
    """Return few kernels that stand for many.

    Args:
        kernels: (node, n, n), n odd.
        terms: How many; with fewer nodes each kernel stands for itself.
    """
    count = len(kernels)
    if count <= terms:
        return FewKernels(kernels=kernels, weights=np.eye(count, dtype=np.float32))
    products = _products(kernels)
    squares = kernels
    for _ in range(DOUBLINGS):
        if squares.shape[-1] < 2:
            break
        check_wish()
        inside = squares[:, : squares.shape[1] // 2 * 2, : squares.shape[2] // 2 * 2]
        rows = inside[:, ::2] + inside[:, 1::2]
        squares = rows[..., ::2] + rows[..., 1::2]
        products += _products(squares)
    check_wish()
    lengths, directions = np.linalg.eigh(products)
    rank = _whole_pairs(lengths[::-1], terms)
    weights = np.ascontiguousarray(directions[:, : -rank - 1 : -1], np.float32)
    few = np.tensordot(weights.T, kernels, axes=1)
    return FewKernels(kernels=np.asarray(few, np.float32), weights=weights)


def _whole_pairs(lengths: FloatGrid, most: int) -> int:
    """Return the number of directions to keep, the longest; equal ones stay together.

    Two equally long directions, as sine and cosine of the azimuth are, may be any two of their
    plane: which of them the last bits of the kernels would decide.
    """
    rank = most
    while rank > 1 and lengths[rank - 1] - lengths[rank] < EQUAL * lengths[rank - 1]:
        rank -= 1
    return rank


def _products(kernels: FloatArray) -> FloatGrid:
    flat = kernels.reshape(len(kernels), -1)
    return np.asarray(flat @ flat.T, np.float64)
