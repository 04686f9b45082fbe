"""Odd and tiny pictures, judged up to their very borders."""

from dataclasses import replace

from camkit.report.stress.scenario import Scenario
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.light import crop_light


def _shoot(judge: Judge, scene: Scene, value: float) -> Shot:
    rig = judge.rig
    height = round(value)
    width = min(height + height // 2, scene.size_px[0]) | 1 if height < 400 else scene.size_px[0]
    light = crop_light(rig.light(scene), (width, min(height, scene.size_px[1])))
    shot = rig.record(scene, light)
    return replace(shot, border_px=0)


SCENARIO = Scenario(
    name="picture_size",
    title="Odd and tiny pictures",
    knob="height_px",
    unit="px",
    values=(1.0, 2.0, 3.0, 7.0, 17.0, 31.0, 63.0, 127.0, 255.0, 511.0),
    nominal=511.0,
    quick=(1.0, 31.0, 511.0),
    shoot=_shoot,
    log=True,
    bounds={"side_px": "low"},
    note="Light from outside the picture falls into it, as on a real crop; nothing is cut off "
    "before judging.",
)
