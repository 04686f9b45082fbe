"""The plates that snapshot HDR is compared with, for the camera of Sun 2021, chapter 5.

Each is a maker; the plates that come with camkit (`models_def/plates`) are these with their
defaults, as TOML.

References: Rouf 2011, Glare encoding of high dynamic range images; Metzler 2020, Deep optics for
    single-shot high-dynamic-range imaging; Sun 2021, section 5.6.
"""

from typing import Final

from camkit.models_def.optics.diffraction.etching import Etching
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.patterns import (
    CrossPattern,
    FlatPattern,
    PeakPattern,
    StarPattern,
)
from camkit.models_def.optics.diffraction.plate import Plate, pattern_plate

CAMERA: Final = Bench(diameter_mm=9.162, focal_length_mm=50.0, focus_mm=5000.0)
CELLS: Final = 1527
"""Of 6 um."""
PITCH_UM: Final = 5.97
NEAR_UM: Final = 8 * PITCH_UM
FAR_UM: Final = 120 * PITCH_UM
DUAL_PEAK: Final = Etching(range_um=1.196, levels=16, wraps=True)
"""Over one cycle of the design wavelength, at which the prism is wrapped."""


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


def cross_plate(*, share: float = 0.06, cells: int = CELLS) -> Plate:
    """Return two lines as a map of rank 1."""
    return pattern_plate(
        "streak-cross",
        CrossPattern(near_um=NEAR_UM, far_um=FAR_UM, share=share),
        cells=cells,
        bench=CAMERA,
        etching=Etching(range_um=0.2, levels=16),
        note="two lines as a map of rank 1, in the form of Sun 2021, eq. (5.1)",
    )


def dual_peak_plate(*, share: float = 0.1, cells: int = CELLS) -> Plate:
    """Return a second peak, 30 pixels from the first: the kind of PSF that Metzler 2020 found."""
    return pattern_plate(
        "dual-peak",
        PeakPattern(right_um=26 * PITCH_UM, down_um=15 * PITCH_UM, share=share),
        cells=cells,
        bench=CAMERA,
        etching=DUAL_PEAK,
        note="a second peak 26 pixels to the right and 15 below, as Metzler 2020 found by design",
    )


def bare_plate(*, cells: int = CELLS) -> Plate:
    """Return the lens without a relief: the Dirac of comparisons."""
    return pattern_plate(
        "bare-lens", FlatPattern(), cells=cells, bench=CAMERA, note="no relief: the Dirac"
    )
