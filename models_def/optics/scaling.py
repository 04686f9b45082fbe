"""A lens made larger or smaller, faster or slower."""

import math
from dataclasses import replace

from camkit.errors import ContractError
from camkit.models_def.optics.paraxial import paraxial_data, paraxial_image
from camkit.models_def.optics.prescription import Lens, Surface


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
    )


def _scaled(surface: Surface, factor: float) -> Surface:
    # a_j multiplies r^(2 j) and gives mm
    terms = enumerate(surface.even_asphere, start=1)
    grooves = surface.grooves
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
        even_asphere=tuple(a * factor ** (1 - 2 * j) for j, a in terms),
    )


def scale_to_efl(lens: Lens, efl_mm: float) -> Lens:
    """Return the lens scaled to a focal length at its reference wavelength.

    Raises:
        ContractError: If the focal length is not finite or has the other sign.
    """
    own_mm = paraxial_data(lens).efl_mm
    factor = efl_mm / own_mm
    if not (math.isfinite(factor) and factor > 0):
        raise ContractError(
            f"a lens with a focal length of {own_mm:.6g} mm cannot be scaled to {efl_mm} mm"
        )
    return scale_lens(lens, factor)


def with_f_number(lens: Lens, f_number: float, *, working: bool = False) -> Lens:
    """Return the lens stopped to an F-number, stated as its entrance pupil diameter.

    The rim of the stop opens as far as the beam needs; the others stay as they are, so a lens that
    is opened may be vignetted by its own glass.

    Args:
        lens: The prescription.
        f_number: EFL / entrance pupil diameter at the reference wavelength; or, if
            `working`, that of the paraxial image of its object (`paraxial.Image`).
        working: Which. They are the same for an object at infinity.
    """
    if not (math.isfinite(f_number) and f_number > 0):
        raise ContractError(f"the F-number must be > 0; got {f_number}")
    data = paraxial_data(lens)
    now = paraxial_image(lens).working_f_number if working else abs(data.f_number)
    stopped = replace(
        lens,
        aperture_kind="entrance_pupil_diameter_mm",
        aperture_value=data.entrance_pupil_diameter_mm * now / f_number,
    )
    needed_mm = paraxial_data(stopped).stop_semi_diameter_mm
    surfaces = list(lens.surfaces)
    rim_mm = max(surfaces[lens.stop].semi_diameter_mm, needed_mm)
    surfaces[lens.stop] = replace(surfaces[lens.stop], semi_diameter_mm=rim_mm)
    return replace(stopped, surfaces=tuple(surfaces))
