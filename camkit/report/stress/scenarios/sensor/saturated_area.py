"""Lamps that clip: more and more of the picture under small discs far above white."""

from dataclasses import replace

import numpy as np

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot

RADIUS_PX = 8.0
POWER = 8.0


def with_discs(scene: Scene, radius_px: float, count: int) -> Scene:
    """Return a scene with soft-edged white discs of `POWER` times white at random places.

    Args:
        scene: The scene.
        radius_px: In pixels of the sensor.
        count: Number of discs.
    """
    rng = np.random.default_rng(7_100 + scene.number)
    radius = radius_px * scene.scale
    height, width = scene.linear.shape[1:]
    y, x = np.mgrid[:height, :width].astype(np.float32)
    cover = np.zeros((height, width), np.float32)
    for _ in range(count):
        cy, cx = rng.random() * height, rng.random() * width
        cover = np.maximum(cover, np.clip(radius + 0.5 - np.hypot(y - cy, x - cx), 0, 1))
    linear = scene.linear + cover * (np.float32(POWER) - scene.linear)
    return scene.showing(linear, f"{scene.name}+{count}x{radius_px:g}")


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    area = scene.size_px[0] * scene.size_px[1]
    count = round(value / 100 * area / (np.pi * RADIUS_PX**2))
    lit = scene if count == 0 else with_discs(scene, RADIUS_PX, count)
    shot = rig.record(scene, rig.light(lit, rig.lens if count else None))
    return replace(shot, away_from_clipped=True)


SCENARIO = Scenario(
    name="saturated_area",
    title="Saturated area",
    knob="saturated_percent",
    unit="%",
    values=(0.0, 0.3, 1.0, 3.0, 6.0, 10.0),
    nominal=0.0,
    quick=(0.0, 3.0),
    shoot=_shoot,
    bounds={"clipped_fraction": "high"},
    note="Discs of 8 px radius, 8 times white; judged away from what clipped.",
)
