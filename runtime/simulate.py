"""The digital twin: from a sharp linear scene to the mosaic that the camera would record.

Scene -> camera space -> distortion -> blur that turns and grows over the field (scatter: every
block of the scene is spread with the PSF of its own centre) -> relative illumination -> CFA ->
shot and read noise -> saturation -> black level and quantisation.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.camera import Camera
from camkit.colorimetry import apply_matrix, camera_from_rec709
from camkit.contracts import CfaPattern, FloatArray, FrozenPsf, NoiseModel, cfa_channels, depth_name
from camkit.errors import ContractError, UnsupportedError
from camkit.runtime.bank.psf import color_kernels, kernel_at
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.geometry.scatter import KernelLookup, scatter
from camkit.runtime.geometry.sensor_window import SensorWindow, centred_origin
from camkit.runtime.geometry.warp import distort_array
from camkit.runtime.output.dng import DngTags, camkit_description, write_bayer_dng
from camkit.runtime.output.part_file import atomic_output

NOISE_ROWS: Final = 256


LEAST_DNG_SIDE_PX: Final = 22
"""LibRaw 0.22 takes smaller pictures for no RAW file (tried side by side)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationOptions:
    """What is simulated and how.

    Attributes:
        iso: Sensitivity; sets the gain and the noise.
        seed: Seed of the noise; the same seed gives the same mosaic.
        origin_px: (x, y) of the picture on the sensor, both even; None centres it.
        exposure: Factor on the scene.
        depth_mm: Object distance; may only be left out where the PSF has one depth.
        distort: Apply the radial distortion.
        vignette: Apply the relative illumination.
        noise: Apply shot and read noise.
        workers: Threads of the FFT; the result does not depend on them.
    """

    iso: float = 100.0
    seed: int = 0
    origin_px: tuple[int, int] | None = None
    exposure: float = 1.0
    depth_mm: float | None = None
    distort: bool = True
    vignette: bool = True
    noise: bool = True
    workers: int = 1

    def __post_init__(self) -> None:
        if not (self.iso > 0 and np.isfinite(self.iso)):
            raise ContractError(f"iso must be > 0; got {self.iso}")
        if self.seed < 0:
            raise ContractError(f"seed must be >= 0; got {self.seed}")
        if not (self.exposure > 0 and np.isfinite(self.exposure)):
            raise ContractError(f"exposure must be > 0; got {self.exposure}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """A simulated capture beside the sharp picture that a perfect camera would have seen.

    Attributes:
        mosaic: (h, w) uint16 DN, black level included.
        clean: (3, h, w) float32 in sensor geometry, white-balanced camera space, without blur,
            vignetting, noise and clipping.
        white_balance: Gains (R, G, B) of the scene light, G = 1.
        window: Where the picture lies on the sensor.
        iso: Sensitivity.
        depth_mm: Object distance, where the PSF has several; else None.
    """

    mosaic: NDArray[np.uint16]
    clean: FloatArray
    white_balance: tuple[float, float, float]
    window: SensorWindow
    iso: float
    depth_mm: float | None = None


def simulate(
    scene: FloatArray, camera: Camera, psf: FrozenPsf, options: SimulationOptions
) -> Simulation:
    """Photograph a scene with a camera that exists as data only.

    Args:
        scene: (3, h, w) float32 linear Rec.709 in ideal geometry, >= 0, 1.0 = white; may exceed 1.
            At most as large as the sensor; a smaller one is a crop of it.
        camera: Sensor of the bundle.
        psf: Frozen PSF of the lens.
        options: Sensitivity, seed, placement and which effects to apply.

    Raises:
        ContractError: If the scene is not as stated or does not lie on the sensor, or the PSF
            does not reach the depth.
        UnsupportedError: If the camera has no Bayer mosaic.
    """
    if camera.cfa is None:
        raise UnsupportedError("only cameras with a Bayer mosaic are simulated")
    window = scene_window(scene, camera, options.origin_px)
    matrix, gains = camera_from_rec709(np.array(camera.color_matrix, dtype=np.float64))
    kernels_at = kernel_lookup(psf, camera, depth_mm=options.depth_mm)
    margin = psf.kernels.shape[-1] // 2
    extended = sensor_scene(scene, matrix * options.exposure, psf, window, options, margin)
    planes = scatter(extended, kernels_at, window, margin_px=margin, workers=options.workers)
    # The FFT leaves a black scene some 1e-8 below zero, which no photon counts can follow.
    np.maximum(planes, 0, out=planes)
    height, width = scene.shape[1:]
    clean = extended[:, margin : margin + height, margin : margin + width].copy()
    del extended
    signal = sample_mosaic(planes, camera.cfa, gains)
    del planes
    if options.vignette:
        _shade(signal, psf, window)
    return Simulation(
        mosaic=expose(signal, camera, options),
        clean=clean,
        white_balance=gains,
        window=window,
        iso=options.iso,
        depth_mm=options.depth_mm if psf.depths_mm.size > 1 else None,
    )


def write_capture(path: Path, simulation: Simulation, camera: Camera, bundle_name: str) -> None:
    """Write a simulated capture as a DNG that names its bundle and its place on the sensor.

    Raises:
        ContractError: If a side is shorter than RAW developers take.
        OSError: If the file cannot be written.
    """
    if min(simulation.mosaic.shape) < LEAST_DNG_SIDE_PX:
        height, width = simulation.mosaic.shape
        raise ContractError(
            f"a DNG needs sides of at least {LEAST_DNG_SIDE_PX} px to be read again; "
            f"got {width}x{height}"
        )
    window = simulation.window
    x0, y0 = (int(v) for v in window.origin_px)
    red, green, blue = (1 / gain for gain in simulation.white_balance)
    tags = DngTags(
        cfa=camera.cfa,
        black=round(camera.black_level),
        white=int(camera.white_level),
        color_matrix=np.array(camera.color_matrix, dtype=np.float64),
        as_shot_neutral=(red, green, blue),
        camera_model=f"camkit {bundle_name}",
        iso=simulation.iso,
        noise=camera.noise_at(simulation.iso),
        description=camkit_description(
            bundle=bundle_name,
            origin_px=(x0, y0),
            sensor_size_px=window.sensor_size_px,
            pixel_pitch_um=window.pitch_um,
            object_distance_mm=simulation.depth_mm,
        ),
    )
    with atomic_output(path) as part:
        write_bayer_dng(part, simulation.mosaic, tags=tags)


def kernel_lookup(psf: FrozenPsf, camera: Camera, *, depth_mm: float | None = None) -> KernelLookup:
    """Give the function from a sensor position (x_mm, y_mm) to the kernels of one depth.

    Args:
        psf: Of the lens.
        camera: Response of its colours.
        depth_mm: Object distance; may only be left out where there is one depth.

    Raises:
        ContractError: If there are several depths and none is given, or the PSF does not reach it.
    """
    if depth_mm is None and psf.depths_mm.size > 1:
        known = ", ".join(map(depth_name, psf.depths_mm))
        raise ContractError(f"light comes from one depth: give one of those the PSF knows, {known}")
    kernels = color_kernels(psf, *camera.channel_response.to_arrays(), depth_mm=depth_mm)
    return lambda x_mm, y_mm: kernel_at(kernels, psf.field_heights_mm, x_mm, y_mm)


def scene_window(
    scene: FloatArray, camera: Camera, origin_px: tuple[int, int] | None
) -> SensorWindow:
    """Give where a scene lies on the sensor of the camera; centred without an origin.

    Raises:
        ContractError: If the scene is not finite (3, h, w), or leaves the sensor or the CFA cell.
    """
    if scene.ndim != 3 or scene.shape[0] != 3 or min(scene.shape) < 1:
        raise ContractError(f"a scene must be (3, h, w); got {scene.shape}")
    low, high = float(scene.min()), float(scene.max())
    if not (low >= 0 and np.isfinite(high)):
        raise ContractError(f"a scene must be finite and >= 0; got {low} to {high}")
    size, sensor = (scene.shape[2], scene.shape[1]), (camera.width_px, camera.height_px)
    origin = centred_origin(size, sensor) if origin_px is None else origin_px
    spans = zip(origin, size, sensor, strict=True)
    if any(start < 0 or start % 2 or start + side > whole for start, side, whole in spans):
        raise ContractError(
            f"a scene of {size} px at {origin} must lie on the sensor of {sensor} px with an even "
            "origin; give a smaller scene or another origin"
        )
    return SensorWindow(
        size_px=size, origin_px=origin, sensor_size_px=sensor, pitch_um=camera.pixel_pitch_um
    )


def sensor_scene(
    scene: FloatArray,
    matrix: NDArray[np.float64],
    psf: FrozenPsf,
    window: SensorWindow,
    options: SimulationOptions,
    margin_px: int,
) -> FloatArray:
    """Give the sharp scene in camera space and sensor geometry, with a mirrored margin.

    Returns:
        (3, h + 2 margin, w + 2 margin) float32, >= 0.
    """
    planes = apply_matrix(matrix, scene)
    if options.distort:
        planes = distort_array(planes, psf.distortion, window, margin_px=margin_px)
    else:
        pad = ((0, 0), (margin_px, margin_px), (margin_px, margin_px))
        planes = np.pad(planes, pad, mode="reflect" if min(planes.shape[1:]) > 1 else "edge")
    # Interpolation rings and saturated colours leave the gamut; light is never negative.
    return np.maximum(planes, 0.0, out=planes)


def expose(signal: FloatArray, camera: Camera, options: SimulationOptions) -> NDArray[np.uint16]:
    """Give the DN of a clean mosaic: photons, electrons, full well, amplifier, converter.

    Args:
        signal: (h, w) float32 mosaic, linear, 1.0 = white level.
        camera: Levels, full well and noise per ISO.
        options: Sensitivity, seed, noise.

    References: Foi et al. 2008; EMVA 1288 release 4.0, ch. 2.
    """
    rng = np.random.default_rng(options.seed)
    noise = camera.noise_at(options.iso)
    dn = np.empty(signal.shape, dtype=np.uint16)
    for top in range(0, signal.shape[0], NOISE_ROWS):
        rows = signal[top : top + NOISE_ROWS].astype(np.float64)
        rows = record(rows, noise, camera.full_well_e, rng if options.noise else None)
        levels = camera.black_level + rows * (camera.white_level - camera.black_level)
        dn[top : top + NOISE_ROWS] = np.clip(np.rint(levels), 0, np.floor(camera.white_level))
    return dn


def record(
    signal: NDArray[np.float64],
    noise: NoiseModel,
    full_well_e: float,
    rng: np.random.Generator | None,
) -> NDArray[np.float64]:
    """Give the signal after the pixel: Poisson electrons, full well, Gaussian read noise.

    Args:
        signal: Linear, 1.0 = white level.
        noise: Noise at the ISO; `shot` is the signal of one electron, alike in all colours.
        full_well_e: Electrons that a pixel holds.
        rng: Random generator, or None for no noise.
    """
    per_electron = noise.shot[1]
    electrons = signal / per_electron
    if rng is None:
        return np.minimum(electrons, full_well_e) * per_electron
    read_e = np.sqrt(noise.read_variance[1]) / per_electron
    counted = np.minimum(rng.poisson(electrons), full_well_e)
    return np.asarray((counted + read_e * rng.standard_normal(signal.shape)) * per_electron)


def sample_mosaic(
    planes: FloatArray, cfa: CfaPattern, gains: tuple[float, float, float]
) -> FloatArray:
    """Give the (h, w) raw mosaic of (3, h, w) white-balanced planes."""
    mosaic = np.empty(planes.shape[1:], dtype=np.float32)
    for row, channels in enumerate(cfa_channels(cfa)):
        for column, channel in enumerate(channels):
            site = slice(row, None, 2), slice(column, None, 2)
            mosaic[site] = planes[channel][site] * np.float32(1 / gains[channel])
    return mosaic


def _shade(signal: FloatArray, psf: FrozenPsf, window: SensorWindow) -> None:
    for top in range(0, signal.shape[0], NOISE_ROWS):
        band = signal[top : top + NOISE_ROWS]
        band *= illumination_band(psf, window, top, top + band.shape[0])
