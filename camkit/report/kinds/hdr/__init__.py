"""Snapshot HDR in reports.

capture     a scene with the plate, and through the bare lens
lights      scenes with lights, for the sweeps
judge       linear PSNR to 2^8, beside the picture of the bare lens
hdr_rows    scenarios: what may go wrong with lights and their streaks
"""

from typing import Final

from camkit.report.bench.part import BenchPart
from camkit.report.kind import ReportPart
from camkit.report.kinds.hdr.capture import photograph
from camkit.report.kinds.hdr.hdr_rows import SCENARIOS
from camkit.report.kinds.hdr.judge import hdr_judge_of
from camkit.report.stress.stress_part import StressPart

PART: Final = ReportPart(
    bench=BenchPart(photograph=photograph, positions=(0,), isos=(100.0,), source="night"),
    stress=StressPart(examiner=hdr_judge_of, scenarios=SCENARIOS),
)
