"""Classical restorations to be compared with: scikit-image's Wiener and Richardson-Lucy, ADMM-TV.

    developed planes + the PSF of the crop's centre -> padded -> method, one parameter -> planes

All of them see the white-balanced, demosaicked, linear planes and one local PSF per colour; nothing
is clipped. scikit-image has no ADMM with total variation, so that one is camkit's own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from skimage import restoration

from camkit.contracts import FloatArray, NoiseModel
from camkit.errors import ContractError
from camkit.runtime.bank.baselines import admm_tv_filter
from camkit.runtime.bank.blocks import BlockBank, LocalPsf
from camkit.runtime.geometry.sensor_window import SensorWindow

KERNEL_ENERGY: Final = 0.999
"""Share of the light of every colour that the local kernels keep; a smaller kernel is faster."""
OVERLAP_PX: Final = 160
"""Of the block grid; a block that is larger than the crop by this much covers it alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalCapture:
    """A developed crop and what is known about its blur and noise.

    Attributes:
        planes: (3, h, w) float32, linear, white-balanced camera RGB, vignetting still in.
        kernels: (3, k, k) float32, odd side, the PSF at the middle of the crop per colour.
        noise: Noise of the planes.
        saturated: (h, w) or (3, h, w), true where the sensor clipped; None if nowhere.
        window: Place of the crop on the sensor.
    """

    planes: FloatArray
    kernels: FloatArray
    noise: NoiseModel
    saturated: NDArray[np.bool_] | None
    window: SensorWindow

    def __post_init__(self) -> None:
        if self.planes.ndim != 3 or self.planes.shape[0] != 3:
            raise ContractError(f"planes must be (3, h, w); got {self.planes.shape}")
        shape = self.kernels.shape
        if len(shape) != 3 or shape[0] != 3 or shape[1] != shape[2] or shape[1] % 2 == 0:
            raise ContractError(f"kernels must be (3, k, k) with k odd; got {shape}")


Restore = Callable[[LocalCapture, float], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A classical method with its one parameter.

    Attributes:
        restore: Function of capture and parameter.
        parameter: Name of the parameter.
        candidates: Values that the tuning tries, increasing.
    """

    restore: Restore
    parameter: str
    candidates: tuple[float, ...]


def trim_kernels(kernels: FloatArray, energy: float = KERNEL_ENERGY) -> FloatArray:
    """Cut (3, k, k) kernels to the smallest odd side that keeps a share of every colour's light.

    Returns:
        (3, s, s) float32, each sums to 1.
    """
    half = kernels.shape[-1] // 2
    for radius in range(half + 1):
        cut = kernels[:, half - radius : half + radius + 1, half - radius : half + radius + 1]
        sums = cut.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
        if sums.min() >= energy:
            return np.asarray(cut / sums, dtype=np.float32)
    raise ContractError(f"the kernels hold less than {energy} of the light; they must sum to 1")


def wiener(capture: LocalCapture, balance: float) -> FloatArray:
    """Restore with `skimage.restoration.wiener`, its own Laplacian as regulariser.

    The filter takes the picture for periodic, so the padded border is tapered first.

    Args:
        capture: The developed crop.
        balance: Weight of the regulariser.

    References: scikit-image documentation, `skimage.restoration.wiener`.
    """
    return _each_plane(
        capture,
        lambda plane, kernel: restoration.wiener(
            _taper(plane, kernel), kernel, balance, clip=False
        ),
    )


def richardson_lucy(capture: LocalCapture, iterations: float) -> FloatArray:
    """Restore with `skimage.restoration.richardson_lucy`; negative samples are set to 0 first.

    References: scikit-image documentation, `skimage.restoration.richardson_lucy`.
    """
    return _each_plane(
        capture,
        lambda plane, kernel: restoration.richardson_lucy(
            np.maximum(plane, 0), kernel, num_iter=int(iterations), clip=False
        ),
    )


def admm_tv(capture: LocalCapture, weight: float) -> FloatArray:
    """Restore with camkit's ADMM with total variation and one PSF everywhere.

    Args:
        capture: The developed crop.
        weight: Strength of the total variation, see `admm_tv_filter`.
    """
    psf = LocalPsf(
        kernels=capture.kernels[None], field_heights_mm=np.zeros(1), window=capture.window
    )
    widest = max(*capture.planes.shape[1:], OVERLAP_PX) + OVERLAP_PX
    bank = BlockBank(
        psf,
        admm_tv_filter(capture.noise, weight=weight),
        block_px=4 * scipy.fft.next_fast_len(-(-widest // 4), real=True),
        overlap_px=OVERLAP_PX,
        threads=1,
    )
    return bank.restore_array(capture.planes, capture.saturated)


PEERS: Final[dict[str, Peer]] = {
    "skimage_wiener": Peer(
        restore=wiener,
        parameter="balance",
        candidates=(3e-3, 1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 10.0),
    ),
    "skimage_rl": Peer(
        restore=richardson_lucy,
        parameter="iterations",
        candidates=(4.0, 8.0, 12.0, 16.0, 24.0, 32.0, 48.0, 64.0),
    ),
    "admm_tv": Peer(
        restore=admm_tv,
        parameter="weight",
        candidates=(0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 300.0),
    ),
}


def _each_plane(
    capture: LocalCapture, restore: Callable[[FloatArray, FloatArray], FloatArray]
) -> FloatArray:
    """Restore every colour on a mirrored border of at least the kernel, and cut it off again."""
    _, height, width = capture.planes.shape
    margin = capture.kernels.shape[-1]
    rows, columns = (_border(side, margin) for side in (height, width))
    restored = np.empty_like(capture.planes)
    for plane, kernel, out in zip(capture.planes, capture.kernels, restored, strict=True):
        padded = np.pad(plane, (rows, columns), mode="reflect")
        sharp = restore(padded, kernel)
        out[:] = sharp[rows[0] : rows[0] + height, columns[0] : columns[0] + width]
    return restored


def _taper(plane: FloatArray, kernel: FloatArray) -> FloatArray:
    """Blend the outermost kernel width of a padded plane to its own periodic blur.

    References: Reeves 2005 (edge taper as pre-processing).
    """
    side = kernel.shape[-1]
    spread = np.zeros(plane.shape, dtype=np.float32)
    spread[:side, :side] = kernel
    spread = np.roll(spread, (-(side // 2), -(side // 2)), axis=(0, 1))
    blurred = scipy.fft.irfft2(scipy.fft.rfft2(plane) * scipy.fft.rfft2(spread), s=plane.shape)
    rise = np.sin(np.pi / 2 * (np.arange(side, dtype=np.float32) + 0.5) / side) ** 2
    keep = []
    for length in plane.shape:
        line = np.ones(length, dtype=np.float32)
        line[:side] = rise
        keep.append(np.minimum(line, line[::-1]))
    return np.asarray(blurred + keep[0][:, None] * keep[1] * (plane - blurred), dtype=np.float32)


def _border(side_px: int, margin_px: int) -> tuple[int, int]:
    """Give the border before and after, which makes an even length that an FFT likes."""
    wanted = side_px + 2 * margin_px
    total = scipy.fft.next_fast_len(wanted + wanted % 2, real=True)
    while total % 2:
        total = scipy.fft.next_fast_len(total + 1, real=True)
    spare = total - side_px
    return spare // 2, spare - spare // 2
