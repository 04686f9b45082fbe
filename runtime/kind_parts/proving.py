"""The self-test of bundles of a kind whose captures are no photographs.

A kind that has a `Maker` of products has no picture that stages make band by band, so its golden
cases are taken and made again by the kind itself: its part of the runtime holds a `Proving`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray

Cases = Mapping[str, tuple[GoldenCase, GoldenArrays]]


class CaseWork(Protocol):
    """A golden capture on its way to its products."""

    def shape_of(self, product: str) -> tuple[int, int, int]:
        """Return (c, h, w) of a product before any of it is computed."""
        ...

    def fill(self, out: FloatArray | None = None, product: str = "image") -> FloatArray:
        """Return a product, (c, h, w)."""
        ...

    def network_input(self, role: str) -> FloatArray:
        """Return what the network of a role is given, (c, h, w)."""
        ...


GoldenRun = Callable[[Bundle, GoldenCase, GoldenArrays, str | None], CaseWork]


@dataclass(frozen=True, slots=True, kw_only=True)
class Proving:
    """The self-test of a kind's bundles.

    Attributes:
        cases: Takes the golden captures with the camera of a bundle, outputs still missing.
        products: Names of the products that can be made of a golden capture.
        run: Makes ready what becomes of one.
        probe: What the network of a role would be given of a capture larger than a window,
            (c, h, w): the cost of a smaller halo is measured with it.
    """

    cases: Callable[[Bundle], Cases]
    products: Callable[[GoldenArrays], tuple[str, ...]]
    run: GoldenRun
    probe: Callable[[Bundle, str], FloatArray]
