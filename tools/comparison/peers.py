"""Classical restorations: scikit-image's Wiener and Richardson-Lucy, ADMM-TV, cross-channel.

    developed planes -> overlapping parts, mirrored and tapered -> method, each part with the PSF of
    its own place -> windowed sum

All of them see the white-balanced, demosaicked, linear planes and the bundle's PSF per colour;
nothing is clipped. Their parameters are tuned, see `tools.comparison.tuning`. scikit-image has
neither ADMM with total variation nor the cross-channel prior, so these are camkit's own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray
from skimage import restoration
from skimage.restoration import uft

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, BlockBank, BlockFilter, LocalPsf
from camkit.runtime.bank.cross_channel import cross_channel_filter
from camkit.runtime.bank.spectrum import ComplexArray, apply_transfer
from camkit.runtime.bank.total_variation import admm_tv_filter

PART_STEP_PX: Final = 128
"""Parts overlap by the least multiple of this that is as wide as the kernel but one pixel."""
PARTS_PER_OVERLAP: Final = 3
"""Side of a part in overlaps; larger parts cost more and fit the PSF of their places less."""
LEAST_LIGHT: Final = np.float32(1e-6)

Setting = tuple[float, ...]
"""Values of a peer's parameters, in the order of `Peer.parameters`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LocalCapture:
    """A developed crop and what is known about its blur and noise.

    Attributes:
        planes: (3, h, w) float32, linear, white-balanced camera RGB, vignetting still in.
        psf: The kernels per colour and the place of the crop on the sensor.
        noise: Noise of the planes.
        saturated: (1 or 3, h, w), true where the sensor clipped; None if nowhere.
    """

    planes: FloatArray
    psf: LocalPsf
    noise: NoiseModel
    saturated: NDArray[np.bool_] | None

    def __post_init__(self) -> None:
        width, height = self.psf.window.size_px
        if self.planes.shape != (3, height, width):
            raise ContractError(f"planes must be (3, {height}, {width}); got {self.planes.shape}")


FilterMaker = Callable[[NoiseModel, Setting], BlockFilter]


@dataclass(frozen=True, slots=True, kw_only=True)
class Peer:
    """A classical method with its parameters.

    Attributes:
        make_filter: Gives the restoration of one part, of noise and parameters.
        parameters: Names of the parameters.
        candidates: Increasing values that the tuning tries for each parameter, all jointly.
    """

    make_filter: FilterMaker
    parameters: tuple[str, ...]
    candidates: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        if len(self.parameters) != len(self.candidates):
            raise ContractError(
                f"every parameter needs its candidates; got {self.parameters}, {self.candidates}"
            )

    @property
    def settings(self) -> tuple[Setting, ...]:
        """Return all settings that the tuning tries."""
        return tuple(product(*self.candidates))

    def restore(self, capture: LocalCapture, setting: Setting) -> FloatArray:
        """Restore a crop, on one thread.

        Args:
            capture: The developed crop.
            setting: A value for each parameter.

        Returns:
            (3, h, w) float32.

        Raises:
            ContractError: If the setting is not one value per parameter.
        """
        if len(setting) != len(self.parameters):
            raise ContractError(f"expected {', '.join(self.parameters)}; got {setting}")
        part_px, overlap_px = part_sides(capture.psf.kernels.kernels.shape[-1])
        bank = BlockBank(
            capture.psf,
            self.make_filter(capture.noise, setting),
            block_px=part_px,
            overlap_px=overlap_px,
            threads=1,
        )
        return bank.restore_array(capture.planes, capture.saturated)

    def describe(self, setting: Setting) -> str:
        """Return the setting as text."""
        pairs = zip(self.parameters, setting, strict=True)
        return ", ".join(f"{name} {value:g}" for name, value in pairs)


