"""Everything that is computed about a lens, and its JSON."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, TypeVar

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.analysis.curves import distortion
from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.analysis.psf_model import PsfModel, psf_model
from camkit.models_def.optics.analysis.sampling import Pupil, disc_quadrature
from camkit.models_def.optics.analysis.seidel import Seidel, seidel_sums
from camkit.models_def.optics.analysis.spots import (
    Convergence,
    chief_landings,
    field_slopes,
    max_from_chief,
    paraxial_pupil_misses,
    rms_about_centroid,
    rms_about_chief,
    spot_convergence,
    spot_diagram,
)
from camkit.models_def.optics.analysis.wavefront import trace_wavefront, wavefront_rms_um
from camkit.models_def.optics.paraxial import Paraxial, paraxial_data
from camkit.models_def.optics.prescription import Lens, grooves_of
from camkit.models_def.optics.pupil import real_stop_radius_mm
from camkit.models_def.optics.render.illumination import relative_illumination_of
from camkit.models_def.optics.spot import Spots
from camkit.models_def.optics.trace import Fate, count_fates
from camkit.units import to_degrees

Fact = TypeVar("Fact")

WRONG_PUPIL: Final = 0.2
"""Shares of the stop's radius by which the paraxial pupil may miss its middle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LensFacts:
    """Facts about a lens; (field, wavelength) unless said, NaN where no light arrives.

    Attributes:
        lens: The prescription.
        pupil: By which everything is traced.
        paraxial: First-order data of the reference wavelength.
        real_stop_mm: Height of the real marginal ray at the stop; None if it is lost.
        airy_mm: (wavelength,).
        spots: Rays on the sensor.
        rms_mm: About the centroid.
        rms_chief_mm: About the chief ray.
        max_mm: From the chief ray.
        chief_mm: Heights of chief rays.
        distortion: Share of the ideal height.
        illumination: 1 on the axis.
        wavefront_um: RMS, mean and tilt taken out.
        seidel: None if it has none.
        convergence: RMS radii with coarse and fine sampling.
        model: Which PSF the lens needs.
        notes: What was left out of the file, what could not be computed and why, for people.
    """

    lens: Lens
    pupil: Pupil
    paraxial: Paraxial
    real_stop_mm: float | None
    airy_mm: Tensor
    spots: Spots
    rms_mm: Tensor
    rms_chief_mm: Tensor
    max_mm: Tensor
    chief_mm: Tensor
    distortion: Tensor
    illumination: Tensor
    wavefront_um: Tensor
    seidel: Seidel | None
    convergence: Convergence
    model: PsfModel
    notes: tuple[str, ...]

    @property
    def slopes(self) -> Tensor:
        """(field,), tan of the field angles."""
        return field_slopes(self.lens)

    @property
    def wavelengths_um(self) -> Tensor:
        """(wavelength,), of the file."""
        return torch.tensor(self.lens.wavelengths_um, dtype=torch.float64)

    @property
    def total_track_mm(self) -> float:
        """From the first vertex to the sensor."""
        return sum(surface.thickness_mm for surface in self.lens.surfaces)

    def drawn_fields(self, at_most: int = 5) -> list[int]:
        """Return the fields that a crowded chart shows: the first, the last, and some between."""
        count = len(self.lens.field_angles_rad)
        if count <= at_most:
            return list(range(count))
        return [round(i * (count - 1) / (at_most - 1)) for i in range(at_most)]

    def fates(self, field: int, wavelength: int) -> dict[str, int]:
        """Count the rays of a field and wavelength by what became of them."""
        counts = count_fates(self.spots.fate[field, wavelength])
        return {fate.name.lower(): count for fate, count in counts.items()}


def usual_pupil(lens: Lens, sampling: str) -> Pupil:
    """Return the paraxial pupil, as other programs have it, or the real one where that is wrong.

    Wrong is what misses the middle of the stop by more than `WRONG_PUPIL` at a field.
    """
    finite = math.isfinite(paraxial_data(lens).entrance_pupil_mm)
    right = finite and not _wrong_pupil(lens)
    return Pupil(definition="paraxial" if right else "stop", sampling=sampling)


def _wrong_pupil(lens: Lens) -> list[str]:
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


