"""Checks of a lens before a sensor, in a second: what it reaches, and what its rims take."""

from typing import Final

from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.analysis.image_circle import image_radius_mm, open_share
from camkit.models_def.optics.configuration.field_limits import TANGENT_DEG
from camkit.models_def.optics.lens_file.placing import PlacedLens
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.sensors.sensor_choice import SensorChoice
from camkit.units import to_radians

SAME_APERTURE: Final = 0.99
"""F-number over F-number, or share of light, from which on they count as the same."""


def check_image_circle(use: PlacedLens, sensor: SensorChoice, name: str) -> None:
    """Refuse a sensor whose corner the lens does not reach from one of its distances.

    Args:
        use: Focused and placed.
        sensor: Before which it stands.
        name: Of the lens, for the message.

    Raises:
        ContractError: With the reach of the lens and the place of the corner.
    """
    corner_mm = sensor.corner_mm
    for distance_mm in sorted({use.lens.object_distance_mm, *use.objects_mm}):
        lens = with_object_distance(use.lens, distance_mm)
        radius_mm = image_radius_mm(lens)
        if radius_mm < corner_mm:
            share = radius_mm / corner_mm
            sides = (int(share * sensor.table[key]) for key in ("width_px", "height_px"))
            end = f" at {TANGENT_DEG} degrees, where cameras end" if _is_wider(lens) else ""
            raise ContractError(
                f"{name} images up to {radius_mm:.4g} mm from its axis{end}, but the corner of the "
                f"sensor lies at {corner_mm:.4g} mm: take a smaller sensor (the lens covers about "
                f"{'x'.join(map(str, sides))} px of this one), or another lens"
            )


def _is_wider(lens: Lens) -> bool:
    """Return whether the lens sees farther round than a camera can carry."""
    return bool(chief_path(lens).angles_rad[-1] > to_radians(TANGENT_DEG))


def aperture_notes(design: Lens, stopped: Lens) -> tuple[str, ...]:
    """Return a note if a lens is opened wider than its file has it, or its rims are narrower.

    Args:
        design: As of the file.
        stopped: As it is used.
    """
    of_file, of_use = (abs(paraxial_data(lens).f_number) for lens in (design, stopped))
    share = open_share(stopped)
    is_wider = of_use < SAME_APERTURE * of_file
    if not is_wider and share > SAME_APERTURE:
        return ()
    begin = f"F/{of_use:.3g} is wider than the F/{of_file:.3g} of the file: " if is_wider else ""
    light = "all" if share > SAME_APERTURE else f"{share:.0%}"
    return (f"{begin}its rims let {light} of the light of F/{of_use:.3g} through on the axis",)
