"""Single photons under stress.

scene                  pictures on the fine grid, from which surfaces follow
kernels                kernels of plates that are not as they should be
shot, studio           captures with the plate and without, by time or not
upsampled, way         the ways to the fine grid, and what they are held against
score, judge           what came out, beside the truth
applies                for which bundles scenarios are meant
light, plate, times    the scenarios
"""

from typing import Final

from camkit.report.discovery import discover
from camkit.report.kinds.spad.stress.judge import spad_judge_of
from camkit.report.kinds.spad.stress.scene import spad_scenes
from camkit.report.stress.part import StressPart
from camkit.report.stress.scenario import SCENARIO, Scenario

FOLDERS: Final = ("light", "plate", "times")

STRESS: Final = StressPart(
    scenes=spad_scenes,
    examiner=spad_judge_of,
    scenarios=tuple(
        scenario
        for folder in FOLDERS
        for scenario in discover(f"{__name__}.{folder}", SCENARIO, Scenario)
    ),
)
