"""Cameras by name, the light of one scene, and what each makes of it at any exposure.

scene -> light through the camera's optics -> exposed at an ISO -> restored in a way -> dB of sRGB

Light is computed once; only its photons are counted anew for every exposure.
"""

from dataclasses import replace
from pathlib import Path
from typing import Final, Literal

import numpy as np

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.colorimetry import encode_srgb
from camkit.contracts import FloatArray
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.peak import measure_peak
from camkit.report.analysis.subject import find_subject
from camkit.report.quality import BORDER_PX, crop_origin
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from camkit.runtime.twin.exposure import Setting, expose
from camkit.runtime.twin.light import Light, LightOptions, lens_of, light_of, scene_window
from camkit.runtime.twin.truth import light_sensor, true_picture

BASE_ISO: Final = 100.0
"""At which white fills the pixels; more light than that is of no use."""
MOST_ISO: Final = 6400.0
"""Of the model camera."""
Way = Literal["develop", "filter", "network"]
_PITCH_UM: Final = 5.96
_RAYS: Final = 8000
_PLAIN: Final = LightOptions(distort=False)
_METHODS: Final[dict[Way, str]] = {"develop": "develop", "filter": "wiener", "network": "net"}


def open_camera(name: str, folder: Path) -> Bundle:
    """Open what `camkit analyse field` knows by a name: a bundle, frozen optics, a lens, a pinhole.

    Args:
        name: See `camkit.report.analysis.subject`.
        folder: Where what is no bundle becomes one, its filter each colour for itself.

    Raises:
        ContractError: If there is nothing of that name.
        BundleError: If it is damaged.
    """
    folder.mkdir(parents=True, exist_ok=True)
    return find_subject(name).camera(folder)


def optics_of(bundle: Bundle) -> FrozenOptics:
    """Return the frozen optics of a bundle."""
    return FrozenOptics(psf=bundle.psf, haze=bundle.haze if bundle.manifest.has_haze else None)


def ways_of(bundle: Bundle) -> tuple[Way, ...]:
    """Return what restores: the filter alone, and the network where there is one."""
    networks = any(isinstance(stage, Network) for stage in bundle.manifest.stages)
    return ("filter", "network") if networks else ("filter",)


def light_through(
    bundle: Bundle, scene: FloatArray, share: float = 0.0, optics: FrozenOptics | None = None
) -> Light:
    """Project a scene on the sensor of a camera, vignetting on, without distortion.

    Args:
        bundle: The camera.
        scene: (3, h, w) float32 linear Rec.709, a part of the sensor.
        share: Where it lies, from centred (0) to touching the lower right corner (1).
        optics: What the light goes through, of one depth; None for those of the bundle.
    """
    sensor = light_sensor(bundle.manifest)
    extent, size = sensor.known_extent, (scene.shape[2], scene.shape[1])
    origin = crop_origin(size, (extent.width_px, extent.height_px), share, (1, 1))
    through = optics or optics_of(bundle)
    depth_mm = bundle.reference_depth_mm if optics is None else None
    lens = lens_of(through.psf, sensor, depth_mm=depth_mm, haze=through.haze)
    return light_of(scene, sensor, lens, scene_window(scene, sensor, origin), _PLAIN)


def truth_of(bundle: Bundle, light: Light) -> FloatArray:
    """Return what a perfect camera would have shown, (3, h, w) float32 linear Rec.709."""
    return true_picture(light.clean, light_sensor(bundle.manifest))


def passed_light(lens: Lens) -> float:
    """Return the light on the axis that passes a lens, as the area of its stop in mm^2 over pi."""
    peak = measure_peak(lens, 0.0, lens.reference_wavelength_um, _PITCH_UM, _RAYS)
    return lens.aperture_value**2 * (1 - sum(peak.lost.values()))


def setting_of(exposure: float) -> Setting:
    """Return how the sensor records a scene.

    The ISO is what brings white to the white level, up to `MOST_ISO`; beyond, the picture stays
    dark, since no pedestal would hold the noise. With more light than pixels hold the shutter
    closes earlier.

    Args:
        exposure: Light of a white scene, 1 where it fills the pixels at ISO 100.
    """
    held = min(exposure, 1.0)
    iso = min(BASE_ISO / held, MOST_ISO)
    return Setting(iso=iso, exposure=held * iso / BASE_ISO)


def restored(
    bundle: Bundle, light: Light, exposure: float, way: Way, *, seed: int = 0
) -> FloatArray:
    """Photograph light, restore it on one thread, in the geometry of the sensor.

    Args:
        bundle: The camera.
        light: See `light_through`.
        exposure: See `setting_of`; what stays dark is made brighter in the end.
        way: What restores.
        seed: Of the noise.

    Returns:
        (3, h, w) float32 linear Rec.709, 1.0 = white.
    """
    setting = replace(setting_of(exposure), seed=seed)
    pipeline = Pipeline(bundle, Options(method=_METHODS[way], undistort=False, threads=1))
    capture = pipeline.capture_of(
        expose(light, light_sensor(bundle.manifest), setting),
        iso=setting.iso,
        white_balance=light.gains,  # type: ignore[arg-type]
        origin_px=tuple(int(v) for v in light.window.origin_px),  # type: ignore[arg-type]
    )
    return pipeline.start(capture).fill() / np.float32(setting.exposure)


def square_error(picture: FloatArray, truth: FloatArray) -> FloatArray:
    """Return the squared error of sRGB values (h, w), the mean over colours, without the border.

    Args:
        picture: (3, h, w) linear Rec.709.
        truth: The same.
    """
    square = np.square(encode_srgb(picture) - encode_srgb(truth)).mean(axis=0)
    return np.asarray(square[BORDER_PX:-BORDER_PX, BORDER_PX:-BORDER_PX])


def decibels(square: FloatArray) -> float:
    """Return -10 log10 of the mean."""
    return float(-10 * np.log10(max(square.mean(dtype=np.float64), 1e-12)))
