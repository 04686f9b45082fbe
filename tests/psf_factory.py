"""Small PSFs for tests: comatic kernels over field, streaks, blurred pictures, sensor windows."""

import numpy as np
import scipy.fft

from camkit.arrays import FloatArray
from camkit.noise import NoiseModel
from camkit.psf import FrozenPsf, grid_heights_mm
from camkit.radial import RadialDistortion
from camkit.runtime.bank.blocks import LocalPsf, to_otf
from camkit.runtime.bank.psf import FieldKernels
from camkit.runtime.geometry.sensor_window import SensorWindow

QUIET = NoiseModel(shot=(1e-9,) * 3, read_variance=(1e-12,) * 3)
ISO_100 = NoiseModel(shot=(2.2e-5,) * 3, read_variance=(4.4e-9,) * 3)
PITCH_UM = 10.0


def gaussian_kernel(sigma_px: float, radius_px: int = 8) -> FloatArray:
    y, x = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1]
    kernel = np.exp(-(x**2 + y**2) / (2 * sigma_px**2))
    return np.stack([kernel / kernel.sum()] * 3).astype(np.float32)


def disc_kernel(radius_px: float) -> FloatArray:
    """A defocus disc, whose OTF has zeros; its rim is soft over one pixel."""
    half = int(radius_px) + 1
    y, x = np.mgrid[-half : half + 1, -half : half + 1]
    kernel = np.clip(radius_px + 0.5 - np.hypot(x, y), 0, 1)
    return np.stack([kernel / kernel.sum()] * 3).astype(np.float32)


def coma_kernels(
    fields: int = 5, radius_px: int = 12, tail_px: float = 6.0
) -> tuple[FloatArray, np.ndarray]:
    """Kernels (field, 3, h, w) with a tail along +y that grows with height, and the heights."""
    y, x = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1].astype(float)
    shares = np.linspace(0, 1, fields)
    kernels = np.zeros((fields, 3, *x.shape))
    for i, share in enumerate(shares):
        for colour in range(3):
            for step in np.linspace(0, 1, 13):
                size = 1.0 + step * (0.3 + share) + 0.1 * colour
                centre = step * tail_px * share
                kernels[i, colour] += np.exp(-(x**2 + (y - centre) ** 2) / (2 * size**2)) / size**2
    kernels[kernels < 1e-5] = 0
    kernels /= kernels.sum(axis=(-2, -1), keepdims=True)
    return kernels.astype(np.float32), shares * 2.0


def frozen_psf(
    kernels: FloatArray, heights_mm: np.ndarray, wavelengths_um: list[float]
) -> FrozenPsf:
    """The colours of `kernels` (field, colour, h, w) as wavelength samples of one depth."""
    return FrozenPsf(
        kernels=np.ascontiguousarray(kernels[:, None, : len(wavelengths_um)]),
        field_heights_mm=heights_mm,
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array(wavelengths_um),
        pixel_pitch_um=PITCH_UM,
        distortion=_straight(3),
        relative_illumination=np.ones(heights_mm.size),
    )


def streak_kernel(turn_deg: float, length_px: int = 9, radius_px: int = 10) -> FloatArray:
    """A (h, w) point with a tail to one side: along +x, turned from +x towards +y."""
    y, x = np.mgrid[-radius_px : radius_px + 1, -radius_px : radius_px + 1].astype(float)
    turn = np.deg2rad(turn_deg)
    kernel = np.zeros_like(x)
    for step in np.linspace(0, length_px, 4 * length_px + 1):
        at_x, at_y = step * np.cos(turn), step * np.sin(turn)
        kernel += np.exp(-((x - at_x) ** 2 + (y - at_y) ** 2)) / (1 + step)
    kernel[kernel < 1e-6] = 0
    return (kernel / kernel.sum()).astype(np.float32)


def uniform_psf(
    kernel: FloatArray, wavelengths_um: tuple[float, ...] = (0.55,), channels: int = 1
) -> FrozenPsf:
    """One (h, w) kernel for the whole field, all wavelengths and one depth; no distortion."""
    return FrozenPsf(
        kernels=np.stack([kernel] * len(wavelengths_um))[None, None],
        field_heights_mm=np.zeros(1),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array(wavelengths_um),
        pixel_pitch_um=PITCH_UM,
        distortion=_straight(channels),
        relative_illumination=np.ones(1),
        symmetry="uniform",
    )


