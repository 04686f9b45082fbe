"""A sharp scene photographed by a camera that exists as data only: its capture, and the truth.

scene -> light through the optics (twin.light) -> exposure by the sensor (twin.exposure)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import psf_of_streaks
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import BayerSensor, ColorSensor, Sensor
from camkit.errors import ContractError, UnsupportedError
from camkit.haze import Haze
from camkit.psf import FrozenPsf
from camkit.runtime.geometry.sensor_window import SensorWindow
from camkit.runtime.metadata import Metadata
from camkit.runtime.output.dng import DngTags, camkit_description, write_bayer_dng
from camkit.runtime.output.part_file import atomic_output
from camkit.runtime.twin.exposure import Setting, expose, levels_of
from camkit.runtime.twin.light import LightOptions, lens_of, light_of, scene_window

LEAST_DNG_SIDE_PX: Final = 22
"""LibRaw 0.22 takes smaller pictures for no RAW file (tried side by side)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationOptions:
    """The settings of a simulation.

    Attributes:
        iso: Sensitivity; sets the gain and the noise.
        seed: Seed of the noise; the same seed gives the same capture.
        origin_px: (x, y) of the picture on the sensor, both even on a mosaic; None centres it.
        exposure: Factor on the scene.
        scale: Samples of the scene along a side of a pixel, see `LightOptions`.
        surround_px: Pixels of the scene beyond every side of the picture, likewise.
        depth_mm: Object distance; may only be left out where the PSF has one depth.
        focus_um: How far the sensor lies from its nominal place, where the PSF knows of that.
        distort: Apply the radial distortion.
        vignette: Apply the relative illumination.
        noise: Apply shot and read noise.
        bits: Of the converter; None for the levels of the sensor.
        plate: Whether the plate stands before the lens, in `photograph`; False for the bare lens.
        workers: Threads of the FFT; the result does not depend on them.
    """

    iso: float = 100.0
    seed: int = 0
    origin_px: tuple[int, int] | None = None
    exposure: float = 1.0
    scale: int = 1
    surround_px: int = 0
    depth_mm: float | None = None
    focus_um: float = 0.0
    distort: bool = True
    vignette: bool = True
    noise: bool = True
    bits: int | None = None
    plate: bool = True
    workers: int = 1

    def __post_init__(self) -> None:
        _setting(self)  # checks them


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """A simulated capture beside the sharp picture that a perfect camera would have seen.

    Attributes:
        samples: (h, w) mosaic or (c, h, w) planes, uint16 DN, black level included.
        clean: (c, s h, s w) float32 in sensor geometry, white-balanced camera space, without blur,
            vignetting, noise and clipping, with the `scale` s of the scene.
        white_balance: Gains of the scene light, one per channel, G = 1.
        window: Where the picture lies on the sensor.
        iso: Sensitivity.
        depth_mm: Object distance, where the PSF has several; else None.
        levels: Black and white level in DN, where they are not those of the sensor.
        plate: Whether the camera had its plate, where it has one.
    """

    samples: NDArray[Any]
    clean: FloatArray
    white_balance: tuple[float, ...]
    window: SensorWindow
    iso: float
    depth_mm: float | None = None
    levels: tuple[float, float] | None = None
    plate: bool = True


def simulate(
    scene: FloatArray,
    sensor: ColorSensor,
    psf: FrozenPsf,
    options: SimulationOptions,
    *,
    haze: Haze | None = None,
) -> Simulation:
    """Photograph a scene with a camera that exists as data only.

    Args:
        scene: (3, s h, s w) float32 linear Rec.709 in ideal geometry, >= 0, 1.0 = white; may
            exceed 1; s is the `scale` of the options. At most as large as the sensor, but for its
            surround; a smaller one is a crop of it.
        sensor: Of the bundle: a mosaic, or planes.
        psf: Frozen PSF of the optics.
        options: Sensitivity, seed, placement and which effects to apply.
        haze: What lies beside the kernels of the PSF.

    Raises:
        ContractError: If the scene is not as stated or does not lie on the sensor, or the PSF
            does not reach the depth.
    """
    (simulation,) = simulate_series(scene, sensor, psf, options, [_setting(options)], haze=haze)
    return simulation


