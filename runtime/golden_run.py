"""A golden case run through the whole pipeline, for export and for `camkit check`."""

import numpy as np

from camkit.bundle.golden import GoldenArrays
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline


def develop_case(bundle: Bundle, case: GoldenCase, arrays: GoldenArrays, size: str) -> FloatArray:
    """Give the pipeline's output (3, h, w) for a golden capture, on one thread.

    Args:
        bundle: The bundle; its graphs are checked when the pipeline is made.
        case: ISO, place and white balance of the capture.
        arrays: The case's capture and what it must become.
        size: S, M or L.
    """
    pipeline = Pipeline(bundle, Options(size=size, threads=1))
    return pipeline.process_array(
        np.ascontiguousarray(arrays.capture),
        iso=case.iso,
        white_balance=case.white_balance,
        origin_px=case.origin_px,
    )
