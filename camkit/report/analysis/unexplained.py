"""Residual of a capture that a picture does not explain: |PSF * x - y| / sigma, squared.

    picture x -> light through the lens, its haze too -> what the samples would be -> against y

Sigma is the noise of photons, amplifier and converter alone. Of the true scene the mean is 1; above
it a picture holds what the capture denies, or lacks what it shows. What the optics pass nothing of
is neither.

A level that is 1 % wrong is many sigmas of a bright patch off, whatever is in the patch: behind a
haze, where levels are computed, that hides all else. So detail is looked at by itself, too.
"""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.report.analysis.point_image import Array
from camkit.report.stress.consistency import CLIPPED_REACH_PX, near
from camkit.report.stress.shot import Shot
from camkit.runtime.twin.exposure import signal_of, variance_of
from camkit.runtime.twin.light import Lens, LightOptions, light_of

LEVEL_PX: Final = 32
"""Side of the square whose mean is the level; finer than that is detail."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unexplained:
    """Residual of every pixel, (h, w); NaN near clipped samples.

    Attributes:
        chi2: Of all.
        detail: Less the mean, of the samples of its colour, over `LEVEL_PX`.
    """

    chi2: Array
    detail: Array


def unexplained(picture: FloatArray, shot: Shot, lens: Lens) -> Unexplained:
    """Photograph a picture again and compare it with its capture.

    Args:
        picture: (3, s h, s w) linear Rec.709 in the geometry of the sensor, vignetting divided
            out; where that is not finite or below zero it counts as black.
        shot: Its capture.
        lens: What the light went through.
    """
    capture = shot.capture
    light_map = np.nan_to_num(np.maximum(picture, 0), nan=0.0, posinf=0.0).astype(np.float32)
    options = LightOptions(exposure=shot.exposure, scale=shot.scene.scale, distort=False)
    light = light_of(light_map, shot.sensor, lens, shot.light.window, options)
    predicted = signal_of(light, shot.sensor).astype(np.float64)
    captured = capture.linear_rows(0, capture.height).astype(np.float64)
    residual, variance = captured - predicted, variance_of(predicted, shot.noise, shot.step)
    unknown = near(capture.saturated_rows(0, capture.height), CLIPPED_REACH_PX)

    def squared(rest: Array) -> Array:
        chi2 = np.square(rest) / variance
        chi2[unknown] = np.nan
        # planes are as many samples of a pixel
        return np.asarray(chi2 if chi2.ndim == 2 else chi2.mean(axis=0))

    return Unexplained(chi2=squared(residual), detail=squared(_detail(residual)))


def _detail(residual: Array) -> Array:
    """Subtract the level from a mosaic (h, w), each place of its pattern alone, or from planes."""
    detail = residual.copy()
    if residual.ndim == 2:
        parts = [detail[y::2, x::2] for y in (0, 1) for x in (0, 1)]
        side = LEVEL_PX // 2
    else:
        parts, side = list(detail), LEVEL_PX
    for part in parts:
        np.subtract(part, cv2.blur(np.ascontiguousarray(part), (side, side)), out=part)
    return detail
