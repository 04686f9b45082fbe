"""Scenes with lights for the sweeps: nights, lamps put into them, streaks of other lengths."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.reader import Bundle
from camkit.bundle.sensor import ColorSensor
from camkit.report.stress.scene import SCENE_SEED, WHITE, Scene
from camkit.runtime.kinds.hdr.night import night_scene
from camkit.runtime.twin.saturation import exposure_for_share
from camkit.scenes.saturation import with_exposure
from camkit.streaks import StreakOptics

DIM: Final = 0.5
"""Lights end here in scenes to which a scenario brings its own."""
_LIMB: Final = 0.4
"""How much darker the rim of a lamp is than its middle."""


def writes_streaks(bundle: Bundle) -> str | None:
    """Return why a bundle cannot take scenarios of streaks; None if it can."""
    optics = bundle.manifest.optics
    if optics is None or optics.type != "streaks":
        return "its optics write no streaks"
    return None


def exposed_night(scene: Scene, sensor: ColorSensor, share: float) -> FloatArray:
    """Return a scene with lights, exposed so that a share of it saturates; ends at 2^8 white.

    Args:
        scene: Taken as it is where it holds light above white, as an EXR may; else a night whose
            seed is its number stands in its place.
        sensor: Whose colours clip.
        share: Of the pixels.

    Raises:
        ContractError: If no exposure saturates that share of a picture.
    """
    linear = scene.linear
    if linear.max() <= WHITE:
        linear = night_scene(SCENE_SEED + scene.number, *linear.shape[1:])
    return with_exposure(linear, exposure_for_share(linear, sensor, share).exposure)


def dimmed(linear: FloatArray) -> FloatArray:
    """Return a scene without its lights."""
    return np.minimum(linear, np.float32(DIM))


def with_lamp(
    linear: FloatArray, centre_px: tuple[float, float], radius_px: float, power: float
) -> FloatArray:
    """Add a round white lamp to a scene (3, h, w), darker at its rim.

    Args:
        linear: The scene.
        centre_px: (y, x); may lie outside.
        radius_px: Of the lamp.
        power: In times white, in its middle.
    """
    y, x = np.ogrid[: linear.shape[1], : linear.shape[2]]
    distance_px = np.hypot(y - centre_px[0], x - centre_px[1]).astype(np.float32)
    cover = np.clip(np.float32(radius_px + 0.5) - distance_px, 0, 1)
    light = np.float32(power) * (
        1 - np.float32(_LIMB) * np.minimum(distance_px / radius_px, 1) ** 2
    )
    return np.asarray(linear + cover * (light - linear), np.float32)


def with_peak(linear: FloatArray, peak: float) -> FloatArray:
    """Return a scene whose brightest light is `peak` times white, and what is white stays so.

    The logarithm of what exceeds white is scaled; colours stay.
    """
    strongest = linear.max(axis=0)
    top = float(strongest.max())
    if top <= 1:
        return linear
    power = np.float32(np.log(peak) / np.log(top) - 1)
    return np.asarray(linear * np.maximum(strongest, 1) ** power, np.float32)


def with_colour(linear: FloatArray, colour: Sequence[float]) -> FloatArray:
    """Return a scene all of whose lights have one colour, as bright as their strongest was."""
    strongest = linear.max(axis=0)
    coloured = strongest * np.array(colour, np.float32)[:, None, None]
    return np.asarray(np.where(strongest > 1, coloured, linear), np.float32)


def with_line(
    linear: FloatArray,
    through_px: tuple[float, float],
    angle_rad: float,
    half_px: float,
    level: float,
) -> FloatArray:
    """Add a line of light, as narrow as a streak, to both sides of a point.

    Args:
        linear: (3, h, w).
        through_px: (y, x).
        angle_rad: From +x towards +y.
        half_px: How far it reaches.
        level: In times white, in its middle.
    """
    y, x = np.ogrid[: linear.shape[1], : linear.shape[2]]
    down, right = y - through_px[0], x - through_px[1]
    along = np.cos(angle_rad) * right + np.sin(angle_rad) * down
    across = np.cos(angle_rad) * down - np.sin(angle_rad) * right
    light = level * np.exp(-0.5 * across**2) * (np.abs(along) <= half_px)
    return np.asarray(linear + light.astype(np.float32), np.float32)


def turned(streaks: StreakOptics, angle_rad: float) -> StreakOptics:
    """Return streaks that are turned from +x towards +y."""
    return replace(streaks, angles_rad=streaks.angles_rad + angle_rad)


def stretched(streaks: StreakOptics, factor: float) -> StreakOptics:
    """Return streaks that are longer by a factor and hold the same light."""
    count = streaks.profiles.shape[-1]
    place = np.arange(int(np.ceil((count - 1) * max(factor, 1))) + 1) / factor
    low = np.minimum(place.astype(int), count - 1)
    high, share = np.minimum(low + 1, count - 1), (place - low).clip(0, 1)
    profiles = streaks.profiles[..., low] * (1 - share) + streaks.profiles[..., high] * share
    profiles[..., place > count - 1] = 0
    return replace(streaks, profiles=np.asarray(profiles / factor, np.float32))
