"""Arrays of single photons in reports: they take no photographs, and measure themselves.

scenes        pictures to judge on, as luminance on the fine grid
ways          how an array samples, and what makes its photons finer; with the baselines
bicubic       interpolation at the true phase
score         PSNR and SSIM
pictures      rows of pictures: every way of sampling, at every level of light
synthetic     photons drawn behind the prototype's gate
timing        rows of times of flight: errors over their bound, false alarms
seconds       rows of CPU seconds: a frame, light in flight, a cube of depth
measure       all rows of a bundle
stress        where its methods fail: scenes, scenarios, and what judges them
"""

from typing import Final

from camkit.report.bench.part import BenchPart
from camkit.report.kind import ReportPart
from camkit.report.kinds.spad.measure import measure
from camkit.report.kinds.spad.stress import STRESS

PART: Final = ReportPart(bench=BenchPart(measure=measure), stress=STRESS)
