"""The colour of the light: from candles to a blue sky, on a camera that stays set to daylight."""

import numpy as np
from numpy.typing import NDArray

from camkit.colorimetry import rec709_of_light
from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot

DAYLIGHT_K = 6500.0
SPLIT_K = 4000.0
WARM = (
    (-0.2661239, -0.2343589, 0.8776956, 0.179910),
    (-0.9549476, -1.37418593, 2.09137015, -0.16748867),
)
COLD = (
    (-3.0258469, 2.1070379, 0.2226347, 0.240390),
    (3.0817580, -5.87338670, 3.75112997, -0.37001483),
)
"""Cubics of x over 1000 / kelvin, and of y over x."""


def planckian(kelvin: float) -> tuple[float, float]:
    """Return the CIE 1931 chromaticity (x, y) of a black body of 2222 to 25000 K.

    References: Kang et al. 2002, J. Korean Phys. Soc. 41, 865, eq. (5), (6): cubic splines.
    """
    across, up = WARM if kelvin <= SPLIT_K else COLD
    x = float(np.polyval(across, 1e3 / kelvin))
    return x, float(np.polyval(up, x))


def tint(kelvin: float) -> NDArray[np.float64]:
    """Return the factors on linear Rec.709 of a light against daylight, the largest 1."""
    light, daylight = (rec709_of_light(planckian(k)) for k in (kelvin, DAYLIGHT_K))
    factors = np.maximum(light / daylight, 0)
    return np.asarray(factors / factors.max())


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    if value == DAYLIGHT_K:
        return rig.shoot(scene)
    tinted = scene.linear * tint(value).astype(np.float32)[:, None, None]
    lit = scene.showing(tinted, f"{scene.name} {value:g} K")
    return rig.record(scene, rig.light(lit, rig.lens))


SCENARIO = Scenario(
    name="light_colour",
    title="Colour of the light",
    knob="temperature_k",
    unit="K",
    values=(2500.0, 3200.0, 4000.0, 5000.0, DAYLIGHT_K, 8000.0, 10000.0),
    nominal=DAYLIGHT_K,
    quick=(2500.0, DAYLIGHT_K, 10000.0),
    shoot=_shoot,
    log=True,
    note="The scene's colours are multiplied by those of a black body, the brightest channel as "
    "before; white balance and kernels stay those of daylight, and the truth is tinted as well.",
)