def analyse(lens: Lens, pupil: Pupil, notes_of_file: Sequence[str] = ()) -> LensFacts:
    """Compute everything but the curves.

    Args:
        lens: With a field and a wavelength.
        pupil: How it is filled; see `usual_pupil`.
        notes_of_file: What the lens does not carry of the file it was read from.

    Raises:
        ContractError: If the file has no field or wavelength, the stop no radius (definition
            `stop`), or the entrance pupil lies at infinity (definition `paraxial`).
    """
    if not lens.field_angles_rad or not lens.wavelengths_um:
        raise ContractError("a lens needs a field and a wavelength to be looked at; got none")
    slopes, waves = field_slopes(lens), torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    notes = list(notes_of_file)
    data = paraxial_data(lens)
    if pupil.definition == "paraxial" and not math.isfinite(data.entrance_pupil_mm):
        raise ContractError("the entrance pupil lies at infinity; use --pupil stop")
    if pupil.definition == "paraxial":
        notes += [f"{line}; use {option_text('pupil')} stop" for line in _wrong_pupil(lens)]
    spots = spot_diagram(lens, slopes, waves, pupil)
    nothing = torch.full((len(slopes), len(waves)), math.nan, dtype=torch.float64)
    convergence = spot_convergence(lens, slopes, pupil.definition)
    samples = disc_quadrature(12, 24)
    return LensFacts(
        lens=lens,
        pupil=pupil,
        paraxial=data,
        real_stop_mm=_try("the real stop radius", lambda: real_stop_radius_mm(lens), None, notes),
        airy_mm=torch.tensor([airy_radius_mm(lens, w) for w in lens.wavelengths_um]),
        spots=spots,
        rms_mm=rms_about_centroid(spots),
        rms_chief_mm=rms_about_chief(spots),
        max_mm=max_from_chief(spots),
        chief_mm=chief_landings(lens, slopes, waves, pupil.definition),
        distortion=distortion(lens, slopes, waves, pupil.definition),
        illumination=_try(
            "relative illumination",
            lambda: relative_illumination_of(lens, slopes, waves),
            nothing,
            notes,
        ),
        wavefront_um=wavefront_rms_um(
            trace_wavefront(lens, slopes, waves, samples, pupil.definition)
        ),
        seidel=_try("third-order sums", lambda: seidel_sums(lens), None, notes),
        convergence=convergence,
        model=psf_model(lens, slopes, waves),
        notes=(*notes, *_warnings(lens, spots), *_sampling_note(pupil, convergence)),
    )


def _try(what: str, compute: Callable[[], Fact], otherwise: Fact, notes: list[str]) -> Fact:
    """Compute something, or say why not: a page is made for every lens."""
    try:
        return compute()
    except ContractError as error:
        notes.append(f"{what}: {error}")
        return otherwise


def _warnings(lens: Lens, spots: Spots) -> list[str]:
    """Return which glasses cannot be and which fields lose rays."""
    warnings = [
        f"surface {i}: {surface.glass} is {surface.thickness_mm:g} mm thick, which cannot be made"
        for i, surface in enumerate(lens.surfaces)
        if surface.glass != "air" and surface.thickness_mm <= 0
    ]
    warnings += [
        f"surface {i}: its term in r is a cone, which has no focal length; paraxial data are "
        "those of the other terms"
        for i, surface in enumerate(lens.surfaces)
        if any(surface.odd_asphere[:1])
    ]
    if not lens.is_round:
        warnings.append(
            "the lens is not round: fields are those along +y, and relative illumination is that "
            "of half the stop"
        )
    for i, angle_rad in enumerate(lens.field_angles_rad):
        name = f"field {to_degrees(angle_rad):.4g} degrees"
        losses = [
            f"{count} {fate.name.lower().replace('_', ' ')}"
            for fate, count in count_fates(spots.fate[i]).items()
            if fate is not Fate.VALID and count
        ]
        total = spots.fate[i].numel()
        if not bool((spots.weight[i] > 0).any()):
            warnings.append(
                f"{name}: no ray reaches the sensor ({', '.join(losses)}); nothing is drawn"
            )
        elif losses:
            warnings.append(f"{name}: of {total} rays {', '.join(losses)}")
        if not bool(torch.isfinite(spots.chief_y_mm[i])):
            reach = chief_path(lens).reach
            warnings.append(
                f"{name}: the chief ray does not reach the sensor; the lens is aimed to {reach}"
            )
    return warnings


