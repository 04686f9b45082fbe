"""Snapshot HDR in reports.

capture     a scene with the plate, and through the bare lens
"""

from typing import Final

from camkit.report.bench.part import BenchPart
from camkit.report.kind import ReportPart
from camkit.report.kinds.bayer.develop import ROWS
from camkit.report.kinds.hdr.capture import photograph
from camkit.report.stress.part import StressPart
from camkit.report.stress.scene import stress_scenes
from camkit.report.stress.score import judge_of

PART: Final = ReportPart(
    bench=BenchPart(
        photograph=photograph, positions=(0,), isos=(100.0,), rows=(ROWS,), source="night"
    ),
    stress=StressPart(scenes=stress_scenes, examiner=judge_of),
)
