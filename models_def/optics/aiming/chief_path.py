"""Chief rays from the axis out to the widest field that a lens takes in.

The chief ray of a field meets the vertex plane of the first surface at y = -lead tan(angle), and
one beyond 89.5 degrees starts at -lead sin(angle) (`field`); for a distant object the lead is the
depth of the entrance pupil. In wide-angle lenses it moves by more
than a focal length over the field, and no ray aimed at the paraxial pupil reaches the stop. So the
field is widened step by step: each chief ray starts where those before it foretell, and a step
that loses it is halved. Where steps end, the lens ends.
"""

import functools
import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.models_def.optics.aiming.field import field_angle, lead_factor, slope_of
from camkit.models_def.optics.aiming.newton import AIM_TOLERANCE, DIFFERENCE, flat_map
from camkit.models_def.optics.aiming.start import launch, with_open_apertures
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG, widest_deg
from camkit.models_def.optics.paraxial import entrance_pupil
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.trace import Rays, SurfaceTensors, surface_tensors, trace
from camkit.units import to_degrees, to_radians

_FIRST_STEP_DEG: Final = 2.0
_LARGEST_STEP_DEG: Final = 6.0
_SMALLEST_STEP_DEG: Final = 0.02
_GROWTH: Final = 1.6
_CORRECTIONS: Final = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class ChiefPath:
    """Chief rays of the reference wavelength, field after field; no rim stops them.

    Attributes:
        angles_rad: (field,), from 0 to the widest field whose chief ray reaches the sensor.
        lead_mm: (field,), see the module.
        heights_mm: (field,), of the chief rays on the sensor.
    """

    angles_rad: NDArray[np.float64]
    lead_mm: NDArray[np.float64]
    heights_mm: NDArray[np.float64]

    def lead_at(self, slope: torch.Tensor) -> torch.Tensor:
        """Return the lead in mm of field slopes of any shape."""
        angles = field_angle(torch.abs(slope.detach())).numpy()
        return torch.from_numpy(np.interp(angles, self.angles_rad, self.lead_mm))

    @property
    def outermost(self) -> int:
        """Number of the field that lands farthest from the axis."""
        return int(np.abs(self.heights_mm).argmax())

    @property
    def reach(self) -> str:
        """The widest field, in words."""
        degrees, height_mm = to_degrees(float(self.angles_rad[-1])), abs(float(self.heights_mm[-1]))
        return f"{degrees:.1f} degrees = {height_mm:.2f} mm"


def lens_length_mm(lens: Lens) -> float:
    """Return the sum of all gaps, what lengths are compared with."""
    return sum(abs(surface.thickness_mm) for surface in lens.surfaces)


@functools.lru_cache(maxsize=64)
def chief_path(lens: Lens) -> ChiefPath:
    """Trace chief rays from the axis to the widest field, at the reference wavelength."""
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    with torch.no_grad():
        tensors = with_open_apertures(surface_tensors(lens, wave))
        return _walk(lens, tensors)


def _walk(lens: Lens, tensors: SurfaceTensors) -> ChiefPath:
    fields = [(0.0, _paraxial_lead_mm(lens, tensors), 0.0)]
    step = _FIRST_STEP_DEG
    widest = widest_deg(lens.object_distance_mm)
    while fields[-1][0] < widest and step > _SMALLEST_STEP_DEG:
        here = fields[-1][0]
        angle = min(here + step, TANGENT_DEG if here < TANGENT_DEG else widest)
        chief = _corrected(lens, tensors, angle, _foretold(fields, angle))
        if chief is None:
            step /= 2
            continue
        fields.append((angle, *chief))
        step = min(step * _GROWTH, _LARGEST_STEP_DEG)
    angles, leads, heights = np.array(fields).T
    return ChiefPath(angles_rad=np.radians(angles), lead_mm=leads, heights_mm=heights)


def _paraxial_lead_mm(lens: Lens, tensors: SurfaceTensors) -> float:
    """Return the lead of fields close to the axis; that of a pupil at infinity too."""
    place_mm, distance_mm = float(entrance_pupil(tensors, lens.stop)[0]), lens.object_distance_mm
    if math.isinf(distance_mm):
        return place_mm if math.isfinite(place_mm) else 0.0
    return 1 / (1 / distance_mm + 1 / place_mm) if place_mm else 0.0


def _foretold(fields: list[tuple[float, float, float]], angle: float) -> float:
    """Return the lead of an angle, of which it is an even function, from its last two values."""
    if len(fields) == 1:
        return fields[0][1]
    (first, near, _), (last, far, _) = fields[-2:]
    return far + (far - near) * (angle**2 - last**2) / (last**2 - first**2)


def _corrected(
    lens: Lens, tensors: SurfaceTensors, angle_deg: float, lead_mm: float
) -> tuple[float, float] | None:
    """Return lead and sensor height of the chief ray of a field, by Newton; None if it is lost."""
    length_mm, slope = lens_length_mm(lens), slope_of(to_radians(angle_deg))
    step = DIFFERENCE * length_mm
    slopes = torch.full((2,), slope, dtype=torch.float64)
    factor = float(lead_factor(slopes)[0])
    for _ in range(_CORRECTIONS):
        y = torch.tensor([-lead_mm * factor, -lead_mm * factor + step], dtype=torch.float64)
        on_surfaces: list[Rays] = []
        start = launch(torch.zeros_like(y), y, slopes, lens.object_distance_mm)
        end = trace(tensors, start, surface_rays=on_surfaces)
        here, ahead = on_surfaces[lens.stop].y.tolist()
        gain = (ahead - here) / step
        if not bool(end.valid.all()) or flat_map(gain):
            return None
        if abs(here) < AIM_TOLERANCE * length_mm:
            return lead_mm, float(end.y[0])
        lead_mm += here / gain / factor
    return None
