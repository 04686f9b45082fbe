"""A gate that is wider or narrower than the bundle says."""

from dataclasses import replace

from camkit.errors import UnsupportedError
from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.judge import SpadJudge
from camkit.report.kinds.spad.stress.scene import SpadScene
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.shot import DepthSetting, DepthShot
from camkit.report.stress.scenario import Scenario
from camkit.runtime.kinds.spad.pulse import GatedPulse, Pulse


def gate_like(stated: Pulse, *, width: float = 1.0, rc: float = 1.0) -> Pulse:
    """Return a gate whose width and time constant are other ones, by factors.

    Raises:
        UnsupportedError: If it is no gate.
    """
    if not isinstance(stated, GatedPulse):
        raise UnsupportedError("the bundle states no gate, so none can be another")
    return replace(stated, width_ps=width * stated.width_ps, rc_ps=rc * stated.rc_ps)


def scan_through(
    judge: SpadJudge, scene: SpadScene, *, width: float = 1.0, rc: float = 1.0
) -> DepthShot:
    """Count surfaces through such a gate; the fit believes what the bundle states.

    Raises:
        UnsupportedError: If it states no gate.
    """
    axis, stated = judge.studio.times()
    other = gate_like(stated, width=width, rc=rc)
    return judge.scan(scene, DepthSetting(pulse=other, believed=(axis, stated)))


SCENARIO = Scenario(
    name="gate_width",
    title="Depth: width of the gate",
    knob="true over stated width",
    unit="",
    values=(0.5, 0.8, 0.9, 0.95, 0.98, 1.0, 1.02, 1.05, 1.1, 1.25, 2.0),
    nominal=1.0,
    quick=(0.9, 1.0, 1.1),
    shoot=lambda judge, scene, value: scan_through(judge, scene, width=value),
    applies=has_times,
    log=True,
    note=f"All times move alike; [correction] offset_ps would take that off. {OF_DEPTH}",
)
