"""A gate whose edges are slower or faster than the bundle says."""

from camkit.report.kinds.spad.stress.applies import has_times
from camkit.report.kinds.spad.stress.score import OF_DEPTH
from camkit.report.kinds.spad.stress.times.gate_width import scan_through
from camkit.report.stress.scenario import Scenario

SCENARIO = Scenario(
    name="gate_rc",
    title="Depth: time constant of the gate",
    knob="true over stated time constant",
    unit="",
    values=(0.1, 0.25, 0.5, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0, 4.0),
    nominal=1.0,
    quick=(0.5, 1.0, 1.5),
    shoot=lambda judge, scene, value: scan_through(judge, scene, rc=value),
    applies=has_times,
    log=True,
    note=OF_DEPTH,
)