def part_sides(kernel_px: int) -> tuple[int, int]:
    """Return side and overlap of the parts, for kernels of a side."""
    overlap_px = PART_STEP_PX * max(1, -(-(kernel_px - 1) // PART_STEP_PX))
    return PARTS_PER_OVERLAP * overlap_px, overlap_px


def wiener_part(noise: NoiseModel, setting: Setting) -> BlockFilter:
    """Return `skimage.restoration.wiener` with its own Laplacian as regulariser.

    Args:
        noise: Not used; the balance is tuned for each ISO.
        setting: The balance, weight of the regulariser.

    References: scikit-image documentation, `skimage.restoration.wiener`.
    """
    del noise
    (balance,) = setting

    def restore(block: Block) -> FloatArray:
        side = block.samples.shape[-1]
        # scikit-image drops the imaginary part of a transfer function, so it gets the kernel
        kernels = scipy.fft.irfft2(block.otf, s=(side, side))
        kernels = np.roll(kernels, (side // 2, side // 2), axis=(-2, -1))
        planes = [
            restoration.wiener(plane, kernel, balance, reg=_laplacian(side), clip=False)
            for plane, kernel in zip(block.samples, kernels, strict=True)
        ]
        return np.asarray(planes, dtype=np.float32)

    return restore


def richardson_lucy_part(noise: NoiseModel, setting: Setting) -> BlockFilter:
    """Return the rounds of `skimage.restoration.richardson_lucy`, on the transfer function.

    The same rounds, but each convolution reuses the transform of the kernel: four transforms a
    round in place of six longer ones. Negative samples count as no light.

    Args:
        noise: Not used; the iterations are tuned for each ISO.
        setting: The number of iterations.

    References: scikit-image documentation, `skimage.restoration.richardson_lucy`.
    """
    del noise
    (iterations,) = setting

    def restore(block: Block) -> FloatArray:
        measured = np.maximum(block.samples, 0)
        back = np.conj(block.otf)
        sharp = np.full_like(measured, 0.5)
        for _ in range(int(iterations)):
            ratio = np.maximum(apply_transfer(sharp, block.otf), LEAST_LIGHT)
            np.divide(measured, ratio, out=ratio)
            # the transform's rounding may leave less than nothing, which would grow
            sharp *= np.maximum(apply_transfer(ratio, back), 0)
        return sharp

    return restore


def admm_tv_part(noise: NoiseModel, setting: Setting) -> BlockFilter:
    """Return camkit's ADMM with total variation.

    Args:
        noise: Sets the unit of the weight and the steps.
        setting: Weight of the total variation, and the iterations, see `admm_tv_filter`.
    """
    weight, iterations = setting
    return admm_tv_filter(noise, weight=weight, iterations=int(iterations))


def cross_channel_part(noise: NoiseModel, setting: Setting) -> BlockFilter:
    """Return camkit's cross-channel deconvolution.

    Args:
        noise: Sets the unit of the weights and the steps.
        setting: Weights of total variation and prior, see `cross_channel_filter`.
    """
    tv_weight, cross_weight = setting
    return cross_channel_filter(noise, tv_weight=tv_weight, cross_weight=cross_weight)


PEERS: Final[dict[str, Peer]] = {
    "skimage_wiener": Peer(
        make_filter=wiener_part,
        parameters=("balance",),
        candidates=((1e-2, 3e-2, 1e-1, 3e-1, 1.0, 3.0, 10.0),),
    ),
    "skimage_rl": Peer(
        make_filter=richardson_lucy_part,
        parameters=("iterations",),
        candidates=((8, 12, 16, 24, 40, 64),),
    ),
    "admm_tv": Peer(
        make_filter=admm_tv_part,
        parameters=("weight", "iterations"),
        candidates=((2.5, 5, 10, 20, 40), (6, 12, 24)),
    ),
    "cross_channel": Peer(
        make_filter=cross_channel_part,
        parameters=("tv_weight", "cross_weight"),
        candidates=((0.3, 0.6, 1.25, 2.5, 5), (10, 20, 40, 80)),
    ),
}


@lru_cache(maxsize=4)
def _laplacian(side_px: int) -> ComplexArray:
    """Return the regulariser that scikit-image would make for every call, (b, b // 2 + 1)."""
    transfer, _ = uft.laplacian(2, (side_px, side_px))
    return np.asarray(transfer, dtype=np.complex64)
