"""Rows of pictures: the protocol of tables 4.1 and 4.2.

    picture -- kernel, phase -- N photons of white -- one count -- method -- clipped -- PSNR, SSIM

N is what a sub-pixel of white sends. A pixel that sees all of its sub-pixels collects scale^2 times
as many (4x4: 16 times; a round spot of 30 um of 150 um would make it 32); `light` says so, and 1 in
its place is the same pixel at equal counts.

References: Sun 2021, tables 4.1 and 4.2.
"""

import math
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.report.kinds.spad.score import psnr_db, ssim
from camkit.report.kinds.spad.ways import Method, Way
from camkit.runtime.kinds.spad.finer.camera import network_planes
from camkit.runtime.kinds.spad.finer.linear import Grid
from camkit.runtime.kinds.spad.twin.array import see_through

LEVELS: Final = (None, 10_000.0, 1000.0, 100.0)
"""Photons of white; None for no noise."""
QUICK_LEVELS: Final = (None, 1000.0)
SEED: Final = 404


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counted:
    """A picture as an array counted it.

    Attributes:
        planes: (2, h, w) light and 3 sigma of it, white = 1.
        photons: Of a pixel, on average; inf without noise.
    """

    planes: FloatArray
    photons: float


def count_picture(
    picture: FloatArray, way: Way, grid: Grid, photons: float | None, seed: tuple[int, int]
) -> Counted:
    """Count a picture (m h, m w) once.

    Args:
        picture: White = 1.
        way: How the array samples.
        grid: Where its pixels see.
        photons: That a sub-pixel of white sends; None for no noise.
        seed: Of the noise.
    """
    # rounding may leave a hair below 0
    light = np.maximum(see_through(picture[None], way.kernel, grid)[0], 0)
    if photons is None:
        return Counted(planes=np.stack([light, np.zeros_like(light)]), photons=math.inf)
    white = photons * way.light
    mean = light.astype(np.float64) * white
    counts = np.random.default_rng(seed).poisson(mean).astype(np.float32)
    return Counted(planes=network_planes(counts, white), photons=float(counts.mean()))


def picture_rows(
    pictures: Sequence[FloatArray],
    ways: Sequence[Way],
    grid: Grid,
    levels: Sequence[float | None],
    tell: Callable[[str], None],
) -> Iterator[dict[str, Any]]:
    """Judge every method behind every way of sampling, at every level of light."""
    for way in ways:
        for photons in levels:
            tell(f"{way.sampling}, {'no noise' if photons is None else f'{photons:g} photons'}")
            yield from _rows(pictures, way, grid, photons)
            if way.light != 1 and photons is not None:
                yield from _rows(pictures, replace(way, light=1.0), grid, photons)


def _rows(
    pictures: Sequence[FloatArray], way: Way, grid: Grid, photons: float | None
) -> Iterator[dict[str, Any]]:
    scores: list[list[tuple[float, float]]] = [[] for _ in way.methods]
    for number, picture in enumerate(pictures):
        counted = count_picture(picture, way, grid, photons, (SEED, number))
        for method, method_scores in zip(way.methods, scores, strict=True):
            method_scores.append(_compare(counted, method, picture))
    for method, method_scores in zip(way.methods, scores, strict=True):
        found_db, alike = zip(*method_scores, strict=True)
        yield {
            "sort": "picture",
            "method": method.name,
            "sampling": way.sampling,
            "size": method.size,
            "photons": photons,
            "light": way.light,
            "sigma": None if way.sigma is None else round(way.sigma, 4),
            "psnr_db": round(statistics.fmean(found_db), 4),
            "psnr_std_db": round(statistics.stdev(found_db), 4) if len(method_scores) > 1 else None,
            "ssim": round(statistics.fmean(alike), 5),
            "images": len(method_scores),
        }


def _compare(counted: Counted, method: Method, picture: FloatArray) -> tuple[float, float]:
    restored = np.clip(method.restore(counted.planes, counted.photons), 0, 1)
    return psnr_db(restored, picture), ssim(restored, picture)
