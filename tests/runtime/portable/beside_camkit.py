"""Bundles with the rules of other readers, and what camkit makes of a capture by them."""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.manifest import GoldenCase
from camkit.bundle.reader import Bundle, built_in_bundles, open_bundle
from camkit.bundle.writer import write_bundle
from camkit.runtime.options import Options
from camkit.runtime.pipeline import Pipeline
from tools.repack import PORTABLE


def bundle_with_rules(name: str, folder: Path) -> Bundle:
    """Write a built-in bundle with the rules that other readers follow too."""
    old = open_bundle(built_in_bundles()[name])
    changes = dict(PORTABLE)
    stages = tuple(
        stage.model_copy(update=changes.get(type(stage), {})) for stage in old.manifest.stages
    )
    manifest = old.manifest.model_copy(update={"stages": stages, "format_version": "2.12"})
    members = {member: old.member(member) for member in old.names}
    return write_bundle(folder / f"{name}.camkit", manifest, members)


def camkit_light(
    bundle: Bundle, capture: NDArray[Any], case: GoldenCase, **options: Any
) -> FloatArray:
    """Return what camkit makes of a capture with a network of size S."""
    pipeline = Pipeline(bundle, Options(size="S", threads=1, **options))
    prepared = pipeline.capture_of(
        capture, iso=case.iso, white_balance=case.white_balance, origin_px=case.origin_px
    )
    return np.asarray(pipeline.start(prepared).fill(product="image"))


def decibels(light: FloatArray, expected: FloatArray) -> float:
    """Return the PSNR; the peak is white, or of dark captures the brightest light that there is."""
    peak = min(1.0, float(np.abs(expected).max()))
    error = np.mean(np.square(light - expected, dtype=np.float64))
    return float(20 * np.log10(peak) - 10 * np.log10(error))
