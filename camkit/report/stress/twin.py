"""The digital twin under stress: any step between the scene and the capture may be changed.

    Scene -> light_of (distortion, blur by a Lens, vignetting) -> Light
          -> photograph (exposure, photons, amplifier, converter by a Setting) -> Shot

The blur is what takes time; scenarios that change only what follows share one `Light`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.bundle.camera import Camera
from camkit.bundle.reader import Bundle
from camkit.colorimetry import camera_from_rec709
from camkit.contracts import CfaPattern, FloatArray, FrozenPsf, NoiseModel
from camkit.errors import UnsupportedError
from camkit.report.stress.scene import Scene
from camkit.runtime.capture import Capture
from camkit.runtime.geometry.illumination import illumination_band
from camkit.runtime.geometry.scatter import KernelLookup, scatter
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.simulate import (
    SimulationOptions,
    kernel_lookup,
    record,
    sample_mosaic,
    scene_window,
    sensor_scene,
)

NOMINAL_ISO: Final = 100.0
NOISE_SEED: Final = 4_000
Gains = tuple[float, float, float]
KernelChange = Callable[[FloatArray], FloatArray]


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """What the light really goes through.

    Attributes:
        psf: Distortion and illumination.
        kernels_at: Gives the (3, k, k) kernels at a sensor position in millimetres.
        margin_px: Half of the largest kernel.
        gains: White balance of the light; None for that of the bundle's illuminant.
    """

    psf: FrozenPsf
    kernels_at: KernelLookup
    margin_px: int
    gains: Gains | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """What falls on the sensor.

    Attributes:
        scene: The scene.
        planes: (3, h, w) float32 blurred and shaded, white-balanced camera space.
        clean: (3, h, w) float32 as a perfect lens would have given it, without vignetting.
        window: Place on the sensor.
        gains: White balance (R, G, B).
    """

    scene: Scene
    planes: FloatArray
    clean: FloatArray
    window: SensorWindow
    gains: Gains


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """How the camera records the light.

    Attributes:
        iso: Sensitivity, as it is and as the file states it.
        exposure: Factor on the light.
        noise_factor: Factor on the deviation of all noise, which the file does not state.
        bits: Of the converter; None for the camera's.
    """

    iso: float = NOMINAL_ISO
    exposure: float = 1.0
    noise_factor: float = 1.0
    bits: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A capture beside the truth.

    Attributes:
        capture: What the methods get.
        light: Where it came from.
        exposure: Factor by which the capture is brighter than the truth.
        noise: That was really added, before white balance.
        spoiled: (h, w) bool, samples that a scenario broke; None for none.
        border_px: Cut off before the PSNR is taken.
        away_from_clipped: Leave out what lies near clipped samples.
    """

    capture: Capture
    light: Light
    exposure: float
    noise: NoiseModel
    spoiled: NDArray[np.bool_] | None = None
    border_px: int = 32
    away_from_clipped: bool = False

    @property
    def cfa(self) -> CfaPattern | None:
        """Give the mosaic of the capture."""
        return self.capture.cfa


def nominal_lens(bundle: Bundle) -> Lens:
    """Give the lens as the bundle knows it, at its reference depth."""
    return lens_at(bundle, bundle.reference_depth_mm)


def lens_at(bundle: Bundle, depth_mm: float) -> Lens:
    """Give the lens as the bundle knows it, for one object distance."""
    psf = bundle.psf
    return Lens(
        psf=psf,
        kernels_at=kernel_lookup(psf, bundle.manifest.camera, depth_mm=depth_mm),
        margin_px=psf.kernels.shape[-1] // 2,
    )


def with_kernels(lens: Lens, change: KernelChange) -> Lens:
    """Give a lens whose kernels are changed and normalised again; sizes stay."""

    def kernels_at(x_mm: float, y_mm: float) -> FloatArray:
        changed = np.maximum(change(lens.kernels_at(x_mm, y_mm)), 0)
        total = changed.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
        return np.asarray(changed / total, dtype=np.float32)

    return replace(lens, kernels_at=kernels_at)


def with_axis_moved(lens: Lens, x_mm: float, y_mm: float) -> Lens:
    """Give a lens whose axis meets the sensor beside its middle."""
    return replace(lens, kernels_at=lambda x, y: lens.kernels_at(x - x_mm, y - y_mm))


