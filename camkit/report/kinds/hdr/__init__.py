"""Snapshot HDR in reports."""

from typing import Final

from camkit.report.bench.part import BenchPart
from camkit.report.kind import ReportPart
from camkit.report.kinds.bayer.develop import ROWS
from camkit.report.quality import expose
from camkit.report.stress.part import StressPart
from camkit.report.stress.scene import stress_scenes
from camkit.report.stress.score import judge_of

PART: Final = ReportPart(
    bench=BenchPart(photograph=expose, rows=(ROWS,)),
    stress=StressPart(scenes=stress_scenes, examiner=judge_of),
)
