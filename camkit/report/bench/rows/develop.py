"""No restoration: the other stages of a bundle alone, the floor of time and quality."""

from camkit.report.bench.one_method import method_rows
from camkit.runtime.plan.decision import DEVELOP

ROWS = method_rows("develop", DEVELOP, lacking="nothing stands for what its restoration gives")