def grid_psf(
    kernels: FloatArray,
    x_mm: np.ndarray,
    y_mm: np.ndarray,
    wavelengths_um: tuple[float, ...] = (0.55,),
    channels: int = 1,
) -> FrozenPsf:
    """Kernels (row, column, h, w) on a grid over the field, the same for all wavelengths."""
    fields = kernels.reshape(-1, 1, 1, *kernels.shape[-2:])
    return FrozenPsf(
        kernels=np.ascontiguousarray(fields.repeat(len(wavelengths_um), axis=2)),
        field_heights_mm=grid_heights_mm(x_mm, y_mm),
        depths_mm=np.array([np.inf]),
        wavelengths_um=np.array(wavelengths_um),
        pixel_pitch_um=PITCH_UM,
        distortion=_straight(channels),
        relative_illumination=np.ones(len(fields)),
        symmetry="grid",
        grid_x_mm=x_mm,
        grid_y_mm=y_mm,
    )


def _straight(channels: int) -> RadialDistortion:
    return RadialDistortion(coefficients=np.tile([1.0, 0, 0, 0], (channels, 1)), radius_mm=2.0)


def local_psf(kernels: FloatArray, heights_mm: np.ndarray, size_px: tuple[int, int]) -> LocalPsf:
    """A capture of the whole sensor; kernels may be (3, h, w) for one PSF everywhere."""
    window = SensorWindow(
        size_px=size_px, origin_px=(0, 0), sensor_size_px=size_px, pitch_um=PITCH_UM
    )
    if kernels.ndim == 3:
        kernels, heights_mm = kernels[None], np.zeros(1)
    fields = FieldKernels(kernels=kernels, field_heights_mm=heights_mm)
    return LocalPsf(kernels=fields, window=window)


def texture(h: int, w: int, seed: int = 0) -> FloatArray:
    """A picture with a natural spectrum around 0.4, values within 0.05..1."""
    rng = np.random.default_rng(seed)
    fy, fx = np.fft.fftfreq(h)[:, None], np.fft.rfftfreq(w)[None, :]
    amplitude = 1 / np.sqrt(fy**2 + fx**2 + 0.02**2)
    spectrum = np.fft.rfft2(rng.standard_normal((3, h, w))) * amplitude
    planes = np.fft.irfft2(spectrum, s=(h, w))
    planes = 0.4 + 0.12 * (planes - planes.mean()) / planes.std()
    return np.clip(planes, 0.05, 1).astype(np.float32)


def blur_periodic(planes: FloatArray, kernel: FloatArray) -> FloatArray:
    """Blur a square (3, b, b) picture as if it were periodic."""
    size = planes.shape[-1]
    spectrum = scipy.fft.rfft2(planes) * to_otf(kernel, size)
    return np.asarray(scipy.fft.irfft2(spectrum, s=(size, size)), dtype=np.float32)


def with_noise(planes: FloatArray, noise: NoiseModel, rng: np.random.Generator) -> FloatArray:
    shot, read = (np.array(v)[:, None, None] for v in (noise.shot, noise.read_variance))
    sigma = np.sqrt(shot * np.maximum(planes, 0) + read)
    return np.asarray(planes + sigma * rng.standard_normal(planes.shape), dtype=np.float32)


def psnr_db(a: FloatArray, b: FloatArray, cut_px: int = 0) -> float:
    inner = np.s_[..., cut_px : a.shape[-2] - cut_px, cut_px : a.shape[-1] - cut_px]
    return float(-10 * np.log10(np.square(a[inner].astype(np.float64) - b[inner]).mean() + 1e-20))


def blur_directly(planes: FloatArray, local: LocalPsf) -> FloatArray:
    """Let every pixel of mirrored (c, h, w) planes scatter its own kernel, one after the other."""
    down, across = (side // 2 for side in local.kernels.kernels.shape[-2:])
    _, height, width = planes.shape
    wide = np.pad(planes, ((0, 0), (down, down), (across, across)), mode="reflect")
    canvas = np.zeros((len(planes), height + 4 * down, width + 4 * across))
    for row in range(height + 2 * down):
        for col in range(width + 2 * across):
            place = local.position_mm(col - across, row - down)
            at = np.s_[:, row : row + 2 * down + 1, col : col + 2 * across + 1]
            canvas[at] += wide[:, row, col, None, None] * local.kernels.at(*place)
    inner = np.s_[:, 2 * down : -2 * down, 2 * across : -2 * across]
    return canvas[inner].astype(np.float32)
