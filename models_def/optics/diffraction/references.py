"""The star filters that snapshot HDR is compared with, for the camera of Sun 2021, chapter 5.

Those that come with camkit (`models_def/plates/streak-*.toml`) are these with their defaults.

References: Rouf 2011, Glare encoding of high dynamic range images; Sun 2021, section 5.6.
"""

from typing import Final

from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import StarPattern
from camkit.models_def.optics.diffraction.plate import Plate, pattern_plate

CAMERA: Final = Bench(diameter_mm=9.162, focal_length_mm=50.0, focus_mm=5000.0)
CELLS: Final = 1527
"""Of 6 um."""
PITCH_UM: Final = 5.97
NEAR_UM: Final = 8 * PITCH_UM
FAR_UM: Final = 120 * PITCH_UM


def star_plate(lines: int, *, share: float = 0.06, cells: int = CELLS) -> Plate:
    """Return a star filter: lines evenly over the half-turn, each with two arms.

    Raises:
        ContractError: If the share is too large for gratings, or the cells too wide.
    """
    angles_deg = tuple(180.0 * line / lines for line in range(lines))
    return pattern_plate(
        f"streak-{lines}",
        StarPattern(angles_deg=angles_deg, near_um=NEAR_UM, far_um=FAR_UM, share=share),
        cells=cells,
        bench=CAMERA,
        etching=Etching(range_um=0.28, levels=16),
        note=f"{lines} lines of 8 to 120 pixels of {PITCH_UM} um: the star filter of Rouf 2011",
    )
