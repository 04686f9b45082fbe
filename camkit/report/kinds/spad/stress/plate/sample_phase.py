"""Pixels that see at another sub-pixel than the bundle says."""

from camkit.report.kinds.spad.stress.applies import makes_finer
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.kernels import moved
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_PICTURES
from camkit.report.kinds.spad.stress.shot import PictureSetting, PictureShot
from camkit.report.stress.scenario import Scenario
from camkit.runtime.kinds.spad.finer.sampling import point_kernel


def _shoot(judge: SpadJudge, scene: SpadScene, value: float) -> PictureShot:
    kernel = moved(judge.studio.camera.kernel, -value)
    bare = moved(point_kernel(kernel.shape[0]), -value)
    return judge.shoot(scene, PictureSetting(kernel=kernel, bare_kernel=bare), with_chi2=True)


SCENARIO = Scenario(
    name="sample_phase",
    title="Phase of the sample",
    knob="shift",
    unit="sub-pixels",
    values=(-2.0, -1.0, -0.5, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0),
    nominal=0.0,
    quick=(-1.0, 0.0, 0.5),
    shoot=_shoot,
    applies=makes_finer,
    note="Along both axes; -2, -1 and 1 are the phases 0, 1 and 3 where the bundle says 2. The "
    ""
    f"picture lies as far beside its place, which alone is most of the error. {OF_PICTURES}",
)
