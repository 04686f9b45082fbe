"""Light spread by a kernel over a window, and the transpose of that."""

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.errors import ContractError


class Convolution:
    """A kernel made ready for windows of one size; what leaves a window is lost."""

    def __init__(self, kernel: FloatArray, shape: tuple[int, int]) -> None:
        """Make ready.

        Args:
            kernel: (n, n) float32, n odd.
            shape: (h, w) of the windows.

        Raises:
            ContractError: If the kernel has no middle.
        """
        if kernel.ndim != 2 or kernel.shape[0] != kernel.shape[1] or kernel.shape[0] % 2 == 0:
            raise ContractError(f"a kernel is square with an odd side; got {kernel.shape}")
        self._shape = shape
        # farther than a window is wide nothing in it is lit
        half = min(kernel.shape[0] // 2, max(shape) - 1)
        middle = kernel.shape[0] // 2
        inside = slice(middle - half, middle + half + 1)
        self._size = tuple(scipy.fft.next_fast_len(side + half, real=True) for side in shape)
        place = np.arange(-half, half + 1)
        wrapped = np.zeros(self._size, np.float32)
        # where a window is shorter than the kernel, both ends meet in the padding
        np.add.at(
            wrapped,
            (place[:, None] % self._size[0], place[None, :] % self._size[1]),
            kernel[inside, inside],
        )
        self._transform = scipy.fft.rfft2(wrapped)

    def spread(self, light: FloatArray) -> FloatArray:
        """Give what light (h, w) becomes."""
        return self._filtered(light, self._transform)

    def gathered(self, image: FloatArray) -> FloatArray:
        """Give the transpose: for every place, what its light would meet in an image (h, w)."""
        return self._filtered(image, self._transform.conj())

    def _filtered(self, image: FloatArray, transform: NDArray[np.complex64]) -> FloatArray:
        whole = scipy.fft.irfft2(scipy.fft.rfft2(image, self._size) * transform, self._size)
        height, width = self._shape
        return np.asarray(whole[:height, :width], np.float32)
