"""The scene behind a mask: least squares on the sensor's crop, not negative, by ADMM.

    y = crop(h * v)     h: kernel as wide as the frame; v: all of the scene that reaches the sensor

The crop is part of the model, so light from beside the frame is explained where it comes from. The
scene minimises 1/2 |crop(h * v) - y|^2 + tv |grad v|_1 with v >= 0. It is split as

    x = h * v (the crop of x meets y)    w = v (w >= 0)    u = grad v (u is shrunk)

so that v follows from one division in the frequency domain, and x, w, u from one operation a
sample. Duals are scaled. Beside the crop nothing holds x back, its dual is zero there and x is
h * v; of w and u only the duals are kept, since |v + b| = w - b and s - 2 clip(s) = u - c.

References: Boyd et al. 2011, Distributed Optimization and Statistical Learning via ADMM, ch. 3;
Almeida and Figueiredo 2013, Deconvolving images with unknown boundaries using the ADMM; Antipa et
al. 2018, DiffuserCam (the crop in the model).
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Floats = NDArray[np.float32]
PLANES: Final = 9
"""Planes of the grid that are held at once, without those of the gradient (measured)."""
GRADIENT_PLANES: Final = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How the scene is sought.

    A capture is divided by its largest value and a kernel by its norm, so that these numbers mean
    the same for every exposure and most sizes. `tv` says where the rounds end, the penalties how
    soon details come: with large ones on scene and gradient few rounds leave a smooth scene.

    Attributes:
        iterations: Rounds.
        crop_penalty: Of x = h * v.
        positive_penalty: Of w = v.
        gradient_penalty: Of u = grad v; means nothing without `tv`.
        tv: Weight of the total variation; 0 for none.
    """

    iterations: int = 100
    crop_penalty: float = 1.0
    positive_penalty: float = 10.0
    gradient_penalty: float = 3.0
    tv: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """A scene and how well it explains its capture.

    Attributes:
        scene: (H, W) float32 >= 0, all of it; its blur has the units of the capture.
        window: Rows and columns of the scene that lie behind the sensor.
        residual: |crop(h * scene) - y| / |y|.
    """

    scene: Floats
    window: tuple[slice, slice]
    residual: float


