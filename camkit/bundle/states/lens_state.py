"""One frozen state of a zoom or focusing lens, and the choice of one of several."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.psf import FrozenPsf

MOST_STATES: Final = 100


@dataclass(frozen=True, slots=True, kw_only=True)
class LensState:
    """A lens with moving parts, frozen in one state.

    Attributes:
        name: By which people choose it.
        psf: Its kernels, distortion and illumination, at fields, wavelengths and depths of its own.
        efl_mm: Focal length, not 0.
        f_number: EFL over the diameter of the entrance pupil, > 0.
        object_distance_mm: Distance of focus, > 0; inf is allowed.
    """

    name: str
    psf: FrozenPsf
    efl_mm: float
    f_number: float
    object_distance_mm: float

    def __post_init__(self) -> None:
        if not self.name.strip() or "\n" in self.name:
            raise ContractError(f"a configuration needs a name of one line; got {self.name!r}")
        if not (math.isfinite(self.efl_mm) and self.efl_mm):
            raise ContractError(f"{self.name}: efl_mm must be finite, not 0; got {self.efl_mm}")
        if not 0 < self.f_number < math.inf:
            raise ContractError(f"{self.name}: f_number must be > 0; got {self.f_number}")
        if not self.object_distance_mm > 0:
            raise ContractError(
                f"{self.name}: object_distance_mm must be > 0; got {self.object_distance_mm}"
            )


def check_states(states: Sequence[LensState]) -> None:
    """Refuse states that are not of one lens before one sensor.

    Raises:
        ContractError: If there are none or too many, two have one name, or they differ in pixel
            pitch, symmetry or the channels of their distortion.
    """
    names = [state.name for state in states]
    if not 1 <= len(states) <= MOST_STATES or len(set(names)) < len(names):
        raise ContractError(
            f"a lens has 1..{MOST_STATES} configurations with names of their own; got "
            f"{len(names)}: {', '.join(names[:10])}"
        )
    first = states[0].psf
    for state in states[1:]:
        psf = state.psf
        if (
            psf.pixel_pitch_um != first.pixel_pitch_um
            or psf.symmetry != first.symmetry
            or len(psf.distortion.coefficients) != len(first.distortion.coefficients)
        ):
            raise ContractError(
                f"configurations {names[0]} and {state.name} differ in pixel pitch, symmetry or "
                "channels; freeze all for one sensor"
            )


def find_name(names: Sequence[str], usual: str, choice: str | int | None) -> str:
    """Return the name of one of several states.

    Args:
        names: At least one.
        usual: The one that is taken where none is named; empty for the first.
        choice: Name, or number from 1; a name that is a number comes first. None for the usual.

    Raises:
        ContractError: If there is no such state; the message names all.
    """
    key = str(choice) if choice is not None else usual or names[0]
    by_number = {str(number): name for number, name in enumerate(names, start=1)}
    name = key if key in names else by_number.get(key)
    if name is None:
        raise ContractError(
            f"{option_text('configuration')} is one of {', '.join(names)}, or a number "
            f"1..{len(names)}; got {key!r}"
        )
    return name


def usual_note(names: Sequence[str], usual: str) -> str:
    """Return a note on the state that was taken without being named."""
    return (
        f"{len(names)} configurations ({', '.join(names)}): {usual} is taken; choose by "
        f"{option_text('configuration')}"
    )
