"""As the scenario `depth`, but the methods are told the depth: what `--depth-m` is worth."""

from dataclasses import replace

from camkit.bundle.reader import Bundle
from camkit.report.stress.scenario import Scenario, photographs
from camkit.report.stress.scenarios.lens import depth
from camkit.report.stress.scene import Scene
from camkit.report.stress.score import Judge, see
from camkit.report.stress.verdict import Verdict
from camkit.runtime.job.choices import known_options
from camkit.units import MM_PER_M


def _applies(bundle: Bundle) -> str | None:
    reason = photographs(bundle)
    if reason is not None:
        return reason
    if "depth_m" not in known_options(bundle.manifest.stages):
        return "no stage of it asks for a depth"
    return depth.SCENARIO.applies(bundle)


def depths_of(bundle: Bundle) -> Scenario:
    """Return the scenario with the depths of a bundle."""
    fitted = depth.depths_of(bundle)
    return replace(SCENARIO, values=fitted.values, nominal=fitted.nominal, quick=fitted.quick)


def _measure(judge: Judge, scene: Scene, value: float) -> Verdict:
    rig = judge.rig
    shot = rig.shoot(scene, rig.lens_at(value * MM_PER_M))
    restored = rig.choosing(depth_m=value).restore(shot)
    return Verdict(outcomes=judge.judge(shot, restored, with_chi2=False), seen=see(rig, shot))


SCENARIO = replace(
    depth.SCENARIO,
    name="known_depth",
    title="Depth of the scene, known",
    shoot=None,
    measure=_measure,
    applies=_applies,
    fit=depths_of,
    note="The whole scene lies at one depth, and the methods have the kernels of it. chi^2 is not "
    "judged: it would be calibrated at every depth anew. 1000 m stands for infinity.",
)
