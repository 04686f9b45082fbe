"""The streak optics of a plate behind a camera's colours."""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.sensor import ColorSensor
from camkit.models_def.optics.diffraction.plate import Plate
from camkit.models_def.optics.diffraction.plate_optics import plate_kernels
from camkit.models_def.optics.diffraction.streak_fit import fit_streaks
from camkit.streaks import StreakOptics
from camkit.units import MM_PER_M

SIDE_PX: Final = 401
WAVELENGTHS: Final = 7


def plate_streaks(
    plate: Plate,
    sensor: ColorSensor,
    *,
    depths_mm: tuple[float, ...] = (),
    wavelengths_um: NDArray[np.float64] | None = None,
    side_px: int = SIDE_PX,
) -> StreakOptics:
    """Compute the streaks of a plate, by their parts.

    Args:
        plate: Before its lens.
        sensor: Pitch and response.
        depths_mm: Of the light; empty for the distance that is sharp.
        wavelengths_um: Of the light; None for a few, evenly over the response.
        side_px: Of the dense kernels, odd.

    Raises:
        ContractError: If its cells are too wide for that.
        NoStreaksError: If it writes no streaks.
    """
    response_um, _ = sensor.response_arrays()
    even_um = np.linspace(response_um[0], response_um[-1], WAVELENGTHS)
    waves = even_um if wavelengths_um is None else wavelengths_um
    depths = depths_mm or (plate.bench.focus_mm,)
    pitch_um = sensor.pixel_pitch_um
    psf, bare = (
        plate_kernels(
            plate,
            depths_m=[depth / MM_PER_M for depth in depths],
            wavelengths_um=[float(wave) for wave in waves],
            side_px=side_px,
            pitch_um=pitch_um,
            bare=flat,
        )
        for flat in (False, True)
    )
    return fit_streaks(psf, bare, depths_mm=depths, wavelengths_um=list(waves), pitch_um=pitch_um)