def _sampling_note(pupil: Pupil, convergence: Convergence) -> list[str]:
    """Return how far the chosen sampling is from the converged RMS."""
    if pupil.sampling not in convergence.samplings:
        return []
    mine = convergence.rms_mm[convergence.samplings.index(pupil.sampling)]
    deviation = torch.nan_to_num(mine / convergence.rms_mm[-1] - 1, posinf=0.0)
    worst = float(deviation[deviation.abs().argmax()])
    if abs(worst) < 0.02:
        return []
    return [
        f"with {pupil.sampling} the RMS radius of a field is off by {worst:+.0%} from the "
        f"converged value; {convergence.samplings[-1]} has converged"
    ]


def to_json(facts: LensFacts) -> dict[str, Any]:
    """Return the object that `camkit lens show --json` prints; None where there is no number."""
    data, sums = facts.paraxial, facts.seidel
    report = {
        "name": facts.lens.name,
        "efl_mm": data.efl_mm,
        "bfl_mm": data.bfl_mm,
        "ffl_mm": data.ffl_mm,
        "f_number": data.f_number,
        "total_track_mm": facts.total_track_mm,
        "entrance_pupil_mm": data.entrance_pupil_mm,
        "entrance_pupil_diameter_mm": data.entrance_pupil_diameter_mm,
        "exit_pupil_mm": data.exit_pupil_mm,
        "exit_pupil_diameter_mm": data.exit_pupil_diameter_mm,
        "stop_radius_paraxial_mm": data.stop_semi_diameter_mm,
        "stop_radius_real_mm": facts.real_stop_mm,
        "reference_wavelength_um": facts.lens.reference_wavelength_um,
        "seidel_mm": None if sums is None else sums.sums_mm.tolist(),
        "third_order_transverse_mm": None if sums is None else sums.transverse_mm(),
        "aimed_to_deg": to_degrees(float(chief_path(facts.lens).angles_rad[-1])),
        "aimed_to_mm": float(chief_path(facts.lens).heights_mm[-1]),
        "pupil": facts.pupil.definition,
        "pupil_sampling": facts.pupil.sampling,
        "psf_model": facts.model.regime,
        "psf_model_reason": facts.model.reason,
        "grooves": grooves_of(facts.lens),
        "fields": [
            _field(facts, i, j)
            for i in range(len(facts.lens.field_angles_rad))
            for j in range(len(facts.lens.wavelengths_um))
        ],
        "convergence": _convergence(facts),
        "notes": list(facts.notes),
    }
    finite: dict[str, Any] = _finite(report)
    return finite


def _field(facts: LensFacts, i: int, j: int) -> dict[str, Any]:
    def at(values: Tensor) -> float:
        return float(values[i, j])

    return {
        "field_angle_deg": round(to_degrees(facts.lens.field_angles_rad[i]), 12),
        "wavelength_um": facts.lens.wavelengths_um[j],
        "spot_rms_mm": at(facts.rms_mm),
        "spot_rms_chief_mm": at(facts.rms_chief_mm),
        "spot_max_mm": at(facts.max_mm),
        "airy_radius_mm": float(facts.airy_mm[j]),
        "chief_height_mm": at(facts.chief_mm),
        "distortion_percent": 100 * at(facts.distortion),
        "relative_illumination": at(facts.illumination),
        "wavefront_rms_um": at(facts.wavefront_um),
        "rays": facts.fates(i, j),
    }


def _convergence(facts: LensFacts) -> list[dict[str, Any]]:
    convergence = facts.convergence
    return [
        {"pupil_sampling": name, "rays": rays, "spot_rms_mm": rms}
        for name, rays, rms in zip(
            convergence.samplings, convergence.rays, convergence.rms_mm.tolist(), strict=True
        )
    ]


def _finite(value: Any) -> Any:
    """Return JSON values with None for what is no number: NaN and infinity are not JSON."""
    if isinstance(value, dict):
        return {name: _finite(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
