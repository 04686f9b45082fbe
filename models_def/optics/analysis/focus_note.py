"""A note on a lens whose sensor is far out of focus."""

from typing import Final

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.focus import spot_focus
from camkit.models_def.optics.prescription import Lens
from camkit.units import UM_PER_MM

_REMAINING_SHARE: Final = 1 / 3
"""Share of the spots that is left at the best focus, below which a sensor is far from it."""


def focus_note(lens: Lens) -> tuple[str, ...]:
    """Return a line if the sensor is far out of focus: refocusing leaves a third of the spots.

    A spot within the Airy disc, or a lens that cannot be focused by spots, has none.
    """
    try:
        focus = spot_focus(lens)
    except (ContractError, UnsupportedError):
        return ()
    airy_mm = max(airy_radius_mm(lens, wave) for wave in lens.wavelengths_um)
    if not focus.best_rms_mm < _REMAINING_SHARE * focus.rms_mm or not focus.rms_mm > airy_mm:
        return ()
    way = "farther from" if focus.shift_mm > 0 else "nearer to"
    return (
        f"the sensor is out of focus: {abs(focus.shift_mm):.3g} mm {way} the lens the RMS spot "
        f"over all fields is {focus.best_rms_mm * UM_PER_MM:.3g} um, not "
        f"{focus.rms_mm * UM_PER_MM:.3g} um",
    )
