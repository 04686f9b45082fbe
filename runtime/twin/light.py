"""Light through optics: from a sharp linear scene to what falls on the sensor.

Scene -> camera space -> distortion -> blur that turns and grows over the field (scatter: every
block of the scene is spread with the PSF of its own centre).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import MOSAIC, BayerSensor, ColorSensor
from camkit.colorimetry import apply_matrix, camera_from_rec709
from camkit.errors import ContractError
from camkit.haze import Haze
from camkit.psf import FrozenPsf, depth_name
from camkit.runtime.bank.haze import hazy_kernels
from camkit.runtime.bank.psf import color_kernels
from camkit.runtime.geometry.field_blur import (
    KernelLookup,
    scatter,
    scatter_light,
    scatter_uniform,
)
from camkit.runtime.geometry.sensor_window import SensorWindow, centred_origin
from camkit.runtime.geometry.shrink import shrunk
from camkit.runtime.geometry.warp import distort_array
from camkit.runtime.twin.haze_spread import HazeLens, hazed, margin_px

Gains = tuple[float, ...]
KernelChange = Callable[[FloatArray], FloatArray]
PlaceChange = Callable[[float, float], tuple[float, float]]
Response = tuple[NDArray[np.float64], NDArray[np.float64]]
WIDE_MARGIN_PX: Final = 65
"""From here on kernels that are the same everywhere are spread at once; smaller ones keep the bits
that captures of older bundles have."""
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear Rec.709 (ITU-R BT.709-6): what a channel sees that has no colour of its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lens:
    """The optics that the light goes through.

    Attributes:
        psf: Distortion and illumination.
        kernels_at: Gives the (c, k, k) kernels at a sensor position in millimetres.
        margin_px: Half of the largest kernel.
        gains: White balance of the light; None for that of the sensor's illuminant.
        uniform: Whether all places have the same kernels.
        haze: What falls beside these kernels, which are a core then; None where they are all.
    """

    psf: FrozenPsf
    kernels_at: KernelLookup
    margin_px: int
    gains: Gains | None = None
    uniform: bool = False
    haze: HazeLens | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Light:
    """The light on the sensor.

    Attributes:
        planes: (c, h, w) float32 blurred, white-balanced camera space, without vignetting.
        clean: (c, s h, s w) float32 as a perfect lens would have given it, with the `scale` s of
            the scene.
        window: Place on the sensor.
        gains: White balance, one gain per channel.
        vignetting: The PSF whose illumination still dims it; None for none.
    """

    planes: FloatArray
    clean: FloatArray
    window: SensorWindow
    gains: Gains
    vignetting: FrozenPsf | None


@dataclass(frozen=True, slots=True, kw_only=True)
class LightOptions:
    """The settings from a scene to its light.

    Attributes:
        exposure: Factor on the scene.
        scale: Samples of the scene along a side of a pixel, which sees their mean; for cameras
            whose pictures are finer than their sensor.
        surround_px: Pixels of the scene beyond every side of the picture. Its ring only throws
            light into it; beyond the scene, or without a ring, the scene is mirrored.
        distort: Apply the radial distortion.
        vignette: Apply the relative illumination.
        workers: Threads of the FFT; the result does not depend on them.
    """

    exposure: float = 1.0
    scale: int = 1
    surround_px: int = 0
    distort: bool = True
    vignette: bool = True
    workers: int = 1


def lens_of(
    psf: FrozenPsf,
    sensor: ColorSensor,
    *,
    depth_mm: float | None = None,
    focus_um: float = 0.0,
    haze: Haze | None = None,
    response: Response | None = None,
) -> Lens:
    """Return the lens for one object distance.

    Args:
        psf: Of the optics.
        sensor: Response of its channels.
        depth_mm: Object distance; may only be left out where there is one depth.
        focus_um: How far the sensor lies from its nominal place, away from the lens.
        haze: What lies beside the kernels of the PSF.
        response: What weights the wavelengths in place of the response of the sensor: (n,) um and
            (channel, n), as under another light.

    Raises:
        ContractError: If there are several depths and none is given, or the PSF does not reach
            depth or focus.
    """
    if depth_mm is None and psf.depths_mm.size > 1:
        depths = ", ".join(map(depth_name, psf.depths_mm))
        raise ContractError(
            f"light comes from one depth: give one of those the PSF knows, {depths}"
        )
    weights = sensor.response_arrays() if response is None else response
    if haze is not None:
        return _hazy_lens(psf, haze, weights, depth_mm)
    kernels = color_kernels(psf, *weights, depth_mm=depth_mm, focus_um=focus_um)
    return Lens(
        psf=psf,
        kernels_at=kernels.at,
        margin_px=max(psf.kernels.shape[-2:]) // 2,
        uniform=psf.symmetry == "uniform",
    )


def _hazy_lens(psf: FrozenPsf, haze: Haze, response: Response, depth_mm: float | None) -> Lens:
    kernels = hazy_kernels(psf, haze, *response, depth_mm=depth_mm)
    return Lens(
        psf=psf,
        kernels_at=kernels.core.at,
        margin_px=max(psf.kernels.shape[-2:]) // 2,
        haze=HazeLens(
            haze_at=kernels.haze.at,
            share_at=kernels.coarse_core.light_at,
            cell_px=kernels.cell_px,
            reach_cells=kernels.haze.kernels.kernels.shape[-1] // 2,
        ),
    )


def with_kernels(lens: Lens, change: KernelChange) -> Lens:
    """Return a lens whose kernels are changed and normalised again; sizes stay."""

    def kernels_at(x_mm: float, y_mm: float) -> FloatArray:
        changed = np.maximum(change(lens.kernels_at(x_mm, y_mm)), 0)
        total = changed.sum(axis=(-2, -1), keepdims=True, dtype=np.float64)
        return np.asarray(changed / total, dtype=np.float32)

    return replace(lens, kernels_at=kernels_at)


def with_axis_moved(lens: Lens, x_mm: float, y_mm: float) -> Lens:
    """Return a lens whose axis meets the sensor beside its middle."""
    return with_places(lens, lambda x, y: (x - x_mm, y - y_mm))


def with_places(lens: Lens, place: PlaceChange) -> Lens:
    """Return a lens whose kernels at (x, y) mm are those that another has at `place(x, y)`."""

    def placed_lookup(lookup: KernelLookup) -> KernelLookup:
        return lambda x, y: lookup(*place(x, y))

    haze = lens.haze
    if haze is not None:
        haze = replace(
            haze, haze_at=placed_lookup(haze.haze_at), share_at=placed_lookup(haze.share_at)
        )
    return replace(lens, kernels_at=placed_lookup(lens.kernels_at), haze=haze)


def camera_space(sensor: ColorSensor) -> tuple[NDArray[np.float64], Gains]:
    """Return the matrix (c, 3) from linear Rec.709 to white-balanced channels, and the gains.

    Channels without a colour matrix see Rec.709 as it is where they are three, else its luminance.
    """
    if sensor.color_matrix is not None:
        return camera_from_rec709(np.array(sensor.color_matrix, dtype=np.float64))
    count = len(sensor.channels)
    matrix = np.eye(3) if count == 3 else np.tile(LUMINANCE, (count, 1))
    return matrix, (1.0,) * count


def light_of(
    scene: FloatArray,
    sensor: ColorSensor,
    lens: Lens,
    window: SensorWindow,
    options: LightOptions | None = None,
) -> Light:
    """Project a scene on the sensor.

    Args:
        scene: (3, s h, s w) float32 linear Rec.709 in ideal geometry, >= 0; h and w those of the
            window with its surround, s the `scale` of the options.
        sensor: Colour of its channels.
        lens: What the light goes through.
        window: Place on the sensor, see `scene_window`.
        options: Exposure and which effects to apply.
    """
    settings = options or LightOptions()
    matrix, gains = camera_space(sensor)
    matrix, margin = matrix * settings.exposure, lens.margin_px
    pixels = shrunk(scene, settings.scale)
    if lens.haze is None:
        extended = _on_sensor(pixels, matrix, lens.psf, window, settings, margin)
        planes = _spread(extended, lens, window, settings.workers)
    else:
        haze_margin = margin_px(lens.haze, max(margin, settings.surround_px))
        wide = _on_sensor(pixels, matrix, lens.psf, window, settings, haze_margin)
        cut = slice(haze_margin - margin, margin - haze_margin or None)
        extended = np.ascontiguousarray(wide[:, cut, cut])
        planes = _spread_hazy(wide, extended, lens, window, settings)
    # The FFT leaves a black scene some 1e-8 below zero, which no photon counts can follow.
    np.maximum(planes, 0, out=planes)
    width, height = window.size_px
    if settings.scale == 1:
        clean = extended[:, margin : margin + height, margin : margin + width].copy()
    else:
        fine = window.resampled(
            1 / settings.scale, (settings.scale * width, settings.scale * height)
        )
        ring = settings.scale * settings.surround_px
        clean = _on_sensor(scene, matrix, lens.psf, fine, replace(settings, surround_px=ring), 0)
    return Light(
        planes=planes,
        clean=clean,
        window=window,
        gains=lens.gains or gains,
        vignetting=lens.psf if settings.vignette else None,
    )


def _spread(planes: FloatArray, lens: Lens, window: SensorWindow, workers: int) -> FloatArray:
    if lens.uniform and lens.margin_px >= WIDE_MARGIN_PX:
        kernels = lens.kernels_at(0.0, 0.0)
        return scatter_uniform(planes, kernels, margin_px=lens.margin_px, workers=workers)
    return scatter(planes, lens.kernels_at, window, margin_px=lens.margin_px, workers=workers)


def lit_core(lens: Lens) -> KernelLookup:
    """Return the kernels of a lens with the light that they hold: all of it without a haze."""
    haze = lens.haze
    if haze is None:
        return lens.kernels_at
    return lambda x_mm, y_mm: lens.kernels_at(x_mm, y_mm) * haze.share_at(x_mm, y_mm)[:, None, None]


def _spread_hazy(
    wide: FloatArray, extended: FloatArray, lens: Lens, window: SensorWindow, options: LightOptions
) -> FloatArray:
    """Blur by core and haze, and divide by the blur of a scene of ones."""
    haze = lens.haze
    assert haze is not None
    core, ones = scatter_light(
        extended, lit_core(lens), window, margin_px=lens.margin_px, workers=options.workers
    )
    margin, ring = (wide.shape[1] - window.size_px[1]) // 2, options.surround_px
    veil, even = hazed(wide, haze, window, around_px=margin, ring_px=ring, workers=options.workers)
    core += veil
    core /= ones + even
    return core


def crop_light(light: Light, size_px: tuple[int, int]) -> Light:
    """Return the top left part of a light, as a smaller capture at the same place."""
    width, height = size_px
    scale = light.clean.shape[2] // light.planes.shape[2]
    return replace(
        light,
        planes=light.planes[:, :height, :width].copy(),
        clean=light.clean[:, : scale * height, : scale * width].copy(),
        window=replace(light.window, size_px=size_px),
    )


def stated_balance(gains: Gains) -> tuple[float, float, float] | None:
    """Return the gains as a capture states them: those of three colours, else None."""
    if len(gains) != 3:
        return None
    red, green, blue = gains
    return red, green, blue


def scene_window(
    scene: FloatArray,
    sensor: ColorSensor,
    origin_px: tuple[int, int] | None,
    *,
    scale: int = 1,
    surround_px: int = 0,
) -> SensorWindow:
    """Return the window of a scene's picture on the sensor; centred without an origin.

    Args:
        scene: (3, h, w) linear Rec.709.
        sensor: Its size, pitch and mosaic.
        origin_px: (x, y) of the first pixel.
        scale: Samples of the scene along a side of a pixel.
        surround_px: Pixels of the scene on every side that are not in the picture.

    Raises:
        ContractError: If the scene is not finite (3, h, w), is not of whole pixels, has nothing
            within its surround, or leaves the sensor or the CFA cell.
    """
    if scene.ndim != 3 or scene.shape[0] != 3 or min(scene.shape) < 1:
        raise ContractError(f"a scene must be (3, h, w); got {scene.shape}")
    low, high = float(scene.min()), float(scene.max())
    if not (low >= 0 and np.isfinite(high)):
        raise ContractError(f"a scene must be finite and >= 0; got {low} to {high}")
    if scale < 1 or scene.shape[1] % scale or scene.shape[2] % scale:
        raise ContractError(
            f"a scene of {scale} samples a pixel needs sides that are multiples of it; got "
            f"{scene.shape[2]}x{scene.shape[1]}"
        )
    extent = sensor.known_extent
    step = 2 if sensor.captured == MOSAIC else 1
    size = (scene.shape[2] // scale - 2 * surround_px, scene.shape[1] // scale - 2 * surround_px)
    if surround_px < 0 or min(size) < 1:
        raise ContractError(
            f"a surround must be >= 0 px and leave a picture within it; got {surround_px} px of a "
            f"scene of {scene.shape[2] // scale}x{scene.shape[1] // scale}"
        )
    whole = (extent.width_px, extent.height_px)
    origin = centred_origin(size, whole, multiple=step) if origin_px is None else origin_px
    spans = zip(origin, size, whole, strict=True)
    if any(start < 0 or start % step or start + side > most for start, side, most in spans):
        even = " with an even origin" if isinstance(sensor, BayerSensor) else ""
        raise ContractError(
            f"a scene of {size} px at {origin} must lie on the sensor of {whole} px{even}; "
            "give a smaller scene or another origin"
        )
    return SensorWindow(
        size_px=size,
        origin_px=origin,
        sensor_size_px=whole,
        pitch_um=extent.pixel_pitch_um,
        axis_px=extent.optical_centre_px,
    )


def _on_sensor(
    scene: FloatArray,
    matrix: NDArray[np.float64],
    psf: FrozenPsf,
    window: SensorWindow,
    options: LightOptions,
    margin_px: int,
) -> FloatArray:
    """Return sharp scene in the sensor's channels and geometry, with a margin around the window.

    The margin is the surround of the scene as far as that reaches, and mirrored beyond it.
    """
    ring = options.surround_px
    mirror_px = max(margin_px - ring, 0)
    planes = _apply(matrix, scene)
    if options.distort:
        planes = distort_array(planes, psf.distortion, window.widened(ring), margin_px=mirror_px)
    else:
        pad = ((0, 0), (mirror_px, mirror_px), (mirror_px, mirror_px))
        planes = np.pad(planes, pad, mode="reflect" if min(planes.shape[1:]) > 1 else "edge")
    if ring > margin_px:
        inner = slice(ring - margin_px, margin_px - ring)
        planes = np.ascontiguousarray(planes[:, inner, inner])
    # Interpolation rings and saturated colours leave the gamut; light is never negative.
    return np.maximum(planes, 0.0, out=planes)


def _apply(matrix: NDArray[np.float64], scene: FloatArray) -> FloatArray:
    if matrix.shape == (3, 3):
        return apply_matrix(matrix, scene)
    return np.tensordot(matrix.astype(np.float32), scene, axes=1)
