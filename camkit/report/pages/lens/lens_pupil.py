"""The pupil and the sampling that a page of a lens uses, and why."""

import math
from dataclasses import dataclass
from typing import Final

import torch

from camkit.models_def.optics.analysis.sampling import Pupil
from camkit.models_def.optics.analysis.spots import (
    Convergence,
    field_slopes,
    paraxial_pupil_misses,
    rms_about_centroid,
    spot_convergence,
    spot_diagram,
)
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import PupilDefinition
from camkit.units import to_degrees

WRONG_PUPIL: Final = 0.2
"""Shares of the stop's radius by which the paraxial pupil may miss its middle."""
USUAL_SAMPLINGS: Final = ("gauss:8x16", "gauss:16x32", "fibonacci:2048", "fibonacci:8192")
"""From few rays to many; the last is what the others are measured against."""
CONVERGED: Final = 0.01
"""Share of the RMS radius by which the chosen sampling may be off at a field."""
NOTED: Final = 0.02
"""Share from which on the page says so of a sampling that was asked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PupilChoice:
    """The pupil of a page.

    Attributes:
        pupil: Definition and sampling.
        definition_reason: Why this definition.
        sampling_reason: Why this sampling.
        convergence: RMS radii by sampling.
    """

    pupil: Pupil
    definition_reason: str
    sampling_reason: str
    convergence: Convergence


def choose_pupil(
    lens: Lens, definition: PupilDefinition | None = None, sampling: str | None = None
) -> PupilChoice:
    """Return the pupil that was asked for, or else the one that is right and takes few rays.

    The paraxial pupil, as other programs have it, is wrong where the rays to its middle miss the
    middle of the stop by more than `WRONG_PUPIL` at a field: there the real one is taken.
    """
    why = "it was asked for"
    if definition is None:
        definition, why = _usual_definition(lens)
    convergence = spot_convergence(lens, field_slopes(lens), definition)
    if sampling is not None:
        sampling_why = "it was asked for"
    else:
        sampling = next(name for name in USUAL_SAMPLINGS if _error(convergence, name) <= CONVERGED)
        sampling_why = (
            f"the RMS radius of every field is within {CONVERGED:.0%} of that with "
            f"{convergence.samplings[-1]}"
        )
    return PupilChoice(
        pupil=Pupil(definition=definition, sampling=sampling),
        definition_reason=why,
        sampling_reason=sampling_why,
        convergence=convergence,
    )


def given_pupil(lens: Lens, pupil: Pupil) -> PupilChoice:
    """Return a pupil as one that was asked for."""
    return choose_pupil(lens, pupil.definition, pupil.sampling)


def _usual_definition(lens: Lens) -> tuple[PupilDefinition, str]:
    if not math.isfinite(paraxial_data(lens).entrance_pupil_mm):
        return "stop", "the paraxial entrance pupil lies at infinity"
    wrong = wrong_pupil(lens)
    if wrong:
        return "stop", f"the paraxial pupil is wrong here ({wrong[-1]})"
    worst = float(paraxial_pupil_misses(lens, field_slopes(lens)).max())
    return "paraxial", (
        f"the usual one, and right here: its middle is off that of the stop by {worst:.2g} of "
        "its radius at most"
    )


def wrong_pupil(lens: Lens) -> list[str]:
    """Return how far the paraxial pupil is off, a line for each field where it is wrong."""
    return [
        f"field {to_degrees(angle_rad):.4g} degrees: rays to the middle of the paraxial entrance "
        + (
            f"pupil miss that of the stop by {miss:.0%} of its radius"
            if miss < math.inf
            else "pupil are lost before the stop"
        )
        for angle_rad, miss in zip(
            lens.field_angles_rad,
            paraxial_pupil_misses(lens, field_slopes(lens)).tolist(),
            strict=True,
        )
        if miss > WRONG_PUPIL
    ]


def _error(convergence: Convergence, sampling: str) -> float:
    """Return the largest share by which a sampling is off; of fields without light 0."""
    mine = convergence.rms_mm[convergence.samplings.index(sampling)]
    finest = convergence.rms_mm[-1]
    lit = torch.isfinite(finest) & (finest > 0)
    share = torch.nan_to_num(mine[lit] / finest[lit], nan=0.0) - 1
    return float(share.abs().max()) if len(share) else 0.0


def sampling_note(lens: Lens, choice: PupilChoice) -> list[str]:
    """Return how far the chosen sampling is from the converged RMS, where that is far."""
    wave = torch.tensor([lens.reference_wavelength_um], dtype=torch.float64)
    convergence = choice.convergence
    if choice.pupil.sampling in convergence.samplings:
        mine = convergence.rms_mm[convergence.samplings.index(choice.pupil.sampling)]
    else:
        spots = spot_diagram(lens, field_slopes(lens), wave, choice.pupil)
        mine = rms_about_centroid(spots)[:, 0]
    share = torch.nan_to_num(mine / convergence.rms_mm[-1] - 1, nan=0.0, posinf=0.0)
    worst = float(share[share.abs().argmax()])
    if abs(worst) < NOTED:
        return []
    return [
        f"with {choice.pupil.sampling} the RMS radius of a field is off by {worst:+.0%} from the "
        f"converged value; {convergence.samplings[-1]} has converged"
    ]
