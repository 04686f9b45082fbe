"""The sensor is not where the dots are sharp: each becomes a disc, z D / f wide."""

from typing import Final

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import blurred
from camkit.report.kinds.spad.stress.plate.plate_shift import APERTURE_MM
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from camkit.units import UM_PER_MM

FOCAL_MM: Final = 50.0


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    pitch_um = judge.studio.camera.sensor.pixel_pitch_um / judge.studio.camera.scale
    disc = value * UM_PER_MM * APERTURE_MM / FOCAL_MM / pitch_um
    kernel = blurred(judge.studio.camera.kernel, disc)
    bare = blurred(point_kernel(kernel.shape[0]), disc)
    return judge.shoot(scene, PictureSetting(kernel=kernel, bare_kernel=bare), with_chi2=True)


SCENARIO = Scenario(
    name="defocus",
    title="Defocus",
    knob="defocus_mm",
    unit="mm",
    values=(0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0),
    nominal=0.0,
    quick=(0.0, 0.2, 1.0),
    shoot=_shoot,
    applies=makes_finer,
    note="A round stop of 14 mm before 50 mm; the array without a plate is as far out of "
    f"focus. {OF_PICTURES}",
)