class Blur:
    """h * v on the grid of all of the scene that reaches the sensor; nothing wraps into the crop.

    Attributes:
        grid_px: (H, W), at least those of capture and kernel together, less one.
        window: Of the crop.
        transfer: (H, W // 2 + 1) complex64, of the kernel.
    """

    def __init__(self, kernel: Floats, size_px: tuple[int, int], *, threads: int = 1) -> None:
        """Transform a kernel.

        Args:
            kernel: (kh, kw), odd sides.
            size_px: (h, w) of the capture.
            threads: Of the transforms; the bits do not depend on them.
        """
        self.grid_px = grid_of(size_px, kernel.shape)
        self._threads = threads
        half = tuple(side // 2 for side in kernel.shape)
        self.window = slice(half[0], half[0] + size_px[0]), slice(half[1], half[1] + size_px[1])
        padded = np.zeros(self.grid_px, np.float32)
        padded[: kernel.shape[0], : kernel.shape[1]] = kernel
        padded = np.roll(padded, (-half[0], -half[1]), axis=(0, 1))
        self.transfer = self.spectrum(padded)

    def spectrum(self, plane: Floats) -> NDArray[np.complex64]:
        """Transform a plane of the grid."""
        found: NDArray[np.complex64] = scipy.fft.rfft2(plane, workers=self._threads)
        return found

    def plane(self, spectrum: NDArray[np.complex64]) -> Floats:
        """Transform back."""
        found: Floats = scipy.fft.irfft2(spectrum, s=self.grid_px, workers=self._threads)
        return found

    def of(self, scene: Floats) -> Floats:
        """Return h * scene on the whole grid."""
        return self.plane(self.spectrum(scene) * self.transfer)


def grid_of(size_px: tuple[int, ...], kernel_px: tuple[int, ...]) -> tuple[int, int]:
    """Return (H, W) of the grid for a capture and a kernel of (h, w)."""
    rows, columns = (a + b - 1 for a, b in zip(size_px, kernel_px, strict=True))
    return scipy.fft.next_fast_len(rows), scipy.fft.next_fast_len(columns, real=True)


def solve(
    capture: Floats,
    kernel: Floats,
    settings: Settings,
    *,
    threads: int = 1,
    rounds: Iterable[object] | None = None,
) -> Solved:
    """Find the scene of a capture.

    Args:
        capture: (h, w), linear; noise may take it below zero.
        kernel: (kh, kw) >= 0, odd sides, sum 1.
        settings: Rounds and penalties.
        threads: Of the transforms; the bits do not depend on them.
        rounds: Asked for one item before every round; may count them, or end the work by raising.
            None for those of the settings.
    """
    peak = float(np.abs(capture).max()) or 1.0
    norm = float(np.sqrt(np.square(kernel, dtype=np.float64).sum()))
    blur = Blur(kernel / np.float32(norm), capture.shape, threads=threads)
    data = capture / np.float32(peak)
    scene = _rounds(data, blur, settings, range(settings.iterations) if rounds is None else rounds)
    np.maximum(scene, 0, out=scene)
    missed = float(np.linalg.norm(blur.of(scene)[blur.window] - data))
    scene *= np.float32(peak / norm)
    return Solved(
        scene=scene,
        window=blur.window,
        residual=missed / (float(np.linalg.norm(data)) or 1.0),
    )


def _rounds(data: Floats, blur: Blur, settings: Settings, rounds: Iterable[object]) -> Floats:
    """Return v after all rounds."""
    crop, positive = np.float32(settings.crop_penalty), np.float32(settings.positive_penalty)
    divisor = crop * np.square(np.abs(blur.transfer)) + positive
    gradient = None
    if settings.tv:
        gradient = _Gradient(settings, blur.grid_px)
        divisor += gradient.divisor(blur)
    inverse = 1 / divisor
    del divisor
    scene = np.zeros(blur.grid_px, np.float32)
    blurred, dual = np.zeros_like(scene), np.zeros_like(scene)
    crop_dual = np.zeros_like(data)
    for _ in rounds:
        seen = blurred[blur.window] + crop_dual
        fitted = (data + crop * seen) / (np.float32(1) + crop)
        np.subtract(seen, fitted, out=crop_dual)
        blurred[blur.window] = fitted - crop_dual
        dual += scene
        wanted = np.abs(dual) * positive
        np.minimum(dual, 0, out=dual)
        if gradient is not None:
            gradient.pull(scene, wanted)
        sought = blur.spectrum(blurred)
        sought *= np.conj(blur.transfer)
        sought *= crop
        sought += blur.spectrum(wanted)
        sought *= inverse
        del wanted
        scene = blur.plane(sought)
        sought *= blur.transfer
        blurred = blur.plane(sought)
    return scene


class _Gradient:
    """u = grad v: differences to the neighbours above and to the left, the last ones wrapped."""

    def __init__(self, settings: Settings, grid_px: tuple[int, int]) -> None:
        self._penalty = np.float32(settings.gradient_penalty)
        self._most = np.float32(settings.tv / settings.gradient_penalty)
        self._duals = [np.zeros(grid_px, np.float32) for _ in range(2)]

    def divisor(self, blur: Blur) -> Floats:
        """Return what the differences add to the divisor of v."""
        squared = np.zeros(blur.grid_px, np.float32)
        squared[0, 0] = 4
        for at in ((0, 1), (1, 0), (0, -1), (-1, 0)):
            squared[at] -= 1
        return self._penalty * blur.spectrum(squared).real

    def pull(self, scene: Floats, wanted: Floats) -> None:
        """Shrink the differences, and add what they want v to be."""
        for axis, kept in enumerate(self._duals):
            free = kept + np.roll(scene, 1, axis) - scene
            np.clip(free, -self._most, self._most, out=kept)
            free -= 2 * kept
            wanted += self._penalty * (np.roll(free, -1, axis) - free)
