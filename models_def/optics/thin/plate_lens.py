"""A solved plate as a lens file."""

from typing import Final

from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.prescription import Lens, Surface
from camkit.models_def.optics.thin.solver import SolvedPlate, back_radius_mm
from camkit.models_def.optics.thin.thin_recipe import ThinRecipe

# rims beyond the clear aperture: rays meet the relief a little outside, bent light further
_FRONT_MM: Final = 0.1
_BACK_MM: Final = 1.5


def plate_lens(recipe: ThinRecipe, solved: SolvedPlate) -> Lens:
    """Return the lens: a stop, the two faces of the plate, the sensor.

    Raises:
        UnsupportedError: If a groove is narrower than the tool.
    """
    plate, stop = recipe.plate, recipe.stop
    grooves = Grooves(depth_um=plate.groove_depth_um, tool_radius_um=plate.tool_radius_um)
    radius_mm = (stop.diameter_mm or plate.aperture_mm) / 2
    back_mm = back_radius_mm(plate, recipe.partition.field_angles_rad[-1]) + _BACK_MM
    return Lens(
        name=recipe.name,
        note=recipe.note,
        surfaces=(
            Surface(
                curvature_per_mm=0.0,
                thickness_mm=stop.distance_mm if stop.diameter_mm else 0.0,
                semi_diameter_mm=radius_mm,
            ),
            Surface(
                curvature_per_mm=0.0,
                thickness_mm=plate.thickness_mm,
                glass=plate.glass,
                semi_diameter_mm=plate.aperture_mm / 2 + _FRONT_MM,
                even_asphere=solved.front,
                grooves=grooves if solved.front else None,
            ),
            Surface(
                curvature_per_mm=0.0,
                thickness_mm=solved.bfl_mm,
                semi_diameter_mm=back_mm,
                even_asphere=solved.back,
                grooves=grooves if solved.back else None,
            ),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=radius_mm,
        field_angles_rad=recipe.partition.field_angles_rad,
        wavelengths_um=(plate.wavelength_um,),
        reference_wavelength_um=plate.wavelength_um,
    )
