"""The parts of a bundle, and the usual names of their files."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

PSF_NAME: Final = "psf.safetensors"
HAZE_NAME: Final = "haze.safetensors"
STRESS_NAME: Final = "stress_psf.safetensors"
STRESS_HAZE_NAME: Final = "stress_haze.safetensors"
REPORT_NAME: Final = "freeze.json"
PLAN_NAME: Final = "plan.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Parts:
    """The parts of a bundle.

    Attributes:
        checkpoints: One per role and size, of one camera; none for a camera without networks.
        recipe: Of a camera without networks; None where the checkpoints have it.
        psf: Frozen PSF of `camkit freeze`; None for the measured PSF of checkpoints or recipe.
        haze: What `camkit freeze --haze` wrote beside it; None for optics without.
        stress_psf: Kernels off the design point.
        stress_haze: The haze beside them; None for optics without.
        prescription: The lens as designed; None for that of the checkpoints.
        plate: The plate as designed, a file or a name; None for that of the checkpoints.
        without_plate: Leave that of the checkpoints out: the PSF is of none.
        freeze: Report of `camkit freeze` (JSON), for the manifest.
        plan: Calibration of `tools/plan_report.py` (JSON), for the manifest; measured with an
            earlier export of the same networks.
        version: Semantic version of the bundle.
    """

    checkpoints: tuple[Path, ...]
    psf: Path | None = None
    recipe: Path | None = None
    haze: Path | None = None
    stress_psf: Path | None = None
    stress_haze: Path | None = None
    prescription: Path | None = None
    plate: Path | None = None
    without_plate: bool = False
    freeze: Path | None = None
    plan: Path | None = None
    version: str = "0.1.0"
