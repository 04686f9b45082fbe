"""Drawn errors of fabricated copies."""

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Final

import numpy as np

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.errors import Array, ErrorClass, ErrorWidth, Tolerances

FIELDS: Final[dict[ErrorClass, str]] = {
    "radius": "radius",
    "thickness": "thickness_mm",
    "index": "index",
    "abbe": "abbe",
    "conic": "conic",
    "power": "power_fringes",
    "irregularity": "irregularity_fringes",
    "groove_depth": "groove_depth",
    "surface_decentre": "surface_decentre_mm",
    "surface_tilt": "surface_tilt_rad",
    "element_decentre": "element_decentre_mm",
    "element_tilt": "element_tilt_rad",
    "wedge": "wedge_rad",
    "focus": "focus_mm",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviations:
    """Errors of copies, 0 where a class does not apply.

    Attributes:
        radius: (copy, surface), relative.
        thickness_mm: (copy, surface).
        index: (copy, surface), of the medium after it.
        abbe: (copy, surface), relative.
        conic: (copy, surface).
        power_fringes: (copy, surface), positive where the curvature grows.
        irregularity_fringes: (copy, surface, 2), cosine and sine of twice the angle from +x to the
            direction in which the surface rises towards +z.
        groove_depth: (copy, surface), relative.
        surface_decentre_mm: (copy, surface, 2), x and y.
        surface_tilt_rad: (copy, surface, 2), a rotation vector: its x turns y towards z.
        element_decentre_mm: (copy, element, 2).
        element_tilt_rad: (copy, element, 2).
        wedge_rad: (copy, surface, 2), of the glass after it: the next surface is so far turned.
        focus_mm: (copy,).
    """

    radius: Array
    thickness_mm: Array
    index: Array
    abbe: Array
    conic: Array
    power_fringes: Array
    irregularity_fringes: Array
    groove_depth: Array
    surface_decentre_mm: Array
    surface_tilt_rad: Array
    element_decentre_mm: Array
    element_tilt_rad: Array
    wedge_rad: Array
    focus_mm: Array

    @property
    def copies(self) -> int:
        """Number of copies."""
        return len(self.focus_mm)

    @property
    def surface_turn_rad(self) -> Array:
        """Rotation of every surface about its vertex, (copy, surface, 2): by tilt and wedge."""
        # no glass after the last surface has a wedge: nothing is carried round to the first
        return np.asarray(self.surface_tilt_rad + np.roll(self.wedge_rad, 1, axis=1))

    def of_copy(self, number: int) -> "Deviations":
        """Return the deviations of one copy."""
        return self.of_copies(range(number, number + 1))

    def of_copies(self, numbers: range) -> "Deviations":
        """Return the deviations of some copies that follow one another."""
        some = slice(numbers.start, numbers.stop)
        return Deviations(**{f.name: getattr(self, f.name)[some] for f in fields(self)})


def draw_deviations(
    lens: Lens,
    tolerances: Tolerances,
    copies: range,
    seed: int,
    *,
    at_limits: bool = False,
) -> Deviations:
    """Draw the errors of copies.

    Copy i follows from (seed, i) alone, and each class has draws of its own: another width, or
    another number of copies, leaves all other errors as they are.

    Args:
        lens: Nominal.
        tolerances: How wide.
        copies: Their numbers.
        seed: Of all draws.
        at_limits: Every error at its full half-width, with the drawn sign or direction.

    Raises:
        ContractError: If the seed is negative.
    """
    if seed < 0:
        raise ContractError(f"a seed must be >= 0; got {seed}")
    elements, surfaces = glass_elements(lens), len(lens.surfaces)
    rows = [_uniform(seed, i, surfaces, len(elements)) for i in copies]
    flat, on_surface, on_element, focus, relief, power, figure = (
        np.stack(part) for part in zip(*rows, strict=True)
    )
    glass = np.array([surface.glass != "air" for surface in lens.surfaces], dtype=np.float64)
    curved = np.array([surface.curvature_per_mm != 0 for surface in lens.surfaces])
    grooved = np.array([surface.grooves is not None for surface in lens.surfaces])
    refracting = np.zeros(surfaces)
    for element in elements:
        refracting[element.start : element.stop] = 1
    smooth = refracting * ~grooved
    gaps = np.ones(surfaces)
    gaps[-1] = 0

    def signed(width: ErrorWidth, draws: Array) -> Array:
        if at_limits:
            return width.half_width * np.where(draws < 0.5, -1.0, 1.0)
        return width.signed(draws)

    def vector(width: ErrorWidth, draws: Array) -> Array:
        length = np.full(draws.shape[:-1], width.half_width)
        length = length if at_limits else width.length(draws[..., 0])
        angle = 2 * np.pi * draws[..., 1]
        return np.stack([length * np.cos(angle), length * np.sin(angle)], axis=-1)

    return Deviations(
        radius=signed(tolerances.radius, flat[:, 0]) * curved,
        thickness_mm=signed(tolerances.thickness, flat[:, 1]) * gaps,
        index=signed(tolerances.index, flat[:, 2]) * glass,
        abbe=signed(tolerances.abbe, flat[:, 3]) * glass,
        conic=signed(tolerances.conic, flat[:, 4]) * refracting,
        power_fringes=signed(tolerances.power, power) * smooth,
        irregularity_fringes=vector(tolerances.irregularity, figure[:, 0]) * smooth[:, None],
        groove_depth=signed(tolerances.groove_depth, relief) * grooved,
        surface_decentre_mm=vector(tolerances.surface_decentre, on_surface[:, 0])
        * refracting[:, None],
        surface_tilt_rad=vector(tolerances.surface_tilt, on_surface[:, 1]) * refracting[:, None],
        element_decentre_mm=vector(tolerances.element_decentre, on_element[:, 0]),
        element_tilt_rad=vector(tolerances.element_tilt, on_element[:, 1]),
        wedge_rad=vector(tolerances.wedge, figure[:, 1]) * (glass * gaps)[:, None],
        focus_mm=signed(tolerances.focus, focus),
    )


def no_deviations(lens: Lens) -> Deviations:
    """Return one copy without errors."""
    deviations = draw_deviations(lens, Tolerances(), range(1), 0)
    return Deviations(**{name: np.zeros_like(value) for name, value in _arrays(deviations)})


def _arrays(deviations: Deviations) -> Iterator[tuple[str, Array]]:
    return ((f.name, getattr(deviations, f.name)) for f in fields(deviations))


def _uniform(
    seed: int, number: int, surfaces: int, elements: int
) -> tuple[Array, Array, Array, np.float64, Array, Array, Array]:
    """Return draws of 0..1.

    In this order: (5, surface), (2, surface, 2), (2, element, 2), 1 number, (surface,), (surface,),
    (2, surface, 2).
    A class that is new draws last: the errors of a seed stay what they were.
    """
    rng = np.random.default_rng((seed, number))
    return (
        rng.random((5, surfaces)),
        rng.random((2, surfaces, 2)),
        rng.random((2, elements, 2)),
        np.float64(rng.random()),
        rng.random(surfaces),
        rng.random(surfaces),
        rng.random((2, surfaces, 2)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Single:
    """One error of one part.

    Attributes:
        error_class: Its class.
        part: Number of the surface or of the piece of glass, from 0; None for the focus.
        value: The error.
    """

    error_class: ErrorClass
    part: int | None
    value: float


def single_deviations(lens: Lens, tolerances: Tolerances) -> tuple[tuple[Single, ...], Deviations]:
    """Return copies with one error each: every number at plus and minus its half-width.

    Decentres are along y, tilts and wedges turn y towards z, irregular surfaces rise along x, or
    along y where the error is negative.
    """
    # at its limits every number that an error can reach is not 0
    reach = draw_deviations(lens, tolerances, range(1), 0, at_limits=True)
    singles: list[Single] = []
    for error_class in tolerances.active():
        touched = getattr(reach, FIELDS[error_class])[0]
        parts = (
            [None]
            if error_class == "focus"
            else np.flatnonzero(touched.reshape(len(touched), -1)[:, 0])
        )
        for part in parts:
            number = None if part is None else int(part)
            width = tolerances.of(error_class).half_width
            singles += [
                Single(error_class=error_class, part=number, value=v) for v in (width, -width)
            ]
    arrays = {name: np.zeros((len(singles), *value.shape[1:])) for name, value in _arrays(reach)}
    for copy, single in enumerate(singles):
        place: tuple[int, ...] = (copy,) if single.part is None else (copy, single.part)
        array = arrays[FIELDS[single.error_class]]
        if array.ndim > len(place):
            place = (*place, 1 if "decentre" in single.error_class else 0)
        array[place] = single.value
    return tuple(singles), Deviations(**arrays)
