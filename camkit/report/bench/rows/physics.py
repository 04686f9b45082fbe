"""What a bundle restores by its optics alone, where one of its stages knows that as a method."""

from typing import Final

from camkit.report.bench.one_method import method_rows

METHOD: Final = "physics"
"""`camkit process --method physics`: a solve without the network behind it."""

ROWS = method_rows("physics", METHOD, lacking="no stage of the bundle has this method")
