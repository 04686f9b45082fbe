"""Position of the sensor: at the paraxial image, the smallest spots, or the flattest wavefront.

The last two are least squares with one solution, since rays are straight behind the lens: a point
on a sensor moved by s is x + s l / n, and a path to a point on it grows linearly with s.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import field_slope
from camkit.models_def.optics.aiming.start import path_before
from camkit.models_def.optics.paraxial import paraxial_image
from camkit.models_def.optics.prescription import (
    Lens,
    require_plain,
    require_round,
    with_focus_shift,
)
from camkit.models_def.optics.pupil import half_disc, pupil_rays
from camkit.models_def.optics.trace import Rays, surface_tensors, trace

FocusMerit = Literal["paraxial", "spot", "wavefront"]
FOCUS_MERITS: Final[tuple[FocusMerit, ...]] = get_args(FocusMerit)
_RAYS: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class SpotFocus:
    """The place of the sensor with the least spots.

    Attributes:
        shift_mm: By how much the sensor should move away from the lens.
        rms_mm: RMS radius over all fields and wavelengths where the sensor is.
        best_rms_mm: The same at the best place.
    """

    shift_mm: float
    rms_mm: float
    best_rms_mm: float


def focus_shift_mm(lens: Lens, merit: FocusMerit) -> float:
    """Return the distance by which the sensor should move away from the lens.

    Args:
        lens: The prescription; its fields, wavelengths and object distance count.
        merit: `paraxial`: the paraxial image at the reference wavelength. `spot`: the least mean
            square radius about the centroid of all wavelengths of a field. `wavefront`: the
            least variance of the wavefront, tilt of each field and piston of each wavelength
            removed.

    Raises:
        ContractError: If the merit is wrong, or no ray arrives.
    """
    if merit not in FOCUS_MERITS:
        raise ContractError(f"the merit must be one of {', '.join(FOCUS_MERITS)}; got {merit}")
    if merit == "paraxial":
        return paraxial_image(lens).distance_mm - lens.surfaces[-1].thickness_mm
    if merit == "spot":
        return spot_focus(lens).shift_mm
    return _wave_shift(*_landings(lens, merit))


def spot_focus(lens: Lens) -> SpotFocus:
    """Return the best place of the sensor by spots, and what they gain there.

    Raises:
        ContractError: If the lens is not round, or no ray arrives.
    """
    landings, weight = _landings(lens, "spot")
    return _spot_focus(landings, weight)


def _landings(lens: Lens, merit: FocusMerit) -> tuple[Rays, Tensor]:
    """Return rays on the sensor (field, wavelength, rays) with their paths, and their weights."""
    require_round(lens, f"focus by {merit}")
    slopes = field_slope(torch.tensor(lens.field_angles_rad, dtype=torch.float64))
    waves = torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    with torch.no_grad():
        tensors = surface_tensors(lens, waves[:, None])
        slope = slopes[:, None, None].expand(-1, len(waves), 1)
        rays, weight = pupil_rays(lens, tensors, half_disc(_RAYS), slope, definition="stop")
        start_path = path_before(rays, slope, lens.object_distance_mm, tensors.index[0])
        rays = replace(rays, path_mm=start_path)
        landings = trace(tensors, rays, path=True)
        weight = torch.where(landings.valid, weight, 0.0)
        if not bool(weight.sum() > 0):
            raise ContractError(f"no ray of {lens.name} reaches the sensor; it cannot be focused")
    return landings, weight


def with_focus(lens: Lens, merit: FocusMerit) -> Lens:
    """Return the lens with its sensor at the best place; see `focus_shift_mm`."""
    require_plain(lens, "the best focus")
    return with_focus_shift(lens, focus_shift_mm(lens, merit))


def _spot_focus(landings: Rays, weight: Tensor) -> SpotFocus:
    """Minimise sum w |p - mean p + s (t - mean t)|^2, p the landing points, t their slopes.

    The pupil's half x < 0 mirrors the other, so means of x are 0 in it: x needs no mean.
    """
    total = weight.sum((1, 2), keepdim=True).clamp_min(1e-300)

    def centred(value: Tensor) -> Tensor:
        return value - (weight * value).sum((1, 2), keepdim=True) / total

    ty = centred(landings.m / landings.n)
    tx, y = landings.l / landings.n, centred(landings.y)
    both = float((weight * (landings.x * tx + y * ty)).sum())
    steepness = float((weight * (tx**2 + ty**2)).sum())
    if not steepness > 0:  # the light is parallel: no place is better
        rms_mm = math.sqrt(float((weight * (landings.x**2 + y**2)).sum() / weight.sum()))
        return SpotFocus(shift_mm=math.nan, rms_mm=rms_mm, best_rms_mm=rms_mm)
    light, spread = float(weight.sum()), float((weight * (landings.x**2 + y**2)).sum())
    return SpotFocus(
        shift_mm=-both / steepness,
        rms_mm=math.sqrt(spread / light),
        best_rms_mm=math.sqrt(max(spread - both**2 / steepness, 0.0) / light),
    )


def _wave_shift(landings: Rays, weight: Tensor) -> float:
    """Minimise sum w (W + s dW/ds + tilt)^2 with the piston of each beam removed.

    W is the path to the foot of the perpendicular from the reference point of the field, exact to
    second order in the distance by which a ray misses it.
    """
    path = landings.path_mm
    if path is None:
        raise ContractError("rays must carry their optical path; trace them with path=True")
    share = weight / weight.sum((1, 2), keepdim=True).clamp_min(1e-300)
    middle = (share * landings.y).sum((1, 2), keepdim=True)
    lean = (share * landings.m / landings.n).sum((1, 2), keepdim=True)
    waves = path - landings.x * landings.l - (landings.y - middle) * landings.m
    by_shift = lean * landings.m + landings.n
    fields = weight.shape[0]
    tilts = [landings.m * (torch.arange(fields)[:, None, None] == i) for i in range(fields)]
    beam = weight.sum(2, keepdim=True).clamp_min(1e-300)
    root = torch.sqrt(weight)

    def column(value: Tensor) -> Tensor:
        return (root * (value - (weight * value).sum(2, keepdim=True) / beam)).flatten()

    table = torch.stack([column(by_shift), *map(column, tilts)], dim=1)
    solution = torch.linalg.lstsq(table, -column(waves)[:, None]).solution
    return float(solution[0, 0])
