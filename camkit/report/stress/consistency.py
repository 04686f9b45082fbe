"""Consistency of a restoration with its capture: chi^2 per pixel, after blurring again.

    restored light -> blur by the bundle's PSF -> samples -> (capture - samples)^2 / variance

The variance is that of the noise that the twin added, plus that of the model: demosaicking and
regularisation leave residuals at edges that no photon explains, in proportion to the contrast
around a sample. Its strength is one number per method and scene, the `model error`, found on the
nominal capture so that chi^2 is 1 there (`calibrate`); where no such number brings it to 1 (kernels
wider than the contrast around a sample tells of), chi^2 is counted in units of the nominal one.
What lies above 1 is then unexplained: detail that was invented, or light that was lost.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import scipy.ndimage
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.report.stress.shot import Shot
from camkit.runtime.geometry.field_blur import scatter, scatter_light
from camkit.runtime.geometry.shrink import shrunk
from camkit.runtime.twin.exposure import sample_planes, variance_of
from camkit.runtime.twin.haze_spread import hazed, margin_px
from camkit.runtime.twin.light import Lens, lit_core

LIMIT: Final = 1.3
"""chi^2 per pixel above which a restoration no longer fits its capture."""
BORDER_PX: Final = 32
CLIPPED_REACH_PX: Final = 24
"""What lies this near to a clipped sample is left out."""
SPOILED_REACH_PX: Final = 3
"""The same for samples that a scenario broke: their repair reaches the demosaicking, no further."""
CONTRAST_PX: Final = 5
MIDDLE_PX: Final = 256
"""Only the middle of a picture is judged: blurring is what a sweep spends its time on."""
BLUR_STEP_PX: Final = 256
MOST_MODEL_ERROR: Final = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Residual:
    """Samples of a capture against a restoration blurred again, judged samples only.

    Attributes:
        squared: (n,) squared difference, 1.0 = white level squared.
        noise_variance: (n,) variance of photons, amplifier and converter.
        contrast: (n,) variance of the blurred picture around the sample.
    """

    squared: NDArray[np.float64]
    noise_variance: NDArray[np.float64]
    contrast: NDArray[np.float64]

    def chi2(self, model_error: float) -> float:
        """Return chi^2 per sample.

        Args:
            model_error: Deviation of the model as a share of the contrast.
        """
        variance = self.noise_variance + model_error**2 * self.contrast
        return float(np.mean(self.squared / variance))


def residual(planes: FloatArray, shot: Shot, lens: Lens) -> Residual | None:
    """Blur the middle of a restoration and compare it with its capture.

    Args:
        planes: (c, s h, s w) restored, white-balanced camera space, vignetting still in; a pixel
            sees the mean of its s x s samples.
        shot: The capture.
        lens: As the restoration assumed it.

    Returns:
        None where fewer than a tenth of the samples can be judged, or the planes are not the
        channels of the sensor.
    """
    capture, gains = shot.capture, shot.light.gains
    if planes.shape[0] != len(shot.sensor.channels):
        return None
    planes = shrunk(planes, planes.shape[2] // capture.width)
    rows, columns = (_middle(side) for side in planes.shape[1:])
    judged = judged_pixels(shot)[..., rows, columns]
    if judged.size == 0 or judged.mean() < 0.1:
        return None
    blurred = _blur(planes, shot, lens, (rows, columns))
    predicted = sample_planes(blurred, shot.sensor, gains).astype(np.float64)[judged]
    contrast = sample_planes(_contrast(blurred), shot.sensor, gains)[judged].astype(np.float64)
    captured = capture.linear_rows(rows.start, rows.stop)[..., columns][judged]
    return Residual(
        squared=np.square(captured.astype(np.float64) - predicted),
        noise_variance=variance_of(predicted, shot.noise, shot.step),
        contrast=np.square(contrast),
    )


def _middle(side_px: int) -> slice:
    """Return the middle of an axis, from an even pixel so that the mosaic keeps its phase."""
    length = min(MIDDLE_PX, side_px)
    start = (side_px - length) // 2 // 2 * 2
    return slice(start, start + length)


def _blur(planes: FloatArray, shot: Shot, lens: Lens, part: tuple[slice, slice]) -> FloatArray:
    """Blur a part of a picture with the light from around it, through the haze too."""
    margin, (rows, columns) = lens.margin_px, part
    pad = ((0, 0), (margin, margin), (margin, margin))
    extended = np.pad(np.maximum(planes, 0), pad, mode="symmetric")
    widened = (slice(s.start, s.stop + 2 * margin) for s in part)
    x, y = shot.light.window.origin_px
    window = replace(
        shot.light.window,
        size_px=(columns.stop - columns.start, rows.stop - rows.start),
        origin_px=(x + columns.start, y + rows.start),
    )
    crop = extended[:, *widened]
    if lens.haze is None:
        return scatter(crop, lens.kernels_at, window, margin_px=margin, step_px=BLUR_STEP_PX)
    core, ones = scatter_light(crop, lit_core(lens), window, margin_px=margin, step_px=BLUR_STEP_PX)
    # haze comes from all of the picture, and from farther than the core's margin
    wide_px = margin_px(lens.haze, margin)
    pad = ((0, 0), (wide_px, wide_px), (wide_px, wide_px))
    wide = np.pad(np.maximum(planes, 0), pad, mode="symmetric")
    veil, even = hazed(wide, lens.haze, shot.light.window, around_px=wide_px)
    core += veil[:, rows, columns]
    core /= ones + even[:, rows, columns]
    return core


def judged_pixels(shot: Shot) -> NDArray[np.bool_]:
    """Return bool of the shape of the samples, true away from border, clipped and spoiled ones."""
    capture = shot.capture
    clipped = capture.saturated_rows(0, capture.height)
    if shot.spoiled is not None:
        clipped &= ~shot.spoiled
    judged = ~near(clipped, CLIPPED_REACH_PX)
    if shot.spoiled is not None:
        judged &= ~near(shot.spoiled, SPOILED_REACH_PX)
    judged[..., :BORDER_PX, :] = judged[..., -BORDER_PX:, :] = False
    judged[..., :BORDER_PX] = judged[..., -BORDER_PX:] = False
    return judged


def near(mask: NDArray[np.bool_], reach_px: int) -> NDArray[np.bool_]:
    """Return what lies within a square of `reach_px` around true samples, plane by plane."""
    if not mask.any():
        return mask.copy()
    side = 2 * reach_px + 1
    size = (1,) * (mask.ndim - 2) + (side, side)
    return np.asarray(scipy.ndimage.maximum_filter(mask, size, mode="constant"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Scale by which chi^2 of a method is counted on a scene.

    Attributes:
        model_error: As `Residual.chi2` takes it.
        unit: Of chi^2: 1, or what stays on the nominal capture with the largest model error.
    """

    model_error: float = 0.0
    unit: float = 1.0

    def chi2(self, residuals: Residual) -> float:
        """Return chi^2 per sample, 1 (or less) on the nominal capture."""
        return residuals.chi2(self.model_error) / self.unit


def calibrate(nominal: Residual) -> Scale:
    """Return the scale on which chi^2 of a nominal capture is 1; less if it is without any."""
    low, high = 0.0, MOST_MODEL_ERROR
    if nominal.chi2(low) <= 1:
        return Scale()
    if (unit := nominal.chi2(high)) > 1:
        return Scale(model_error=high, unit=unit)
    for _ in range(30):
        middle = (low + high) / 2
        low, high = (middle, high) if nominal.chi2(middle) > 1 else (low, middle)
    return Scale(model_error=high)


def _contrast(planes: FloatArray) -> FloatArray:
    """Return the standard deviation within a small square around every pixel, (c, h, w)."""
    size = (1, CONTRAST_PX, CONTRAST_PX)
    mean = scipy.ndimage.uniform_filter(planes, size)
    square = scipy.ndimage.uniform_filter(np.square(planes), size)
    return np.asarray(np.sqrt(np.maximum(square - np.square(mean), 0)), dtype=np.float32)
