"""What the light goes through, as a bundle states it: a tagged union.

Optics = FrozenPsfOptics    kernels, psf.safetensors        (psf_file.py)
       | StreakEntry        core, arms and haze, streaks.safetensors    (streak_file.py)
"""

from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Discriminator, Tag

from camkit.bundle.entry import Entry, Positive
from camkit.contracts import Symmetry

PSF: Final = "psf.safetensors"
STREAKS: Final = "streaks.safetensors"


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


class StreakEntry(Entry):
    """Optics that write streaks, the same everywhere (format 2.2).

    Attributes:
        member: The file of core, arms and haze; see camkit/bundle/streak_file.py.
        pixel_pitch_um: Pitch of its samples.
        symmetry: Streaks lie as they are, wherever in the picture.
        object_distance_mm: Distance of focus; None for infinity.
    """

    type: Literal["streaks"] = "streaks"
    member: Literal["streaks.safetensors"] = STREAKS
    pixel_pitch_um: Positive
    symmetry: Literal["uniform"] = "uniform"
    object_distance_mm: Positive | None = None


def _type_of(value: Any) -> Any:
    """Give the type of optics; those that state none are kernels, as before there were others."""
    if isinstance(value, Mapping):
        return value.get("type", "frozen_psf")
    return getattr(value, "type", None)


Optics = Annotated[
    Annotated[FrozenPsfOptics, Tag("frozen_psf")] | Annotated[StreakEntry, Tag("streaks")],
    Discriminator(_type_of),
]
