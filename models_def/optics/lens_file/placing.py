"""A lens stopped, focused and told where its objects lie, as people state it.

    stop -> focus on a distance (the whole lens moves), defocus -> distances from the first vertex

Lens scales count from the sensor, programs from the first vertex, theory from the entrance pupil;
camkit counts from the first vertex. From the sensor, a distance and where the sensor stands depend
on each other, and are found together.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, get_args

import torch

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.focus import FocusMerit, with_focus
from camkit.models_def.optics.glass.dispersion import refractive_index
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens, with_focus_shift
from camkit.models_def.optics.scaling import f_number_name, with_f_number

DistanceOrigin = Literal["vertex", "sensor", "pupil"]
DISTANCE_ORIGINS: Final[tuple[DistanceOrigin, ...]] = get_args(DistanceOrigin)
_ROUNDS: Final = 60
_SETTLED_MM: Final = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Placement:
    """The use of a lens: stop, focus, scene.

    Attributes:
        f_number: EFL / entrance pupil diameter to stop to; None for that of the file.
        stop_radius_mm: Of the stop, in place of an F-number.
        focus_mm: Distance that the lens is focused on; None leaves the sensor where the file has
            it.
        objects_mm: Distances of the scene, in any order; none for where the lens is focused.
        origin: What `focus_mm` and `objects_mm` count from.
        merit: What is best in focus.
        defocus_mm: By which the sensor lies behind its place in focus.
    """

    f_number: float | None = None
    stop_radius_mm: float | None = None
    focus_mm: float | None = None
    objects_mm: Sequence[float] = ()
    origin: DistanceOrigin = "vertex"
    merit: FocusMerit = "spot"
    defocus_mm: float = 0.0

    def __post_init__(self) -> None:
        if self.f_number is not None and self.stop_radius_mm is not None:
            raise ContractError(
                f"give {option_text('f_number')} or {option_text('stop_radius_mm')}, not both"
            )
        if self.origin not in DISTANCE_ORIGINS:
            raise ContractError(
                f"{option_text('distance_from')} takes one of {', '.join(DISTANCE_ORIGINS)}; "
                f"got {self.origin!r}"
            )
        lengths = {"focus_mm": self.focus_mm, "stop_radius_mm": self.stop_radius_mm}
        lengths |= {f"object_mm {i + 1}": value for i, value in enumerate(self.objects_mm)}
        if not math.isfinite(self.defocus_mm):
            raise ContractError(
                f"{option_text('defocus_mm')} must be finite; got {self.defocus_mm}"
            )
        wrong = [f"{k} {v}" for k, v in lengths.items() if v is not None and not v > 0]
        if wrong:
            raise ContractError(f"lengths must be > 0; got {', '.join(wrong)}")


@dataclass(frozen=True, slots=True, kw_only=True)
class PlacedLens:
    """A lens as it is used.

    Attributes:
        lens: Stopped and focused; its object distance is the one it is focused on.
        objects_mm: Distances of the scene from the first vertex, increasing.
    """

    lens: Lens
    objects_mm: tuple[float, ...]


def placed_lens(lens: Lens, placement: Placement) -> PlacedLens:
    """Return a lens as it is used.

    Raises:
        ContractError: If an object would lie within the lens, or the lens cannot be focused.
    """
    stopped = stopped_lens(
        lens, f_number=placement.f_number, stop_radius_mm=placement.stop_radius_mm
    )
    focused = with_focus_shift(_focused(stopped, placement), placement.defocus_mm)
    objects = [_from_vertex(focused, value, placement.origin) for value in placement.objects_mm]
    return PlacedLens(
        lens=focused, objects_mm=tuple(sorted(set(objects))) or (focused.object_distance_mm,)
    )


def stopped_lens(lens: Lens, *, f_number: float | None, stop_radius_mm: float | None) -> Lens:
    """Return a lens stopped to an F-number or a radius of its stop; as it is with neither."""
    if f_number is not None:
        return with_f_number(lens, f_number)
    if stop_radius_mm is None:
        return lens
    surfaces = list(lens.surfaces)
    stop = surfaces[lens.stop]
    rim_mm = max(stop.semi_diameter_mm, stop_radius_mm)
    surfaces[lens.stop] = replace(stop, semi_diameter_mm=rim_mm)
    stopped = replace(
        lens,
        surfaces=tuple(surfaces),
        aperture_kind="stop_semi_diameter_mm",
        aperture_value=stop_radius_mm,
    )
    return replace(stopped, name=f_number_name(lens.name, abs(paraxial_data(stopped).f_number)))


def with_object_na(lens: Lens, numerical_aperture: float) -> Lens:
    """Return a lens opened to a numerical aperture on the side of its object, n sin u.

    Raises:
        ContractError: If the object is distant, or the sine is none below 1.
    """
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    sine = numerical_aperture / float(refractive_index(lens.object_medium, wave))
    if not (0 < sine < 1 and math.isfinite(lens.object_distance_mm)):
        raise ContractError(
            "an aperture of the object side needs a near object and NA < 1 (in glass: its index); "
            f"got NA {numerical_aperture:g} and an object at {lens.object_distance_mm:g} mm"
        )
    distance_mm = lens.object_distance_mm + paraxial_data(lens).entrance_pupil_mm
    diameter_mm = 2 * distance_mm * math.tan(math.asin(sine))
    return replace(
        lens, aperture_kind="entrance_pupil_diameter_mm", aperture_value=abs(diameter_mm)
    )


def track_mm(lens: Lens) -> float:
    """Return the way from the first vertex to the sensor."""
    return sum(surface.thickness_mm for surface in lens.surfaces)


def _focused(lens: Lens, placement: Placement) -> Lens:
    """Return the lens focused on its distance; from the sensor, by repeated placing."""
    if placement.focus_mm is None:
        return lens
    focused = lens
    for _ in range(_ROUNDS):
        distance_mm = _from_vertex(focused, placement.focus_mm, placement.origin)
        refocused = with_focus(replace(focused, object_distance_mm=distance_mm), placement.merit)
        moved_mm = abs(track_mm(refocused) - track_mm(focused))
        focused = refocused
        if placement.origin != "sensor" or math.isinf(distance_mm) or moved_mm < _SETTLED_MM:
            return focused
    raise ContractError(
        f"{lens.name} cannot be focused on {placement.focus_mm:g} mm from the sensor: nearer than "
        "its image reaches"
    )


def _from_vertex(lens: Lens, distance_mm: float, origin: DistanceOrigin) -> float:
    """Return a distance from the first vertex.

    Raises:
        ContractError: If it lies behind the vertex.
    """
    behind_mm = {"vertex": 0.0, "sensor": track_mm(lens)}.get(origin)
    if behind_mm is None:
        behind_mm = paraxial_data(lens).entrance_pupil_mm
    vertex_mm = distance_mm - behind_mm
    if not vertex_mm > 0:
        raise ContractError(
            f"an object {distance_mm:g} mm from the {origin} of {lens.name} lies within the lens, "
            f"whose first vertex is {behind_mm:.4g} mm away from that"
        )
    return vertex_mm
