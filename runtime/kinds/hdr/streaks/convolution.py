"""Light spread by a kernel over a window, and the transpose of that.

many lights -> `Convolution`, by Fourier transforms: what it costs hangs on the window
few lights  -> `FewLights`, the kernel laid about each: what it costs hangs on their number
"""

from functools import cached_property
from typing import Final, Protocol

import numpy as np
import scipy
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

Mask = NDArray[np.bool_]
MOST_LIGHTS: Final = 128
"""More are spread by transforms, which cost as much as this many (measured)."""
MOST_VALUES: Final = 2**22
"""Kernels laid about lights, in values of 4 bytes."""


class Spread(Protocol):
    """A function that convolves the light of a window with a kernel."""

    def spread(self, light: FloatArray) -> FloatArray:
        """Return the convolution of light (h, w) with the kernel."""
        ...

    def gathered(self, image: FloatArray) -> FloatArray:
        """Return the transpose: for every place, what its light would meet in an image (h, w)."""
        ...


def spreading(kernel: FloatArray, lit: Mask, *, often: bool = False) -> Spread:
    """Return the cheaper way to spread light that lies on some cells of a window alone.

    Args:
        kernel: (n, n) float32, n odd.
        lit: (h, w): where light may be; elsewhere `gathered` need not be right.
        often: Whether it is spread more than once or twice.
    """
    count = int(np.count_nonzero(lit))
    if count <= MOST_LIGHTS and count * lit.size <= MOST_VALUES:
        return FewLights(kernel, lit, often=often)
    return Convolution(kernel, lit.shape)


class FewLights:
    """A kernel laid about each of a few lights; what leaves the window is lost."""

    def __init__(self, kernel: FloatArray, lit: Mask, *, often: bool = False) -> None:
        """Prepare the kernel about every light.

        Args:
            kernel: (n, n) float32, n odd.
            lit: (h, w): where light may be.
            often: Whether kernels are laid out at once, as `gathered` does.

        Raises:
            ContractError: If the kernel has no middle.
        """
        _check_kernel(kernel)
        self._at = np.nonzero(lit)
        height, width = self._shape = lit.shape
        half = max(height, width) - 1
        middle = kernel.shape[0] // 2
        reach = min(half, middle)
        self._wide = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
        self._wide[half - reach : half + reach + 1, half - reach : half + reach + 1] = kernel[
            middle - reach : middle + reach + 1, middle - reach : middle + reach + 1
        ]
        if often:
            _ = self._kernels

    @cached_property
    def _kernels(self) -> FloatArray:
        """Kernels about every light: (lights, h w)."""
        half, (y, x), size = self._wide.shape[0] // 2, self._at, np.prod(self._shape)
        kernels = np.lib.stride_tricks.sliding_window_view(self._wide, self._shape)
        return np.asarray(kernels[half - y, half - x].reshape(len(y), size), np.float32)

    def _kernel_at(self, y: int, x: int) -> FloatArray:
        """Return the kernel about a place (h, w)."""
        half, (height, width) = self._wide.shape[0] // 2, self._shape
        return self._wide[half - y : half - y + height, half - x : half - x + width]

    def spread(self, light: FloatArray) -> FloatArray:
        """Return the convolution of light (h, w); only allowed places count."""
        if "_kernels" in self.__dict__:
            # a sum over rows of fixed order: products of matrices hang on threads and processors
            whole = np.einsum("ji,j->i", self._kernels, light[self._at])
            return np.asarray(whole, np.float32).reshape(self._shape)
        once, product = np.zeros(self._shape, np.float32), np.empty(self._shape, np.float32)
        for y, x in zip(*self._at, strict=True):
            once += np.multiply(self._kernel_at(y, x), light[y, x], out=product)
        return once

    def gathered(self, image: FloatArray) -> FloatArray:
        """Return the transpose at the places of lights; 0 elsewhere."""
        out = np.zeros(self._shape, np.float32)
        out[self._at] = np.einsum("ji,i->j", self._kernels, image.ravel())
        return out


class Convolution:
    """A kernel made ready for windows of one size; what leaves a window is lost."""

    def __init__(self, kernel: FloatArray, shape: tuple[int, int]) -> None:
        """Prepare the transform of the kernel.

        Args:
            kernel: (n, n) float32, n odd.
            shape: (h, w) of the windows.

        Raises:
            ContractError: If the kernel has no middle.
        """
        _check_kernel(kernel)
        self._shape = shape
        # farther than a window is wide nothing in it is lit
        half = min(kernel.shape[0] // 2, max(shape) - 1)
        self._size = tuple(scipy.fft.next_fast_len(side + half, real=True) for side in shape)
        wrapped = _wrapped(kernel, half, self._size)
        self._transform = scipy.fft.rfft2(wrapped)

    def spread(self, light: FloatArray) -> FloatArray:
        """Return the convolution of light (h, w) with the kernel."""
        return self._filtered(light, self._transform)

    def gathered(self, image: FloatArray) -> FloatArray:
        """Return the transpose: for every place, what its light would meet in an image (h, w)."""
        return self._filtered(image, self._turned)

    @cached_property
    def _turned(self) -> NDArray[np.complex64]:
        """Return the transform of the kernel turned by half a turn."""
        return self._transform.conj()

    def _filtered(self, image: FloatArray, transform: NDArray[np.complex64]) -> FloatArray:
        """Multiply the transform of an image; rows that are empty or not looked at are left out."""
        (height, width), (rows, columns) = self._shape, self._size
        spectrum = scipy.fft.rfft(image, columns, axis=1)
        whole = scipy.fft.fft(spectrum, rows, axis=0, overwrite_x=True)
        whole *= transform
        there = scipy.fft.ifft(whole, axis=0, norm="forward", overwrite_x=True)[:height]
        filtered = scipy.fft.irfft(there, columns, axis=1, norm="forward")
        return np.asarray(filtered[:, :width] * np.float32(1 / (rows * columns)), np.float32)


def _wrapped(kernel: FloatArray, half: int, size: tuple[int, ...]) -> FloatArray:
    """Return a kernel's middle (2 half + 1 a side) about the first place of a periodic picture.

    Where the picture is smaller, both ends meet and are added.
    """
    middle = kernel.shape[0] // 2
    wrapped = np.zeros(size, np.float32)
    before, after = slice(middle - half, middle), slice(middle, middle + half + 1)
    for down, rows in ((-half, before), (0, after)):
        for right, columns in ((-half, before), (0, after)):
            part = kernel[rows, columns]
            at = (
                slice(shift % side, shift % side + many)
                for shift, side, many in zip((down, right), size, part.shape, strict=True)
            )
            wrapped[tuple(at)] += part
    return wrapped


def _check_kernel(kernel: FloatArray) -> None:
    if kernel.ndim != 2 or kernel.shape[0] != kernel.shape[1] or kernel.shape[0] % 2 == 0:
        raise ContractError(f"a kernel is square with an odd side; got {kernel.shape}")
