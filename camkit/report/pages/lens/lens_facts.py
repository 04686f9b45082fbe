"""Everything that is computed about a lens."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.analysis.curves import distortion
from camkit.models_def.optics.analysis.fans import Fans, trace_fans
from camkit.models_def.optics.analysis.first_order import airy_radius_mm
from camkit.models_def.optics.analysis.focus_note import focus_note
from camkit.models_def.optics.analysis.psf_model import PsfModel, psf_model
from camkit.models_def.optics.analysis.sampling import Pupil, disc_quadrature
from camkit.models_def.optics.analysis.seidel import Seidel, seidel_sums
from camkit.models_def.optics.analysis.spots import (
    Convergence,
    chief_landings,
    field_slopes,
    max_from_chief,
    rms_about_centroid,
    rms_about_chief,
    rms_of_all_waves,
    spot_diagram,
)
from camkit.models_def.optics.analysis.state_facts import StateFacts
from camkit.models_def.optics.analysis.wavefront import trace_wavefront, wavefront_rms_um
from camkit.models_def.optics.paraxial import Paraxial, paraxial_data
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import real_stop_radius_mm
from camkit.models_def.optics.render.illumination import relative_illumination_of
from camkit.models_def.optics.spot import Spots
from camkit.models_def.optics.trace import Fate, count_fates
from camkit.report.pages.lens.lens_image import LensImage, image_of
from camkit.report.pages.lens.lens_pupil import (
    PupilChoice,
    given_pupil,
    sampling_note,
    wrong_pupil,
)
from camkit.units import to_degrees

Fact = TypeVar("Fact")


@dataclass(frozen=True, slots=True, kw_only=True)
class LensFacts:
    """Facts about a lens; (field, wavelength) unless said, NaN where no light arrives.

    Attributes:
        lens: The prescription.
        choice: The pupil by which everything is traced, and why; RMS radii by sampling.
        paraxial: First-order data of the reference wavelength.
        real_stop_mm: Height of the real marginal ray at the stop; None if it is lost.
        airy_mm: (wavelength,).
        spots: Rays on the sensor.
        rms_mm: About the centroid.
        rms_all_mm: (field,), of all wavelengths alike about their common centroid.
        rms_chief_mm: About the chief ray.
        max_mm: From the chief ray.
        chief_mm: Heights of chief rays.
        distortion: Share of the ideal height.
        illumination: 1 on the axis.
        wavefront_um: RMS, mean and tilt taken out.
        seidel: None if it has none.
        model: Which PSF the lens needs.
        image: The image of a point over the field; None if it was not asked for.
        fans: Two lines of rays through the pupil; None if they were not asked for.
        reasons: Why a fact is missing, by the name of the fact.
        notes: What was left out of the file, what could not be computed and why, for people.
        states: The configurations of the file beside each other.
    """

    lens: Lens
    choice: PupilChoice
    paraxial: Paraxial
    real_stop_mm: float | None
    airy_mm: Tensor
    spots: Spots
    rms_mm: Tensor
    rms_all_mm: Tensor
    rms_chief_mm: Tensor
    max_mm: Tensor
    chief_mm: Tensor
    distortion: Tensor
    illumination: Tensor
    wavefront_um: Tensor
    seidel: Seidel | None
    model: PsfModel
    image: LensImage | None
    fans: Fans | None
    reasons: Mapping[str, str]
    notes: tuple[str, ...]
    states: tuple[StateFacts, ...] = ()

    @property
    def pupil(self) -> Pupil:
        """Definition and sampling of the pupil."""
        return self.choice.pupil

    @property
    def convergence(self) -> Convergence:
        """RMS radii with coarse and fine sampling."""
        return self.choice.convergence

    @property
    def slopes(self) -> Tensor:
        """(field,), tan of the field angles."""
        return field_slopes(self.lens)

    @property
    def wavelengths_um(self) -> Tensor:
        """(wavelength,), of the file."""
        return torch.tensor(self.lens.wavelengths_um, dtype=torch.float64)

    @property
    def nearest_wavelength(self) -> int:
        """Number of the wavelength of the file next to the reference."""
        return int((self.wavelengths_um - self.lens.reference_wavelength_um).abs().argmin())

    @property
    def total_track_mm(self) -> float:
        """From the first vertex to the sensor."""
        return sum(surface.thickness_mm for surface in self.lens.surfaces)

    def dark_reason(self, field: int) -> str:
        """Return why charts leave a field out; empty if light of it arrives."""
        if not bool(torch.isfinite(self.spots.chief_y_mm[field])):
            return "the chief ray does not reach the sensor"
        return "" if bool((self.spots.weight[field] > 0).any()) else "no ray reaches the sensor"

    def lit_fields(self) -> list[int]:
        """Return the fields from which light arrives, and which were aimed."""
        return [i for i in range(len(self.lens.field_angles_rad)) if not self.dark_reason(i)]

    def drawn_fields(self, at_most: int = 5) -> list[int]:
        """Return the fields that a crowded chart shows: the first, the last, and some between.

        Fields without light are left out, see `dark_reason`.
        """
        lit = self.lit_fields()
        if len(lit) <= at_most:
            return lit
        return [lit[round(i * (len(lit) - 1) / (at_most - 1))] for i in range(at_most)]

    def fates(self, field: int, wavelength: int) -> dict[str, int]:
        """Count the rays of a field and wavelength by what became of them."""
        counts = count_fates(self.spots.fate[field, wavelength])
        return {fate.name.lower(): count for fate, count in counts.items()}


def analyse(
    lens: Lens,
    choice: PupilChoice | Pupil,
    notes_of_file: Sequence[str] = (),
    *,
    image: bool = True,
) -> LensFacts:
    """Compute everything but the curves.

    Args:
        lens: With a field and a wavelength.
        choice: How the pupil is filled; see `choose_pupil`.
        notes_of_file: What the lens does not carry of the file it was read from.
        image: Compute fans and images of points too, which takes the most time.

    Raises:
        ContractError: If the file has no field or wavelength, the stop no radius (definition
            `stop`), or the entrance pupil lies at infinity (definition `paraxial`).
    """
    if not lens.field_angles_rad or not lens.wavelengths_um:
        raise ContractError("a lens needs a field and a wavelength to be looked at; got none")
    definition = (choice if isinstance(choice, Pupil) else choice.pupil).definition
    data = paraxial_data(lens)
    if definition == "paraxial" and not math.isfinite(data.entrance_pupil_mm):
        raise ContractError("the entrance pupil lies at infinity; use --pupil stop")
    if isinstance(choice, Pupil):
        choice = given_pupil(lens, choice)
    slopes, waves = field_slopes(lens), torch.tensor(lens.wavelengths_um, dtype=torch.float64)
    notes, reasons = list(notes_of_file), Reasons()
    if definition == "paraxial":
        notes += [f"{line}; use {option_text('pupil')} stop" for line in wrong_pupil(lens)]
    spots = spot_diagram(lens, slopes, waves, choice.pupil)
    nothing = torch.full((len(slopes), len(waves)), math.nan, dtype=torch.float64)
    samples = disc_quadrature(12, 24)
    model = psf_model(lens, slopes, waves)
    real_stop = reasons.find("the real stop radius", lambda: real_stop_radius_mm(lens), None)
    illumination = reasons.find(
        "relative illumination", lambda: relative_illumination_of(lens, slopes, waves), nothing
    )
    sums = reasons.find("third-order sums", lambda: seidel_sums(lens), None)
    return LensFacts(
        lens=lens,
        choice=choice,
        paraxial=data,
        real_stop_mm=real_stop,
        airy_mm=torch.tensor([airy_radius_mm(lens, w) for w in lens.wavelengths_um]),
        spots=spots,
        rms_mm=rms_about_centroid(spots),
        rms_all_mm=rms_of_all_waves(spots),
        rms_chief_mm=rms_about_chief(spots),
        max_mm=max_from_chief(spots),
        chief_mm=chief_landings(lens, slopes, waves, definition),
        distortion=distortion(lens, slopes, waves, definition),
        illumination=illumination,
        wavefront_um=wavefront_rms_um(trace_wavefront(lens, slopes, waves, samples, definition)),
        seidel=sums,
        model=model,
        image=image_of(lens, choice.pupil, spots, model) if image else None,
        fans=trace_fans(lens, slopes, waves, definition) if image else None,
        reasons=reasons.by_name,
        notes=(
            *notes,
            *(f"{what}: {why}" for what, why in reasons.by_name.items()),
            *focus_note(lens),
            *_warnings(lens, spots),
            *sampling_note(lens, choice),
        ),
    )


class Reasons:
    """Reasons for missing facts, by their names: a page is made for every lens."""

    def __init__(self) -> None:
        """Start with none."""
        self.by_name: dict[str, str] = {}

    def find(self, what: str, compute: Callable[[], Fact], otherwise: Fact) -> Fact:
        """Compute a fact, or record why it cannot be and return another."""
        try:
            return compute()
        except ContractError as error:
            self.by_name[what] = str(error)
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
