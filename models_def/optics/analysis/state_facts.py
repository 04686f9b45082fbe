"""The configurations of a lens beside each other: first order and spots."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.field import field_slope
from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import rms_about_centroid, spot_diagram
from camkit.models_def.optics.lens_file.states import configuration_name, plain_lens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.units import to_degrees


@dataclass(frozen=True, slots=True, kw_only=True)
class StateFacts:
    """One configuration of a lens; spots are RMS radii about the centroid, reference wavelength.

    Attributes:
        name: Of the configuration.
        is_usual: Whether it is taken where none is named.
        efl_mm: Of a distant object.
        f_number: EFL / entrance pupil diameter.
        object_distance_mm: From the first vertex.
        widest_field_rad: Its last field.
        axis_spot_mm: On the axis; NaN where no light arrives.
        widest_spot_mm: At the last field; NaN where no light arrives.
    """

    name: str
    is_usual: bool
    efl_mm: float
    f_number: float
    object_distance_mm: float
    widest_field_rad: float
    axis_spot_mm: float
    widest_spot_mm: float

    def to_json(self) -> dict[str, Any]:
        """Return it as `camkit lens show --json` has it."""
        return {
            "name": self.name,
            "is_default": self.is_usual,
            "efl_mm": self.efl_mm,
            "f_number": self.f_number,
            "object_distance_mm": self.object_distance_mm,
            "widest_field_deg": to_degrees(self.widest_field_rad),
            "axis_spot_rms_mm": self.axis_spot_mm,
            "widest_spot_rms_mm": self.widest_spot_mm,
        }


def state_facts(lens: Lens, pupil_of: Callable[[Lens], Pupil]) -> tuple[StateFacts, ...]:
    """Measure a lens in each of its configurations; none gives none.

    Args:
        lens: With its configurations.
        pupil_of: Chooses the pupil of a lens in one of them.
    """
    usual = configuration_name(lens)
    return tuple(
        _facts(plain_lens(lens, state.name), state.name, pupil_of, is_usual=state.name == usual)
        for state in lens.configurations
    )


def _facts(
    lens: Lens, name: str, pupil_of: Callable[[Lens], Pupil], *, is_usual: bool
) -> StateFacts:
    data = paraxial_data(lens)
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    widest_rad = max(lens.field_angles_rad)
    slopes = field_slope(torch.tensor([0.0, widest_rad], dtype=torch.float64))
    try:
        with torch.no_grad():
            spots = spot_diagram(lens, slopes, wave, pupil_of(lens))
        axis_mm, edge_mm = rms_about_centroid(spots)[:, 0]
        spots_mm = float(axis_mm), float(edge_mm)
    except ContractError:  # the stop has no radius, or no ray passes it
        spots_mm = math.nan, math.nan
    return StateFacts(
        name=name,
        is_usual=is_usual,
        efl_mm=data.efl_mm,
        f_number=abs(data.f_number),
        object_distance_mm=lens.object_distance_mm,
        widest_field_rad=widest_rad,
        axis_spot_mm=spots_mm[0],
        widest_spot_mm=spots_mm[1],
    )
