"""A lens made larger or smaller, faster or slower."""

import math
import re
from dataclasses import replace
from typing import Final

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface, require_plain
from camkit.models_def.optics.shape.phase import Phase

_F_NUMBER: Final = re.compile(r"\bF/\d+(\.\d+)?$")


def scale_lens(lens: Lens, factor: float) -> Lens:
    """Return the lens with every length times a factor; angles, conics and F-number stay.

    Args:
        lens: The prescription.
        factor: > 0.
    """
    if not (math.isfinite(factor) and factor > 0):
        raise ContractError(f"the scale must be a number > 0; got {factor}")
    length = 1.0 if lens.aperture_kind == "f_number" else factor
    return replace(
        lens,
        surfaces=tuple(_scaled(surface, factor) for surface in lens.surfaces),
        aperture_value=lens.aperture_value * length,
        object_distance_mm=lens.object_distance_mm * factor,
        configurations=tuple(state.scaled(factor) for state in lens.configurations),
    )


def _scaled(surface: Surface, factor: float) -> Surface:
    # a_j multiplies r^(2 j) and gives mm; normalised, it is in mm itself
    normal = surface.normal_radius_mm
    even, odd = enumerate(surface.even_asphere, start=1), enumerate(surface.odd_asphere)
    grooves, phase, stance = surface.grooves, surface.phase, surface.stance
    dx, dy = stance.decentre_mm if stance else (0.0, 0.0)
    return replace(
        surface,
        curvature_per_mm=surface.curvature_per_mm / factor,
        thickness_mm=surface.thickness_mm * factor,
        semi_diameter_mm=surface.semi_diameter_mm * factor,
        grooves=None
        if grooves is None
        else replace(
            grooves,
            depth_um=grooves.depth_um * factor,
            tool_radius_um=grooves.tool_radius_um * factor,
        ),
        even_asphere=tuple(a * factor ** (1 - 2 * j if normal is None else 1) for j, a in even),
        odd_asphere=tuple(a * factor ** (-2 * j if normal is None else 1) for j, a in odd),
        q_bfs=tuple(a * factor for a in surface.q_bfs),
        q_con=tuple(a * factor for a in surface.q_con),
        normal_radius_mm=None if normal is None else normal * factor,
        phase=None if phase is None else _scaled_phase(phase, factor),
        stance=None if stance is None else replace(stance, decentre_mm=(factor * dx, factor * dy)),
    )


def _scaled_phase(phase: Phase, factor: float) -> Phase:
    """Return a phase over a larger radius whose slopes, and so the bends, stay."""
    return replace(
        phase,
        radius_mm=phase.radius_mm * factor,
        radial_rad=tuple(a * factor for a in phase.radial_rad),
        free_rad=tuple(
            replace(m, coefficient_rad=m.coefficient_rad * factor) for m in phase.free_rad
        ),
    )


def scale_to_efl(lens: Lens, efl_mm: float, *, measured: Lens | None = None) -> Lens:
    """Return the lens scaled to a focal length at its reference wavelength.

    Args:
        lens: The prescription, scaled in all its configurations.
        efl_mm: The focal length.
        measured: The lens in the configuration that is to have it; None for the lens itself.

    Raises:
        ContractError: If the focal length is not finite or has the other sign.
    """
    own_mm = paraxial_data(measured or lens).efl_mm
    factor = efl_mm / own_mm
    if not (math.isfinite(factor) and factor > 0):
        raise ContractError(
            f"a lens with a focal length of {own_mm:.6g} mm cannot be scaled to {efl_mm} mm"
        )
    return scale_lens(lens, factor)


def f_number_name(name: str, f_number: float) -> str:
    """Return the name of a lens; one that ends in an F-number ends in the new one."""
    return _F_NUMBER.sub(f"F/{f_number:.3g}", name)


def with_f_number(lens: Lens, f_number: float, *, working: bool = False) -> Lens:
    """Return the lens stopped to an F-number, stated as its entrance pupil diameter.

    A name that ends in an F-number gets the new one. The rim of the stop opens as far as the beam
    needs; the others stay as they are, so a lens that is opened may be vignetted by its own glass.

    Args:
        lens: The prescription.
        f_number: EFL / entrance pupil diameter at the reference wavelength; or, if
            `working`, that of the paraxial image of its object (`paraxial.Image`).
        working: Which. They are the same for an object at infinity.

    Raises:
        ContractError: If the lens has configurations: each has a pupil of its own.
    """
    require_plain(lens, "an F-number")
    if not (math.isfinite(f_number) and f_number > 0):
        raise ContractError(f"the F-number must be > 0; got {f_number}")
    data = paraxial_data(lens)
    now = paraxial_image(lens).working_f_number if working else abs(data.f_number)
    stopped = replace(
        lens,
        name=f_number_name(lens.name, f_number),
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=data.entrance_pupil_diameter_mm * now / f_number,
    )
    needed_mm = paraxial_data(stopped).stop_semi_diameter_mm
    surfaces = list(lens.surfaces)
    rim_mm = max(surfaces[lens.stop].semi_diameter_mm, needed_mm)
    surfaces[lens.stop] = replace(surfaces[lens.stop], semi_diameter_mm=rim_mm)
    return replace(stopped, surfaces=tuple(surfaces))
