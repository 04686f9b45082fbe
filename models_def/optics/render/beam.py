"""Directions that leave a pixel and pass the stop, and the light that they bring.

Rays are labelled by the point s of the stop, in units of its radius R, that a paraxial ray of
their direction would meet: from a sensor point x with the slope u it is s = (A x + B u) / R. That
is a plain relabelling of slopes, good for telecentric lenses too, and it moves with the lens, so
that rays keep their places in the stop (to first order) when a curvature changes. The labels are
drawn from a disc a little larger than what passes, found by tracing; the stop and the rims of the
real lens decide. A scene of radiance L then lights a pixel with

    E = integral of L n^4 dp dq,    dp dq = (R / B)^2 ds,

p and q the slopes and n the cosine at the sensor: n^3 dp dq is the solid angle, one more n the
foreshortened pixel.
"""

from dataclasses import dataclass
from math import pi
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import trace_paraxial
from camkit.models_def.optics.pupil import half_disc
from camkit.models_def.optics.render.lens_view import Optics
from camkit.models_def.optics.reverse import launch_with_slopes, reverse, trace_to_scene
from camkit.models_def.optics.trace import Rays, SurfaceTensors

# Farther out a lens without rims lets stray rays pass the stop (the Cooke triplet beyond 2).
SEARCH_RADIUS: Final = 1.75
_SEARCH_RAYS: Final = 4096
_SEARCH_HEIGHTS: Final = 9
# The distance of search points is 0.035: nothing that passes lies farther outside than that.
_MARGIN: Final = 0.04
_LIGHT_RAYS: Final = 8192


@dataclass(frozen=True, slots=True, kw_only=True)
class Labels:
    """The map from labels of the stop to slopes: u = (R s - A x) / B.

    Attributes:
        a: A, a scalar that carries gradients.
        b: B in mm, the same.
        radius_mm: R.
    """

    a: Tensor
    b: Tensor
    radius_mm: float

    def slope(self, label: Tensor, x_mm: Tensor) -> Tensor:
        """Return the slope dx/dz towards the scene of labels seen from sensor points."""
        return (self.radius_mm * label - self.a * x_mm) / self.b

    @property
    def area(self) -> Tensor:
        """Slopes (dp dq) per unit disc of labels."""
        return pi * (self.radius_mm / self.b) ** 2


@dataclass(frozen=True, slots=True, kw_only=True)
class BeamTable:
    """The disc of labels that holds all that passes, over the height on the sensor.

    Attributes:
        heights_mm: (height,), increasing from 0.
        middle: (height,), label of the middle of the disc, away from the axis.
        radius: (height,), of the disc.
    """

    heights_mm: NDArray[np.float64]
    middle: NDArray[np.float64]
    radius: NDArray[np.float64]

    def at(self, heights_mm: NDArray[np.float64]) -> tuple[Tensor, Tensor]:
        """Return middle and radius at heights, float32."""
        middle = np.interp(heights_mm, self.heights_mm, self.middle)
        radius = np.interp(heights_mm, self.heights_mm, self.radius)
        return torch.from_numpy(middle).float(), torch.from_numpy(radius).float()


def stop_labels(optics: Optics) -> Labels:
    """Return the labels of the reference wavelength; gradients flow.

    Raises:
        ContractError: If the stop is imaged onto the sensor: no direction reaches it.
    """
    wave = torch.tensor(optics.reference_wavelength_um, dtype=torch.float64)
    tensors = optics.stopped(wave)
    back = reverse(tensors)
    height = torch.tensor([1.0, 0.0], dtype=torch.float64)
    slope = torch.tensor([0.0, 1.0], dtype=torch.float64)
    height = height + tensors.thickness_mm[-1] * slope
    passed = range(len(tensors.aspheric) - 1 - optics.stop)
    if passed:
        height, slope = trace_paraxial(back, height, slope, passed)
        height = height + back.thickness_mm[passed[-1]] * slope
    if float(height[1].detach()) == 0:
        raise ContractError("the stop is imaged onto the sensor; move one of them")
    return Labels(a=height[0], b=height[1], radius_mm=optics.stop_radius_mm)


