"""Part of a kind of camera in reports.

A kind whose captures are photographs needs no part of the reports. Another's part
(`camkit.report.kinds.NAME`, or the `report` of its own package) defines `PART`, a `ReportPart`.
The tools find it by `camkit.report.kind_finder`.
"""

from dataclasses import dataclass, field

from camkit.report.bench.part import BenchPart
from camkit.report.stress.stress_part import StressPart


@dataclass(frozen=True, slots=True, kw_only=True)
class ReportPart:
    """A kind of camera in reports.

    Attributes:
        bench: For `camkit bench`: captures with a known truth, rows and metrics of its own.
        stress: For `camkit stress`: scenes, how captures are judged, scenarios of its own.
    """

    bench: BenchPart = field(default_factory=BenchPart)
    stress: StressPart = field(default_factory=StressPart)
