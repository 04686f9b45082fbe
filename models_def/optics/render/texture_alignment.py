"""The texture warped to the render, pixel to pixel.

Chief rays of the reference wavelength are traced at 16 heights, the polynomial of eq. (6.10) is
fitted to them, and each pixel looks up the point of the texture that the polynomial gives it. The
same coefficients undistort the picture in deployment.

References: Sun 2021, section 6.2.1 (image alignment during training).
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.distortion import trace_distortion
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.render.texture import Texture, look_up
from camkit.models_def.optics.render.window import Window
from camkit.radial import RadialDistortion

_NEWTON_STEPS: Final = 20
_TOLERANCE: Final = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True)
class Alignment:
    """From the sensor to the plane of the texture.

    Attributes:
        distortion: Of the lens; green counts. Ideal radii are EFL tan(field angle), xi holds what
            the magnification of a near object adds.
        scene_scale: mm in the scene per mm of ideal radius: object distance / EFL.
    """

    distortion: RadialDistortion
    scene_scale: float


def fit_alignment(lens: Lens, window: Window) -> Alignment:
    """Fit the distortion over a window, up to its farthest corner.

    Args:
        lens: With a finite object distance.
        window: The pixels.

    Raises:
        ContractError: If the object is at infinity or a chief ray is lost.
    """
    if not np.isfinite(lens.object_distance_mm):
        raise ContractError("a texture hangs at a finite distance; set object_distance_mm")
    return Alignment(
        distortion=trace_distortion(lens, window.radius_mm),
        scene_scale=lens.object_distance_mm / paraxial_data(lens).efl_mm,
    )


def scene_radius_mm(alignment: Alignment, heights_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance from the axis, in the scene, of what lands at heights on the sensor.

    Raises:
        ContractError: If the polynomial cannot be inverted there.
    """
    distortion = alignment.distortion
    c1, c3, c5, c7 = distortion.coefficients[1]
    ratio = heights_mm / distortion.radius_mm
    r = ratio / c1
    for _ in range(_NEWTON_STEPS):
        q = r * r
        slope = c1 + q * (3 * c3 + q * (5 * c5 + q * 7 * c7))
        if not (slope > 0).all():
            raise ContractError("the distortion folds inside the window; make the window smaller")
        missed_by = ratio - r * (c1 + q * (c3 + q * (c5 + q * c7)))
        if np.abs(missed_by).max() < _TOLERANCE:
            return np.asarray(r * (distortion.radius_mm * alignment.scene_scale))
        r = r + missed_by / slope
    raise ContractError("the distortion polynomial has no inverse; make the window smaller")


def align_reference(
    texture: Texture, alignment: Alignment, window: Window, *, oversample: int = 1
) -> Tensor:
    """Warp a texture to the pixels of a window: what a lens without blur would record.

    Args:
        texture: The picture; gradients flow to its values.
        alignment: Of the lens.
        window: The pixels.
        oversample: Points along each side of a pixel that are averaged.

    Returns:
        (3, h, w), linear, in the unit of the texture.
    """
    if oversample < 1:
        raise ContractError(f"oversample must be >= 1; got {oversample}")
    fine = finer(window, oversample)
    ys, xs = fine.centres_mm()
    height = torch.hypot(xs, ys[:, None])
    # near the axis the ratio is that of the polynomial's first term
    safe = height.clamp_min(1e-9)
    ratio = torch.from_numpy(scene_radius_mm(alignment, safe.numpy())) / safe
    samples = look_up(texture, *((-v * ratio).expand(3, -1, -1) for v in (xs, ys[:, None])))
    return averaged(samples, oversample)


def finer(window: Window, factor: int, margin_px: int = 0) -> Window:
    """Return a window with pixels divided by a factor and a margin of such pixels around."""
    pitch_mm = window.pitch_mm / factor
    shift_mm = window.pitch_mm / 2 - pitch_mm / 2 + margin_px * pitch_mm
    return replace(
        window,
        height_px=window.height_px * factor + 2 * margin_px,
        width_px=window.width_px * factor + 2 * margin_px,
        pitch_um=window.pitch_um / factor,
        top_mm=window.top_mm - shift_mm,
        left_mm=window.left_mm - shift_mm,
    )


def averaged(planes: Tensor, factor: int) -> Tensor:
    """Return the means of blocks of factor x factor pixels of (3, h, w)."""
    if factor == 1:
        return planes
    _, h, w = planes.shape
    return planes.reshape(3, h // factor, factor, w // factor, factor).mean((2, 4))
