"""Lenses with one perfect focus, for tests of peaks and waves."""

import torch

from camkit.models_def.optics.glass.catalogue import find_glass
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.grooves import Grooves
from camkit.models_def.optics.prescription import Lens, Surface

GLASS = "PMMA-Sultanova2009"


def index_at(wavelength_um: float) -> float:
    """Give the index of the glass."""
    wave = torch.tensor([wavelength_um], dtype=torch.float64)
    return float(refractive_index(find_glass(GLASS), wave))


def perfect_lens(
    focus_mm: float,
    stop_mm: float,
    *,
    wavelength_um: float = 0.55,
    defocus_mm: float = 0.0,
    grooves: Grooves | None = None,
) -> Lens:
    """Give a plane and a hyperboloid of eccentricity n: a distant point has a point image.

    Args:
        focus_mm: Focal length.
        stop_mm: Radius of the stop.
        wavelength_um: At which it is perfect.
        defocus_mm: Of the sensor.
        grooves: Of the hyperboloid.
    """
    index = index_at(wavelength_um)
    return Lens(
        name="perfect",
        surfaces=(
            Surface(curvature_per_mm=0.0, thickness_mm=1.0),
            Surface(curvature_per_mm=0.0, thickness_mm=3.0, glass=GLASS),
            Surface(
                curvature_per_mm=-1 / (focus_mm * (index - 1)),
                thickness_mm=focus_mm + defocus_mm,
                conic=-(index**2),
                semi_diameter_mm=1.5 * stop_mm,
                grooves=grooves,
            ),
        ),
        stop=0,
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=stop_mm,
        wavelengths_um=(wavelength_um,),
        reference_wavelength_um=wavelength_um,
    )
