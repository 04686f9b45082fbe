"""Golden captures of bundles whose cameras do not photograph procedural scenes as others do."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from camkit.arrays import FloatArray
from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle

Cases = Mapping[str, tuple[GoldenCase, GoldenArrays]]


@dataclass(frozen=True, slots=True, kw_only=True)
class GoldenCaptures:
    """The golden captures of a kind.

    Attributes:
        cases: Takes them with the camera of a bundle; what becomes of them is still missing.
        probe: What the network of a role would be given of a capture larger than a window,
            (c, h, w): the cost of a smaller halo is measured with it.
    """

    cases: Callable[[Bundle], Cases]
    probe: Callable[[Bundle, str], FloatArray]
