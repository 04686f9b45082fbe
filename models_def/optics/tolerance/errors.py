"""Classes of fabrication errors, how wide each is, and what assembly corrects."""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, Self, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from camkit.errors import ContractError
from camkit.models_def.optics.tolerance.uniform_errors import FabricationErrors
from camkit.units import to_radians

Distribution = Literal["uniform", "normal"]
Compensator = Literal["paraxial", "spot", "gap", "none"]
ErrorClass = Literal[
    "radius",
    "thickness",
    "index",
    "abbe",
    "conic",
    "power",
    "irregularity",
    "groove_depth",
    "surface_decentre",
    "surface_tilt",
    "element_decentre",
    "element_tilt",
    "wedge",
    "focus",
]
DISTRIBUTIONS: Final[tuple[Distribution, ...]] = get_args(Distribution)
COMPENSATORS: Final[tuple[Compensator, ...]] = get_args(Compensator)
ERROR_CLASSES: Final[tuple[ErrorClass, ...]] = get_args(ErrorClass)

NORMAL_SIGMAS: Final = 2.0  # a normal error is cut off at its half-width, at so many sigma
MAX_TILT_RAD: Final = 0.5
MAX_FRINGES: Final = 100.0
_MAX_SHARE: Final = 0.5
_BASE: Final = FabricationErrors()

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class ErrorWidth:
    """The distribution of an error.

    Attributes:
        half_width: Largest error, in the unit of its class; of a decentre or tilt its length.
        distribution: uniform (a decentre: over the disc), or normal with a standard deviation of
            half the half-width, cut off at the half-width.
    """

    half_width: float
    distribution: Distribution = "uniform"

    def __post_init__(self) -> None:
        if not (math.isfinite(self.half_width) and self.half_width >= 0):
            raise ContractError(f"a half-width must be finite and >= 0; got {self.half_width}")
        if self.distribution not in DISTRIBUTIONS:
            raise ContractError(
                f"a distribution is {' or '.join(DISTRIBUTIONS)}; got {self.distribution!r}"
            )

    def signed(self, uniform: Array) -> Array:
        """Convert uniform draws to errors of both signs.

        Args:
            uniform: (n,) or any shape, numbers 0 to 1.

        Returns:
            Errors in the shape of the draws, and in the unit of the width: mm, deg or no unit.
        """
        if self.distribution == "uniform":
            return self.half_width * (2 * uniform - 1)
        low = ndtr(-NORMAL_SIGMAS)
        sigma = self.half_width / NORMAL_SIGMAS
        return np.asarray(sigma * ndtri(low + uniform * (1 - 2 * low)))

    def length(self, uniform: Array) -> Array:
        """Convert uniform draws to lengths of vectors of any direction.

        Args:
            uniform: (n,) or any shape, numbers 0 to 1.

        Returns:
            Lengths in the shape of the draws, and in the unit of the width: mm, deg or no unit.
        """
        if self.distribution == "uniform":
            return self.half_width * np.sqrt(uniform)
        cut = 1 - math.exp(-(NORMAL_SIGMAS**2) / 2)
        sigma = self.half_width / NORMAL_SIGMAS
        return np.asarray(sigma * np.sqrt(-2 * np.log1p(-uniform * cut)))


_NOTHING: Final = ErrorWidth(half_width=0.0)
_DECENTRE: Final = ErrorWidth(half_width=0.02)
_TILT: Final = ErrorWidth(half_width=to_radians(1 / 60))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerances:
    """Half-widths of every class of errors, and the compensator.

    Decentres and tilts are those of the pieces of glass (`element_`, about the front vertex) and
    of each of their surfaces (`surface_`, about its own vertex). A fringe is half a wavelength of
    546.07 nm, as on drawings by ISO 10110-5: 0.273 um of surface height; see `figure`.

    Attributes:
        radius: Relative, of every curved surface.
        thickness: mm, of every gap and element, the last one excepted.
        index: Of every glass.
        abbe: Relative, of the Abbe number of every glass, the index at the d line kept.
        conic: Of every surface of a glass.
        power: Fringes by which the sagitta of every surface of a glass is off at its rim.
        irregularity: Fringes from the highest to the lowest point of every surface of a glass,
            its best sphere taken away: a saddle, which is what a cylinder leaves.
        groove_depth: Relative, of the relief of every surface with grooves: its heights are so
            many times too large, its walls stand where they should.
        surface_decentre: mm.
        surface_tilt: Radians.
        element_decentre: mm.
        element_tilt: Radians.
        wedge: Radians, of every glass: its rear surface is turned against its front.
        focus: mm, of the distance to the sensor, after the compensator.
        compensator: What moves the sensor at assembly: to where it stood to the paraxial image
            in the design (decision 0004), to the smallest RMS spot in the same way, or nothing.
            `gap` moves an air gap and the sensor so that rays land as in the design.
        compensator_gap: Number of the surface in front of that gap; None for the gap that does
            most for each mm.
    """

    radius: ErrorWidth = field(default=ErrorWidth(half_width=_BASE.radius_relative))
    thickness: ErrorWidth = field(default=ErrorWidth(half_width=_BASE.thickness_mm))
    index: ErrorWidth = field(default=ErrorWidth(half_width=_BASE.index))
    abbe: ErrorWidth = _NOTHING
    conic: ErrorWidth = _NOTHING
    power: ErrorWidth = _NOTHING
    irregularity: ErrorWidth = _NOTHING
    groove_depth: ErrorWidth = _NOTHING
    surface_decentre: ErrorWidth = _DECENTRE
    surface_tilt: ErrorWidth = _TILT
    element_decentre: ErrorWidth = _DECENTRE
    element_tilt: ErrorWidth = _TILT
    wedge: ErrorWidth = _NOTHING
    focus: ErrorWidth = field(default=ErrorWidth(half_width=_BASE.focus_mm))
    compensator: Compensator = "paraxial"
    compensator_gap: int | None = None

    def __post_init__(self) -> None:
        if self.compensator not in COMPENSATORS:
            raise ContractError(
                f"a compensator is one of {', '.join(COMPENSATORS)}; got {self.compensator!r}"
            )
        shares = self.radius, self.abbe, self.groove_depth
        if max(share.half_width for share in shares) > _MAX_SHARE:
            raise ContractError(
                f"radius, abbe and groove_depth errors must be at most 50 %; got {self}"
            )
        tilts = self.surface_tilt, self.element_tilt, self.wedge
        if max(tilt.half_width for tilt in tilts) > MAX_TILT_RAD:
            raise ContractError(f"tilts must be at most {MAX_TILT_RAD} rad; got {self}")
        if max(self.power.half_width, self.irregularity.half_width) > MAX_FRINGES:
            raise ContractError(
                f"power and irregularity must be at most {MAX_FRINGES:g} fringes; got {self}"
            )
        if self.compensator_gap is not None and self.compensator != "gap":
            raise ContractError(
                f"compensator_gap needs the compensator gap; got {self.compensator!r}"
            )

    def of(self, error_class: ErrorClass) -> ErrorWidth:
        """Return the width of a class."""
        width: ErrorWidth = getattr(self, error_class)
        return width

    def active(self) -> tuple[ErrorClass, ...]:
        """Return the classes that are not 0."""
        return tuple(
            error_class for error_class in ERROR_CLASSES if self.of(error_class).half_width > 0
        )

    def only(self, error_class: ErrorClass) -> Self:
        """Return the same with every other class 0."""
        others: dict[str, Any] = dict.fromkeys(ERROR_CLASSES, _NOTHING)
        return replace(self, **{**others, error_class: self.of(error_class)})
