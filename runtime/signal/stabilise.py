"""The noise-stabilising transform before and behind the network: k-sigma, then square root."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import ContractError
from camkit.runtime.rows import PiecedRows
from camkit.runtime.slices import run_chunks

DEFAULT_SCALE: Final = 64.0


def stabilise(
    planes: FloatArray,
    noise: NoiseModel,
    *,
    scale: float = DEFAULT_SCALE,
    out: FloatArray | None = None,
) -> FloatArray:
    """Give s = sqrt(max(x / shot + read_variance / shot^2, 0)) / scale.

    The noise of s has the standard deviation 0.5 / scale at any gain.

    Args:
        planes: (3, h, w) float32, linear, white balanced.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.
        out: (3, h, w) float32 to fill; a new array when None.

    Returns:
        (3, h, w) float32 >= 0.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    References: Wang et al. 2020 (k-sigma); Anscombe 1948.
    """
    slope, offset = _line(planes, noise, scale)
    stable = np.multiply(planes, slope, out=out)
    stable += offset
    np.maximum(stable, 0, out=stable)
    return np.asarray(np.sqrt(stable, out=stable))


def unstabilise(
    stable: FloatArray,
    noise: NoiseModel,
    *,
    scale: float = DEFAULT_SCALE,
    out: FloatArray | None = None,
) -> FloatArray:
    """Undo `stabilise`: x = shot * ((max(s, 0) * scale)^2 - read_variance / shot^2).

    Args:
        stable: (3, h, w) float32 of `stabilise`.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.
        out: (3, h, w) float32 to fill, may be `stable`; a new array when None.

    Returns:
        (3, h, w) float32, linear.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    """
    slope, offset = _line(stable, noise, scale)
    planes = np.maximum(stable, 0, out=out)
    np.square(planes, out=planes)
    planes -= offset
    planes /= slope
    return np.asarray(planes)


class NetworkRows:
    """What a network is given: the stabilised capture and, below it, the stabilised Wiener planes.

    Equal to stacking both sources and mapping them, with two copies of every sample fewer.
    """

    def __init__(
        self,
        planes: PiecedRows,
        restored: PiecedRows,
        noise: NoiseModel,
        *,
        scale: float,
        threads: int = 1,
    ) -> None:
        """Name the sources.

        Args:
            planes: (3, h, w) linear, white balanced.
            restored: (3, h, w) likewise, of the Wiener bank.
            noise: Noise after white balance.
            scale: Divisor behind the square root.
            threads: Threads that share the rows of one read; no influence on the bits.

        Raises:
            ContractError: If the sources differ in size.
        """
        if planes.shape != restored.shape:
            raise ContractError(
                f"capture and Wiener planes must have one size; got {planes.shape}, "
                f"{restored.shape}"
            )
        self._sources = planes, restored
        self._noise, self._scale, self._threads = noise, scale, threads

    @property
    def shape(self) -> tuple[int, int, int]:
        """Give (6, h, w)."""
        channels, height, width = self._sources[0].shape
        return 2 * channels, height, width

    def read(self, top: int, bottom: int) -> FloatArray:
        """Give the rows top..bottom, (6, rows, w)."""
        halves = [source.pieces(top, bottom) for source in self._sources]
        stable = np.empty((6, bottom - top, self.shape[2]), dtype=np.float32)
        for pieces, half in zip(halves, (stable[:3], stable[3:]), strict=True):
            filled = 0
            for piece in pieces:
                self._fill(half[:, filled : filled + piece.shape[1]], piece)
                filled += piece.shape[1]
        return stable

    def _fill(self, out: FloatArray, piece: FloatArray) -> None:
        def work(first: int, last: int) -> None:
            rows = np.s_[:, first:last]
            stabilise(piece[rows], self._noise, scale=self._scale, out=out[rows])

        run_chunks(work, piece.shape[1], piece.shape[2], threads=self._threads)


def _line(planes: FloatArray, noise: NoiseModel, scale: float) -> tuple[FloatArray, FloatArray]:
    """Give slope and offset, (3, 1, 1) each, of s^2 as a line in x."""
    shot = np.array(noise.shot, dtype=np.float64)[:, None, None]
    read_variance = np.array(noise.read_variance, dtype=np.float64)[:, None, None]
    if planes.ndim != 3 or planes.shape[0] != 3:
        raise ContractError(f"planes must be (3, h, w); got {planes.shape}")
    if (shot <= 0).any() or not (np.isfinite(scale) and scale > 0):
        raise ContractError(
            f"the transform needs shot noise > 0 and a scale > 0; got {noise.shot} and {scale}"
        )
    slope: NDArray[np.float64] = 1 / (shot * scale * scale)
    return slope.astype(np.float32), (slope * read_variance / shot).astype(np.float32)
