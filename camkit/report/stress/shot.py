"""A capture beside the truth, and what a scenario may do to it afterwards."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.sensor import ColorSensor
from camkit.noise import NoiseModel
from camkit.report.stress.scene import Scene
from camkit.runtime.capture import Capture
from camkit.runtime.twin.light import Light

NOMINAL_ISO: Final = 100.0
NOISE_SEED: Final = 4_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A capture beside the truth.

    Attributes:
        scene: What it shows; decides noise and calibration.
        capture: What the methods get.
        light: Where it came from.
        sensor: What recorded it.
        exposure: Factor by which the capture is brighter than the truth.
        noise: That was really added, before white balance.
        spoiled: Of the shape of the samples, true where a scenario broke them; None for none.
        border_px: Cut off before the PSNR is taken, in pixels of the sensor.
        away_from_clipped: Leave out what lies near clipped samples.
    """

    scene: Scene
    capture: Capture
    light: Light
    sensor: ColorSensor
    exposure: float
    noise: NoiseModel
    spoiled: NDArray[np.bool_] | None = None
    border_px: int = 32
    away_from_clipped: bool = False

    @property
    def step(self) -> float:
        """Return the step of the converter, 1.0 = white level."""
        return 1 / (self.capture.white_level - float(self.capture.black_level.max()))


def spoil(shot: Shot, percent: float, values: tuple[float, ...], seed: int) -> Shot:
    """Return a capture some of whose samples hold another value.

    Args:
        shot: The capture.
        percent: Of the samples, at random places.
        values: What stands there instead: the last value in the rarest places, each one before it
            twice as often (half the rest in the end). Values that are not finite make the samples
            float.
        seed: Of the places, together with the number of the scene.
    """
    chance = np.random.default_rng(seed + shot.scene.number).random(shot.capture.samples.shape)
    kind = np.uint16 if np.isfinite(values).all() else np.float32
    samples = shot.capture.samples.astype(kind)
    for number, value in enumerate(values):
        samples[chance < percent / 100 / 2**number] = value
    capture = replace(shot.capture, samples=samples)
    return replace(shot, capture=capture, spoiled=chance < percent / 100 if percent else None)
