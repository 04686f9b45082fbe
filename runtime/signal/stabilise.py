"""The noise-stabilising transform before and behind the network: k-sigma, then square root."""

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.machine.slices import run_chunks
from camkit.runtime.rows import PiecedRows, RowSource

DEFAULT_SCALE: Final = 64.0
FAMILIAR_READ: Final = 3.0
"""Stabilised black lies at the read noise in electrons, so a network knows black by it. `duet`,
trained with 3 electrons, gives a dark frame its mean within 0.2 of its noise for 3 to 10 electrons;
told 15 electrons it is off by 1.3 times the noise, told 20 by 2.9 times and told 0.5 by 3.6 times.
"""
LEAST_FAMILIAR_E: Final = 1.0


def stabilise(
    planes: FloatArray,
    noise: NoiseModel,
    *,
    scale: float = DEFAULT_SCALE,
    out: FloatArray | None = None,
) -> FloatArray:
    """Return s = sqrt(max(x / shot + read_variance / shot^2, 0)) / scale.

    The noise of s has the standard deviation 0.5 / scale at any gain.

    Args:
        planes: (c, h, w) float32, linear, white balanced.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.
        out: (c, h, w) float32 to fill; a new array when None.

    Returns:
        (c, h, w) float32 >= 0.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    References: Wang et al. 2020 (k-sigma); Anscombe 1948.
    """
    slope, offset = _line(planes, noise, scale)
    stable = np.multiply(planes, slope, out=out)
    stable += offset
    np.maximum(stable, 0, out=stable)
    return np.asarray(np.sqrt(stable, out=stable))


def stabilised_level(share: float, noise: NoiseModel, *, scale: float) -> FloatArray:
    """Return (c, 1, 1): the stabilised value of a share of white in every channel."""
    light = np.full((len(noise.shot), 1, 1), share, np.float32)
    return stabilise(light, noise, scale=scale)


def unstabilise(
    stable: FloatArray,
    noise: NoiseModel,
    *,
    scale: float = DEFAULT_SCALE,
    out: FloatArray | None = None,
) -> FloatArray:
    """Undo `stabilise`: x = shot * ((max(s, 0) * scale)^2 - read_variance / shot^2).

    Args:
        stable: (c, h, w) float32 of `stabilise`.
        noise: Noise after white balance; shot > 0.
        scale: Divisor behind the square root.
        out: (c, h, w) float32 to fill, may be `stable`; a new array when None.

    Returns:
        (c, h, w) float32, linear.

    Raises:
        ContractError: If the noise has no shot part or the shapes disagree.
    """
    slope, offset = _line(stable, noise, scale)
    planes = np.maximum(stable, 0, out=out)
    np.square(planes, out=planes)
    planes -= offset
    planes /= slope
    return np.asarray(planes)


def familiar_noise(noise: NoiseModel, trained_reads_e: Sequence[float]) -> NoiseModel:
    """Return the noise closest to a capture's whose read noise a network has been trained with.

    Planes are stabilised by it and taken back by it: what the network makes of them changes, the
    light they stand for does not. Where a capture has less read noise, black is lifted to where the
    network knows it. Where it has more, the noise at black stays and counts as fewer electrons.

    Args:
        noise: Of the capture, at any gain; shot > 0.
        trained_reads_e: Read noises of the sensor, in electrons, >= 0; at least one.

    Returns:
        `noise` itself where it is familiar.
    """
    low_e = min(trained_reads_e)
    high_e = max(FAMILIAR_READ * max(trained_reads_e), LEAST_FAMILIAR_E)
    shots, reads = [], []
    for shot, read in zip(noise.shot, noise.read_variance, strict=True):
        shots.append(max(shot, math.sqrt(read) / high_e))
        reads.append(max(read, (low_e * shot) ** 2))
    return NoiseModel(shot=tuple(shots), read_variance=tuple(reads))


class StackedRows:
    """The input of a network: its planes below one another, stabilised unless used as they are.

    Equal to stacking the sources and mapping them, with two copies of every sample fewer.
    """

    def __init__(
        self,
        sources: Sequence[PiecedRows],
        noises: Sequence[NoiseModel] | None,
        *,
        scale: float = DEFAULT_SCALE,
        threads: int = 1,
        masks: Sequence[RowSource] = (),
    ) -> None:
        """Store the sources.

        Args:
            sources: (c, h, w) each, of one size.
            noises: Noise of each, to stabilise it by; None hands the planes on as they are.
            scale: Divisor behind the square root.
            threads: Threads that share the rows of one read; no influence on the bits.
            masks: What comes below the planes as it is.

        Raises:
            ContractError: If the sources differ in size.
        """
        sizes = [source.shape[1:] for source in (*sources, *masks)]
        if len(set(sizes)) != 1:
            raise ContractError(f"the planes of a network must have one size; got {sizes}")
        self._sources = tuple(sources)
        self._noises, self._masks = noises, tuple(masks)
        self._scale, self._threads = scale, threads

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (c, h, w) of all sources together."""
        _, height, width = self._sources[0].shape
        stacked: tuple[PiecedRows | RowSource, ...] = (*self._sources, *self._masks)
        return sum(source.shape[0] for source in stacked), height, width

    def read(self, top: int, bottom: int) -> FloatArray:
        """Return the rows top..bottom, (c, rows, w)."""
        parts = [source.pieces(top, bottom) for source in self._sources]
        stacked = np.empty((self.shape[0], bottom - top, self.shape[2]), dtype=np.float32)
        start = 0
        for number, pieces in enumerate(parts):
            end = start + self._sources[number].shape[0]
            filled = 0
            for piece in pieces:
                rows = slice(filled, filled + piece.shape[1])
                self._fill(stacked[start:end, rows], piece, number)
                filled += piece.shape[1]
            start = end
        for mask in self._masks:
            end = start + mask.shape[0]
            stacked[start:end] = mask.read(top, bottom)
            start = end
        return stacked

    def _fill(self, out: FloatArray, piece: FloatArray, number: int) -> None:
        if self._noises is None:
            out[...] = piece
            return
        noise = self._noises[number]

        def work(first: int, last: int) -> None:
            rows = np.s_[:, first:last]
            stabilise(piece[rows], noise, scale=self._scale, out=out[rows])

        run_chunks(work, piece.shape[1], piece.shape[2], threads=self._threads)


def _line(planes: FloatArray, noise: NoiseModel, scale: float) -> tuple[FloatArray, FloatArray]:
    """Return slope and offset, (c, 1, 1) each, of s^2 as a line in x."""
    shot = np.array(noise.shot, dtype=np.float64)[:, None, None]
    read_variance = np.array(noise.read_variance, dtype=np.float64)[:, None, None]
    if planes.ndim != 3 or planes.shape[0] != len(noise.shot):
        raise ContractError(f"planes must be ({len(noise.shot)}, h, w); got {planes.shape}")
    if (shot <= 0).any() or not (np.isfinite(scale) and scale > 0):
        raise ContractError(
            f"the transform needs shot noise > 0 and a scale > 0; got {noise.shot} and {scale}"
        )
    slope: NDArray[np.float64] = 1 / (shot * scale * scale)
    return slope.astype(np.float32), (slope * read_variance / shot).astype(np.float32)