def rays_from(labels: Labels, x_mm: Tensor, y_mm: Tensor, label_x: Tensor, label_y: Tensor) -> Rays:
    """Start rays on the sensor (z = 0) towards labels of the stop; all broadcast."""
    return launch_with_slopes(x_mm, y_mm, labels.slope(label_x, x_mm), labels.slope(label_y, y_mm))


def light_of(start: Rays, end: Rays) -> Tensor:
    """Return the light n^4 of each ray, 0 for lost ones."""
    return torch.where(end.valid, start.n**4, 0.0)


def find_beams(
    optics: Optics, labels: Labels, radius_mm: float, wavelengths_um: Tensor
) -> BeamTable:
    """Trace a wide grid of labels from heights on the sensor and enclose what passes.

    Args:
        optics: The lens.
        labels: Its labels.
        radius_mm: The largest height.
        wavelengths_um: (wave,), that count together.

    Raises:
        ContractError: If the beam reaches the edge of the search.
    """
    with torch.no_grad():
        points = half_disc(_SEARCH_RAYS)
        x, y = SEARCH_RADIUS * points.x.float(), SEARCH_RADIUS * points.y.float()
        heights = torch.linspace(0, radius_mm, _SEARCH_HEIGHTS)
        tensors = optics.stopped(wavelengths_um[:, None]).converted(torch.float32)
        rays = rays_from(labels_of_type(labels), x * 0, heights[:, None, None], x, y)
        passed = _to_scene(optics, tensors, rays).valid.any(1)
        top = torch.where(passed, y, -torch.inf).amax(1)
        bottom = torch.where(passed, y, torch.inf).amin(1)
        middle = torch.where(passed.any(1), (top + bottom) / 2, 0.0)
        reach = torch.where(passed, torch.hypot(x, y - middle[:, None]), 0.0).amax(1)
        edge = float(torch.where(passed, torch.hypot(x, y), 0.0).max())
    if edge > SEARCH_RADIUS - _MARGIN:
        raise ContractError(
            f"light passes up to the edge of the search, {edge:.2f} stop radii; the lens has no "
            "stop that limits it, or the window lies far outside its field"
        )
    return BeamTable(
        heights_mm=heights.double().numpy(),
        middle=middle.double().numpy(),
        radius=reach.double().numpy() + _MARGIN,
    )


def labels_of_type(labels: Labels, dtype: torch.dtype = torch.float32) -> Labels:
    """Return labels in another type, so that they do not widen the rays."""
    return Labels(a=labels.a.to(dtype), b=labels.b.to(dtype), radius_mm=labels.radius_mm)


def light_at(optics: Optics, labels: Labels, beams: BeamTable, heights_mm: Tensor) -> Tensor:
    """Return E of a scene of radiance 1 at the reference wavelength.

    Unlike `spot.relative_illumination`, which follows the chief ray, this is right for blurred
    images too: each ray brings its own share of the scene.

    Args:
        optics: The lens.
        labels: Its labels; gradients flow.
        beams: Up to the largest height.
        heights_mm: (height,) on the sensor.

    Returns:
        (height,) float64.

    Raises:
        ContractError: If no light reaches the axis.
    """
    wave = torch.tensor(optics.reference_wavelength_um, dtype=torch.float64)
    points = half_disc(_LIGHT_RAYS)
    middle, radius = (v.double()[:, None] for v in beams.at(heights_mm.numpy()))
    place = heights_mm.double()[:, None]
    rays = rays_from(labels, 0 * place, place, radius * points.x, middle + radius * points.y)
    light = light_of(rays, _to_scene(optics, optics.stopped(wave), rays)).mean(1)
    if float(light.detach()[0]) <= 0 and float(heights_mm[0]) == 0:
        raise ContractError("no light reaches the axis; check stop, semi-diameters and focus")
    return light * labels.area * radius[:, 0] ** 2


def _to_scene(optics: Optics, tensors: SurfaceTensors, rays: Rays) -> Rays:
    return trace_to_scene(tensors, rays, optics.object_distance_mm)
