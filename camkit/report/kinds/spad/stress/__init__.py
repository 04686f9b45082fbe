"""Single photons under stress.

scene          pictures on the fine grid, from which surfaces follow
kernels        kernels of plates that are not as they should be
shot, studio   captures with the plate and without, by time or not
way            the ways to the fine grid, and what they are compared with
score, judge   what came out, beside the truth
spad_rows      the scenarios
"""

from typing import Final

from camkit.report.kinds.spad.stress.judge import spad_judge_of
from camkit.report.kinds.spad.stress.scene import spad_scenes
from camkit.report.kinds.spad.stress.spad_rows import SCENARIOS
from camkit.report.stress.part import StressPart

STRESS: Final = StressPart(scenes=spad_scenes, examiner=spad_judge_of, scenarios=SCENARIOS)
