"""Grooves that a surface is cut into: what a prescription says of them, where their walls stand.

A continuous profile h(r) is laid down in rings: wherever |h| has grown by the depth of a groove it
begins anew at the vertex plane, as a Fresnel lens does. `tracing/groove` says how rays meet them.
"""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.shape.polynomial import Polynomial
from camkit.models_def.optics.tracing.sag import sag, sag_slope
from camkit.models_def.optics.tracing.series import Series
from camkit.units import UM_PER_MM, to_mm

_STEP_MM: Final = 0.001
_BISECTIONS: Final = 60
MOST_RIM_MM: Final = 1000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Grooves:
    """The grooves of a surface.

    Attributes:
        depth_um: Height after which the profile begins anew.
        walls: Whether rays that meet a wall, or a groove twice, are lost; without, grooves are
            ideal.
        tool_radius_um: Of the round nose of the tool, which leaves a fillet at the foot of each
            wall; 0 leaves sharp feet.
    """

    depth_um: float
    walls: bool = True
    tool_radius_um: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.depth_um) and self.depth_um > 0):
            raise ContractError(f"groove_depth_um must be > 0; got {self.depth_um}")
        if not (math.isfinite(self.tool_radius_um) and self.tool_radius_um >= 0):
            raise ContractError(
                f"{option_text('tool_radius_um')} must be >= 0; got {self.tool_radius_um}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """The continuous profile of a surface, up to its rim.

    Attributes:
        curvature_per_mm: See `prescription.Surface`.
        conic: The same.
        polynomial: The same.
        rim_mm: Radius at which it ends.
    """

    curvature_per_mm: float
    conic: float
    polynomial: Polynomial
    rim_mm: float

    def height_mm(self, radius_mm: Tensor) -> Tensor:
        """Return h at radii of any shape, float64; see `trace.sag`."""
        return sag(*self._numbers(radius_mm))

    def slope(self, radius_mm: Tensor) -> Tensor:
        """Return dh/dr at radii of any shape, float64."""
        return 2 * radius_mm.to(torch.float64) * sag_slope(*self._numbers(radius_mm))

    def _numbers(
        self, radius_mm: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Series | None]:
        part = self.polynomial
        numbers = (self.curvature_per_mm, self.conic, part.even, part.odd)
        c, k, even, odd = (torch.tensor(n, dtype=torch.float64) for n in numbers)
        return c, k, even, radius_mm.to(torch.float64) ** 2, odd, part.series


def grooved_mm(height_mm: Tensor, grooves: Grooves) -> Tensor:
    """Return the heights that are cut, of those of the continuous profile; any shape."""
    depth = to_mm(grooves.depth_um)
    return height_mm - depth * torch.trunc(height_mm / depth)


def wall_radii_mm(profile: Profile, grooves: Grooves) -> Tensor:
    """Return the radii (wall,) float64 at which walls stand, from the axis outwards.

    Raises:
        ContractError: If the profile has no rim within a metre, or a groove is narrower than 1 um.
    """
    if not profile.rim_mm <= MOST_RIM_MM:
        raise ContractError(
            f"a surface with grooves needs a finite semi_diameter_mm, at most {MOST_RIM_MM:g}; got "
            f"{profile.rim_mm:g}"
        )
    depth = to_mm(grooves.depth_um)

    def ring(radius_mm: Tensor) -> Tensor:
        return torch.trunc(profile.height_mm(radius_mm) / depth)

    steps = math.ceil(profile.rim_mm / _STEP_MM)
    radius = torch.linspace(0.0, profile.rim_mm, steps + 1, dtype=torch.float64)
    number = ring(radius)
    change = torch.nonzero(number[1:] != number[:-1])[:, 0]
    if bool(((number[change + 1] - number[change]).abs() > 1).any()):
        raise ContractError(
            f"a groove is narrower than {_STEP_MM * UM_PER_MM:.0f} um; make groove_depth_um larger"
        )
    low, high, inner_number = radius[change], radius[change + 1], number[change]
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        same = ring(middle) == inner_number
        low, high = torch.where(same, middle, low), torch.where(same, high, middle)
    return (low + high) / 2


def narrowest_mm(profile: Profile, grooves: Grooves) -> float:
    """Return the width of the narrowest groove between two walls; inf where there are no two.

    Raises:
        ContractError: See `wall_radii_mm`.
    """
    widths = torch.diff(wall_radii_mm(profile, grooves))
    return float(widths.min()) if len(widths) else math.inf


def groove_facts(profile: Profile, grooves: Grooves) -> dict[str, float | bool | None]:
    """Return the facts about the grooves of a surface, as plain values; None for no number."""
    narrowest = narrowest_mm(profile, grooves)
    return {
        "groove_depth_um": grooves.depth_um,
        "walls": len(wall_radii_mm(profile, grooves)),
        "narrowest_mm": narrowest if math.isfinite(narrowest) else None,
        "tool_radius_um": grooves.tool_radius_um,
        "ideal": not grooves.walls,
    }


def check_grooves(profile: Profile, grooves: Grooves) -> None:
    """Refuse grooves that cannot be cut.

    Raises:
        ContractError: If the profile has no rim, or a groove is narrower than 1 um.
        UnsupportedError: If a groove is narrower than the tool.
    """
    narrowest_um = narrowest_mm(profile, grooves) * UM_PER_MM
    if narrowest_um < 2 * grooves.tool_radius_um:
        raise UnsupportedError(
            f"a groove of {narrowest_um:.1f} um is narrower than the tool, whose nose is "
            f"{2 * grooves.tool_radius_um:g} um wide; make groove_depth_um larger or "
            f"{option_text('tool_radius_um')} smaller"
        )


def groove_table(grooves: Grooves) -> dict[str, float | bool]:
    """Return the keys of grooves in a prescription; defaults are left out."""
    table: dict[str, float | bool] = {"groove_depth_um": grooves.depth_um}
    if not grooves.walls:
        table["groove_walls"] = False
    if grooves.tool_radius_um:
        table["tool_radius_um"] = grooves.tool_radius_um
    return table
