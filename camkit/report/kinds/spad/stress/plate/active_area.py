"""Pixels whose round areas are smaller or larger than the bundle takes for granted."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import opened
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PHOTONS, PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario
from camkit.runtime.kinds.spad.finer.sampling import point_kernel

ACTIVE_UM: Final = 30.0
"""Of the prototype."""


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    camera = judge.studio.camera
    pitch_um = camera.sensor.pixel_pitch_um / camera.scale
    # an even disc has a sixteenth of its diameter squared as variance along an axis
    variance = (value**2 - ACTIVE_UM**2) / 16 / pitch_um**2
    kernel = opened(camera.kernel, variance)
    bare = opened(point_kernel(kernel.shape[0]), variance)
    light = PHOTONS * (value / ACTIVE_UM) ** 2
    setting = PictureSetting(kernel=kernel, bare_kernel=bare, photons=light)
    return judge.shoot(scene, setting, with_chi2=True)


SCENARIO = Scenario(
    name="active_area",
    title="Active area",
    knob="diameter_um",
    unit="um",
    values=(20.0, 24.0, 27.0, 30.0, 33.0, 36.0, 40.0),
    nominal=30.0,
    quick=(20.0, 30.0, 40.0),
    shoot=_shoot,
    applies=makes_finer,
    note=f"Photons go with the area. {OF_PICTURES}",
)
