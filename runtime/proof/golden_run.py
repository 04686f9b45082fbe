"""A golden case run through the whole pipeline, for export and for `camkit check`."""

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline


def case_work(
    bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str | None
) -> Reconstruction:
    """Prepare the processing of a golden capture, on one thread.

    Args:
        bundle: The bundle; its graphs are checked when the pipeline is made.
        case: ISO, place and white balance of the capture.
        arrays: The case's capture and what it must become.
        size: Of the networks; None for a bundle without any.
    """
    pipeline = Pipeline(bundle, Options(size=size, threads=1))
    capture = pipeline.capture_of(
        np.ascontiguousarray(arrays.capture),
        iso=case.iso,
        white_balance=case.white_balance,
        origin_px=case.origin_px,
    )
    return pipeline.start(capture)
