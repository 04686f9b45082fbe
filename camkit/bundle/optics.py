"""What the light goes through, as a bundle states it: a tagged union, today of one member."""

from typing import Final, Literal

from camkit.bundle.entry import Entry, Positive
from camkit.contracts import Symmetry

PSF: Final = "psf.safetensors"


class FrozenPsfOptics(Entry):
    """Optics known by their frozen PSF.

    Attributes:
        member: The file of the kernels; see camkit/bundle/psf_file.py.
        pixel_pitch_um: Pitch of the kernel samples.
        symmetry: How the kernels of other image points follow from those stored; see
            `camkit.contracts.FrozenPsf`.
        object_distance_mm: Distance of focus from the first surface; None for infinity.
    """

    type: Literal["frozen_psf"] = "frozen_psf"
    member: Literal["psf.safetensors"] = PSF
    pixel_pitch_um: Positive
    symmetry: Symmetry = "radial"
    object_distance_mm: Positive | None = None


Optics = FrozenPsfOptics
