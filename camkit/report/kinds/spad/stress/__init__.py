"""Single photons under stress.

spad_scene     pictures on the fine grid, from which surfaces follow
kernels        kernels of plates that are not as they should be
spad_shot, studio   captures with the plate and without, by time or not
way            the ways to the fine grid, and what they are compared with
spad_score, judge   what came out, beside the truth
spad_rows      the scenarios
"""

from typing import Final

from camkit.report.kinds.spad.stress.judge import spad_judge_of
from camkit.report.kinds.spad.stress.spad_rows import SCENARIOS
from camkit.report.kinds.spad.stress.spad_scene import spad_scenes
from camkit.report.stress.stress_part import StressPart

STRESS: Final = StressPart(scenes=spad_scenes, examiner=spad_judge_of, scenarios=SCENARIOS)