def transform_kernels(kernels: FloatArray, scale: float, angle_rad: float) -> FloatArray:
    """Enlarge and turn kernels about their middle, by bicubic interpolation.

    Args:
        kernels: (c, k, k).
        scale: > 1 makes them wider.
        angle_rad: From +x towards +y.
    """
    c, s = scale * np.cos(angle_rad), scale * np.sin(angle_rad)
    matrix = np.array([[c, -s], [s, c]])  # acts on (x, y)
    middle = (kernels.shape[-1] - 1) / 2
    offset = middle - matrix @ np.full(2, middle)
    affine = np.column_stack([matrix, offset])
    size = (kernels.shape[-1], kernels.shape[-2])
    return np.stack([cv2.warpAffine(k, affine, size, flags=cv2.INTER_CUBIC) for k in kernels])


def light_of(scene: Scene, bundle: Bundle, lens: Lens) -> Light:
    """Let a scene fall on the sensor.

    Raises:
        UnsupportedError: If the camera has no Bayer mosaic.
    """
    camera = bundle.manifest.camera
    if camera.cfa is None:
        raise UnsupportedError("only cameras with a Bayer mosaic are simulated")
    window = scene_window(
        scene.linear, camera, scene.origin_px((camera.width_px, camera.height_px))
    )
    matrix, gains = camera_from_rec709(np.array(camera.color_matrix, dtype=np.float64))
    margin = lens.margin_px
    extended = sensor_scene(scene.linear, matrix, lens.psf, window, SimulationOptions(), margin)
    planes = np.maximum(scatter(extended, lens.kernels_at, window, margin_px=margin), 0)
    width, height = window.size_px
    return Light(
        scene=scene,
        planes=planes * illumination_band(lens.psf, window, 0, height),
        clean=extended[:, margin : margin + height, margin : margin + width].copy(),
        window=window,
        gains=lens.gains or gains,
    )


def photograph(light: Light, camera: Camera, setting: Setting) -> Shot:
    """Record the light; the same scene has the same noise seed in every scenario."""
    assert camera.cfa is not None
    stated = camera.noise_at(setting.iso)
    power = setting.noise_factor**2
    noise = NoiseModel(
        shot=(stated.shot[0] * power,) * 3, read_variance=(stated.read_variance[0] * power,) * 3
    )
    signal = sample_mosaic(light.planes, camera.cfa, light.gains).astype(np.float64)
    rng = np.random.default_rng(NOISE_SEED + light.scene.number)
    # Fewer, larger electrons give the larger noise; the well then holds as much light as before.
    well_e = camera.full_well_e / power
    recorded = record(signal * setting.exposure, noise, well_e, rng)
    black, white = _levels(camera, setting.bits)
    levels = np.clip(np.rint(black + recorded * (white - black)), 0, np.floor(white))
    x, y = (int(v) for v in light.window.origin_px)
    capture = Capture(
        samples=levels.astype(np.uint16),
        cfa=camera.cfa,
        black_level=np.full((2, 2), black, np.float32),
        white_level=white,
        white_balance=light.gains,
        color_matrix=np.array(camera.color_matrix, dtype=np.float64),
        iso=setting.iso,
        origin_px=(x, y),
        sensor_size_px=light.window.sensor_size_px,
    )
    return Shot(capture=capture, light=light, exposure=setting.exposure, noise=noise)


def spoil(shot: Shot, percent: float, values: tuple[float, ...], seed: int) -> Shot:
    """Give a capture some of whose samples hold another value.

    Args:
        shot: The capture.
        percent: Of the samples, at random places.
        values: What stands there instead: the last value in the rarest places, each one before it
            twice as often (half the rest in the end). Values that are not finite make the samples
            float.
        seed: Of the places, together with the number of the scene.
    """
    chance = np.random.default_rng(seed + shot.light.scene.number).random(
        shot.capture.samples.shape
    )
    kind = np.uint16 if np.isfinite(values).all() else np.float32
    samples = shot.capture.samples.astype(kind)
    for number, value in enumerate(values):
        samples[chance < percent / 100 / 2**number] = value
    capture = replace(shot.capture, samples=samples)
    return replace(shot, capture=capture, spoiled=chance < percent / 100 if percent else None)


def crop_light(light: Light, size_px: tuple[int, int]) -> Light:
    """Give the top left part of a light, as a smaller capture at the same place."""
    width, height = size_px
    window = replace(light.window, size_px=size_px)
    planes, clean = (p[:, :height, :width].copy() for p in (light.planes, light.clean))
    return replace(light, planes=planes, clean=clean, window=window)


def _levels(camera: Camera, bits: int | None) -> tuple[float, float]:
    """Give black and white level of a converter; the black keeps its share of the range."""
    if bits is None:
        return camera.black_level, camera.white_level
    white = 2.0**bits - 1
    return float(np.rint(camera.black_level * white / camera.white_level)), white
