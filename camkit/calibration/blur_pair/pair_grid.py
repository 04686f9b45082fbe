"""Blocks of a picture, each blurred by a transfer function of its own.

|<- halo ->|<--- block --->|<- halo ->|     one transform; the middle is kept
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from camkit.arrays import FloatArray

Transfer = NDArray[np.complex128] | NDArray[np.complex64] | NDArray[np.float64]

COLUMNS: Final = 12
"""Of blocks across a picture."""
LEAST_BLOCK_PX: Final = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A square of a picture.

    Attributes:
        index: In reading order.
        row: Of its first pixel.
        column: Of its first pixel.
        y_px: Its middle from the middle of the picture, down.
        x_px: Likewise, right.
        is_even: Whether it is one of the even squares of a checkerboard.
    """

    index: int
    row: int
    column: int
    y_px: float
    x_px: float
    is_even: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class PairGrid:
    """The blocks of a picture.

    Attributes:
        height: Of the picture, px.
        width: Of the picture, px.
        side_px: Of a block.
        halo_px: About a block, as far as blur reaches.
    """

    height: int
    width: int
    side_px: int
    halo_px: int

    @classmethod
    def of(cls, size: tuple[int, int], halo_px: int) -> "PairGrid":
        """Return the usual blocks of a picture of (height, width)."""
        side = max(LEAST_BLOCK_PX, 16 * round(size[1] / COLUMNS / 16))
        return cls(height=size[0], width=size[1], side_px=side, halo_px=halo_px)

    @property
    def transform_px(self) -> int:
        """Return the side of the transform of a block."""
        return int(fft.next_fast_len(self.side_px + 2 * self.halo_px, real=True))

    @property
    def frequencies(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return cycles per pixel, (n, 1) down and (1, n // 2 + 1) across."""
        side = self.transform_px
        return fft.fftfreq(side)[:, None], fft.rfftfreq(side)[None]

    def blocks(self) -> list[Block]:
        """Return the blocks in reading order."""
        side = self.side_px
        rows, columns = -(-self.height // side), -(-self.width // side)
        squares = []
        for index in range(rows * columns):
            i, j = divmod(index, columns)
            bottom, right = min((i + 1) * side, self.height), min((j + 1) * side, self.width)
            squares.append(
                Block(
                    index=index,
                    row=i * side,
                    column=j * side,
                    y_px=(i * side + bottom - self.height) / 2,
                    x_px=(j * side + right - self.width) / 2,
                    is_even=(i + j) % 2 == 0,
                )
            )
        return squares

    def indices(self) -> NDArray[np.intp]:
        """Return the block (h, w) that every pixel is in."""
        side = self.side_px
        rows, columns = np.arange(self.height) // side, np.arange(self.width) // side
        return np.asarray(rows[:, None] * -(-self.width // side) + columns[None])

    def blurred(self, light: FloatArray, transfer: Callable[[Block], Transfer]) -> FloatArray:
        """Return a picture blurred block by block.

        Args:
            light: (c, h, w).
            transfer: Of a block, (c or 1, n, n // 2 + 1) at `frequencies`.
        """
        side, halo, size = self.side_px, self.halo_px, self.transform_px
        tail_px = size - side - halo + side
        padded = np.pad(light, ((0, 0), (halo, tail_px), (halo, tail_px)), mode="symmetric")
        result = np.empty_like(light)
        for block in self.blocks():
            i, j = block.row, block.column
            patch = padded[:, i : i + size, j : j + size]
            turned = fft.irfft2(fft.rfft2(patch) * transfer(block), s=(size, size))
            part = result[:, i : i + side, j : j + side]
            part[:] = turned[:, halo : halo + part.shape[1], halo : halo + part.shape[2]]
        return result

    def shifted(self, shift_px: tuple[float, float]) -> Transfer:
        """Return the transfer (1, n, n // 2 + 1) that reads a picture at p + shift (x, y)."""
        down, across = self.frequencies
        phase = 2j * np.pi * (down * shift_px[1] + across * shift_px[0])
        return np.asarray(np.exp(phase)[None])