def simulate_series(
    scene: FloatArray,
    sensor: ColorSensor,
    psf: FrozenPsf,
    options: SimulationOptions,
    settings: Sequence[Setting],
    *,
    haze: Haze | None = None,
) -> list[Simulation]:
    """Photograph a scene several times, with its light projected once; see `simulate`.

    Args:
        scene: As that of `simulate`.
        sensor: Likewise.
        psf: Likewise.
        options: Placement and which effects to apply.
        settings: ISO, seed, noise and bits of every capture in place of those of the options, and
            another factor on the light.
        haze: As that of `simulate`.

    Raises:
        ContractError: As `simulate`.
    """
    window = scene_window(
        scene, sensor, options.origin_px, scale=options.scale, surround_px=options.surround_px
    )
    light = light_of(
        scene,
        sensor,
        lens_of(psf, sensor, depth_mm=options.depth_mm, focus_um=options.focus_um, haze=haze),
        window,
        LightOptions(
            exposure=options.exposure,
            scale=options.scale,
            surround_px=options.surround_px,
            distort=options.distort,
            vignette=options.vignette,
            workers=options.workers,
        ),
    )
    return [
        Simulation(
            samples=expose(light, sensor, setting),
            clean=light.clean if setting.exposure == 1 else light.clean * setting.exposure,
            white_balance=light.gains,
            window=window,
            iso=setting.iso,
            depth_mm=options.depth_mm if psf.depths_mm.size > 1 else None,
            levels=None if setting.bits is None else levels_of(sensor, setting),
            plate=options.plate,
        )
        for setting in settings
    ]


def _setting(options: SimulationOptions) -> Setting:
    # the exposure is the light's here, whose clean planes have it too
    if not (options.exposure > 0 and np.isfinite(options.exposure)):
        raise ContractError(f"exposure must be > 0; got {options.exposure}")
    return Setting(iso=options.iso, seed=options.seed, noise=options.noise, bits=options.bits)


def photograph(scene: FloatArray, bundle: Bundle, options: SimulationOptions) -> Simulation:
    """Photograph a scene with sensor and optics of a bundle; see `simulate` and `bare_psf`.

    Args:
        scene: (3, h, w) float32, linear Rec.709, 1.0 = white.
        bundle: The camera.
        options: ISO, exposure, seed and place on the sensor.
    """
    (simulation,) = photograph_series(scene, bundle, options, [_setting(options)])
    return simulation


def photograph_series(
    scene: FloatArray, bundle: Bundle, options: SimulationOptions, settings: Sequence[Setting]
) -> list[Simulation]:
    """Photograph a scene several times as `photograph` does; see `simulate_series`."""
    psf = bundle.psf if options.plate else bare_psf(bundle)
    haze = bundle.haze if bundle.manifest.has_haze else None
    sensor = bundle.manifest.light_sensor
    return simulate_series(scene, sensor, psf, options, settings, haze=haze)


def bare_psf(bundle: Bundle) -> FrozenPsf:
    """Return the kernels of the lens alone, where a plate before it writes streaks.

    Raises:
        ContractError: If the optics of the bundle write none.
    """
    optics = bundle.manifest.optics
    if optics is None or optics.type != "streaks":
        raise ContractError(
            f"bundle {bundle.manifest.name} has no plate to take away: its optics write no "
            "streaks; photograph with them as they are"
        )
    return psf_of_streaks(bundle.streaks, len(bundle.manifest.sensor.channels), bare=True)


def write_capture(
    path: Path,
    simulation: Simulation,
    sensor: Sensor,
    bundle_name: str,
    psf_sha256: str | None = None,
) -> None:
    """Write a simulated capture as a DNG that names its bundle and its place on the sensor.

    Without its plate it is another camera and named so: its bundle is not taken unasked. The hash
    of the bundle's PSF tells cameras of one name apart.

    Raises:
        ContractError: If a side is shorter than RAW developers take.
        UnsupportedError: If the sensor has no Bayer mosaic.
        OSError: If the file cannot be written.
    """
    if not isinstance(sensor, BayerSensor):
        raise UnsupportedError("a capture is written as DNG by cameras with a Bayer mosaic only")
    if min(simulation.samples.shape) < LEAST_DNG_SIDE_PX:
        height, width = simulation.samples.shape
        raise ContractError(
            f"a DNG needs sides of at least {LEAST_DNG_SIDE_PX} px to be read again; "
            f"got {width}x{height}"
        )
    if not simulation.plate:
        bundle_name = f"{bundle_name} without its plate"
    window = simulation.window
    x0, y0 = (int(v) for v in window.origin_px)
    red, green, blue = (1 / gain for gain in simulation.white_balance)
    black, white = simulation.levels or (sensor.black_level, sensor.white_level)
    tags = DngTags(
        cfa=sensor.cfa,
        black=round(black),
        white=int(white),
        color_matrix=np.array(sensor.color_matrix, dtype=np.float64),
        as_shot_neutral=(red, green, blue),
        camera_model=f"camkit {bundle_name}",
        metadata=Metadata.believable(iso=simulation.iso),
        noise=sensor.noise_at(simulation.iso),
        description=camkit_description(
            bundle=bundle_name,
            origin_px=(x0, y0),
            sensor_size_px=window.sensor_size_px,
            pixel_pitch_um=window.pitch_um,
            object_distance_mm=simulation.depth_mm,
            psf_sha256=psf_sha256 if simulation.plate else None,
        ),
    )
    with atomic_output(path) as part:
        write_bayer_dng(part, simulation.samples, tags=tags)
