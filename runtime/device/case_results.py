"""Golden cases computed again, and how far each result is from the stored one."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.golden import NO_SIZE, GoldenArrays, golden_from_bytes
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import GOLDEN, Bundle
from camkit.errors import BundleError, ParityError
from camkit.progress import counted
from camkit.runtime.job.reconstruction import Reconstruction

GoldenRun = Callable[[Bundle, GoldenCase, GoldenArrays, str | None], Reconstruction]
"""Prepares the processing of a golden capture with networks of a size; None without any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """The difference of two computations that must agree.

    Attributes:
        what: Names them, for messages.
        difference: Largest |difference|; NaN where one is not finite.
        allowed: The most that is admitted.
        psnr_db: Of the rms difference below the larger of 1 and the largest |value|; infinite
            where they are equal bit for bit, -infinite where one is not finite.
    """

    what: str
    difference: float
    allowed: float
    psnr_db: float

    @property
    def holds(self) -> bool:
        """Return whether they agree."""
        return self.difference <= self.allowed

    @property
    def share(self) -> float:
        """Return the difference as a share of what is allowed."""
        return self.difference / self.allowed if self.allowed else 0.0


def agreement(
    got: FloatArray, expected: FloatArray, *, atol: float, rtol: float, what: str
) -> Agreement:
    """Return how near an array is to the one that is expected.

    Args:
        got: float32, any shape.
        expected: Of the same shape.
        atol: What is admitted in any case.
        rtol: What is admitted of the larger of 1 and the largest |value|.
        what: Names them, for messages.
    """
    peak = max(1.0, float(np.abs(expected).max(initial=0)))
    with np.errstate(invalid="ignore"):
        error = (got - expected).astype(np.float64)
    mean_square = float(np.square(error).mean())
    psnr_db = math.inf if mean_square == 0 else -math.inf
    if 0 < mean_square < math.inf:
        psnr_db = 20 * math.log10(peak) - 10 * math.log10(mean_square)
    return Agreement(
        what=what,
        difference=float(np.abs(error).max(initial=0)),
        allowed=atol + rtol * peak,
        psnr_db=psnr_db,
    )


def case_results(
    bundle: Bundle, run: GoldenRun, sizes: Sequence[str | None]
) -> Iterator[Agreement]:
    """Compute the golden captures again, and yield each product beside the stored one.

    Args:
        bundle: With golden cases, or without any.
        run: The pipeline.
        sizes: Of the networks; None for a bundle without any.

    Raises:
        BundleError: If manifest and golden.safetensors hold other cases.
        ParityError: If a product has another shape than the stored one.
    """
    if not bundle.manifest.golden:
        return
    arrays = golden_arrays(bundle)
    runs = list(itertools.product(sizes, bundle.manifest.golden))
    for size, case in counted(runs, "computing golden cases", "cases"):
        for product in arrays[case.name].outputs:
            stored = arrays[case.name].output(product, size or NO_SIZE)
            if stored is None:
                continue
            where = f"golden case {case.name}, {product} of size {size or NO_SIZE}"
            work = run(bundle, case, arrays[case.name], size)
            # Before any work: a product may be stated finer than memory holds.
            if (shape := work.shape_of(product)) != stored.shape:
                raise ParityError(f"{where}: computed {shape}, stored {stored.shape}")
            got = work.fill(product=product)
            yield agreement(got, stored, atol=case.atol, rtol=case.rtol, what=where)


def golden_arrays(bundle: Bundle) -> dict[str, GoldenArrays]:
    """Return the arrays of the cases that the manifest lists.

    Raises:
        BundleError: If manifest and golden.safetensors hold other cases.
    """
    arrays = golden_from_bytes(bundle.member(GOLDEN)) if GOLDEN in bundle.names else {}
    names = {case.name for case in bundle.manifest.golden}
    if arrays.keys() != names:
        raise BundleError(
            f"the manifest has the golden cases {', '.join(sorted(names))}; "
            f"{GOLDEN} has {', '.join(sorted(arrays))}"
        )
    return arrays
