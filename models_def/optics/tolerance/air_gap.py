"""An air gap that assembly adjusts together with the sensor, so that rays land as in the design.

To first order every ray moves in proportion to the gap and to the distance of the sensor. Both
are chosen by least squares: of all rays, each against the same ray of the design, both seen from
the centroid of their field.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.pupil import with_fixed_stop
from camkit.models_def.optics.tolerance.deviation import Deviations, no_deviations
from camkit.models_def.optics.tolerance.elements import glass_elements
from camkit.models_def.optics.tolerance.errors import Tolerances
from camkit.models_def.optics.tolerance.fabricated import View, trace_copies
from camkit.models_def.optics.tolerance.refit import (
    Beam,
    Pair,
    about_centroid,
    beam_of,
    displacement,
    product,
    shares,
)

_MAX_SHARE: Final = 0.5
_MAX_TRAVEL_MM: Final = 0.5
_STEP_SHARE: Final = 0.01
# of the square of what a gap does: what is left of it when the sensor has followed
_LEAST_LEFT: Final = 1e-9


def air_gaps(lens: Lens) -> tuple[int, ...]:
    """Return the numbers of the surfaces in front of the air gaps between pieces of glass."""
    pieces = glass_elements(lens)
    if not pieces:
        return ()
    inside = range(pieces[0].stop - 1, pieces[-1].start)
    return tuple(
        i for i in inside if lens.surfaces[i].glass == "air" and lens.surfaces[i].thickness_mm > 0
    )


def with_chosen_gap(lens: Lens, tolerances: Tolerances, view: View) -> Tolerances:
    """Return tolerances that name the gap, if their compensator is one.

    Without a number it is the gap that moves rays most for each mm, the sensor following.

    Raises:
        ContractError: If the lens has no such gap.
    """
    if tolerances.compensator != "gap":
        return tolerances
    gaps, number = air_gaps(lens), tolerances.compensator_gap
    if not gaps or number not in (None, *gaps):
        places = f"follow surfaces {', '.join(map(str, gaps))}" if gaps else "there are none"
        raise ContractError(
            f"the compensator gap needs an air gap between pieces of glass: {places}"
            + ("" if number is None else f"; got compensator_gap {number}")
        )
    if number is not None:
        return tolerances
    fixed, nothing = with_fixed_stop(lens), no_deviations(lens)
    powers = [float(_effect(fixed, nothing, view, gap).power) for gap in gaps]
    return replace(tolerances, compensator_gap=gaps[int(np.argmax(powers))])


def with_adjusted_gap(
    lens: Lens, deviations: Deviations, view: View, gap: int | None
) -> tuple[Deviations, Tensor]:
    """Return copies with their gap adjusted, and by how many mm it grew (copy,).

    It moves by half its length at most, and by 0.5 mm at most.

    Args:
        lens: Nominal.
        deviations: Of the copies.
        view: Fields, wavelengths, rays.
        gap: Number of the surface in front of it; None to leave all as it is.
    """
    if gap is None:
        return deviations, torch.zeros(deviations.copies, dtype=torch.float64)
    fixed = with_fixed_stop(lens)
    # the focus error comes after assembly
    focused = replace(deviations, focus_mm=np.zeros_like(deviations.focus_mm))
    alone = focused.groove_depth.any()
    blocks = [focused.of_copy(i) for i in range(focused.copies)] if alone else [focused]
    nominal = beam_of(*trace_copies(fixed, no_deviations(lens), view))
    with torch.no_grad():
        travel = torch.cat([_travel(fixed, block, view, gap, nominal) for block in blocks])
    thickness = deviations.thickness_mm.copy()
    thickness[:, gap] += travel.numpy()
    return replace(deviations, thickness_mm=thickness), travel


@dataclass(frozen=True, slots=True, kw_only=True)
class _Effect:
    """The change of landing points for each mm of a gap, the sensor following.

    Attributes:
        beam: Of the copies, before.
        share: Weight of the rays that arrive before and after.
        change: x and y, about the centroid of a field.
        power: Its mean square, summed over fields (copy,); 0 where the sensor does the same.
    """

    beam: Beam
    share: Tensor
    change: Pair
    power: Tensor


def _effect(lens: Lens, deviations: Deviations, view: View, gap: int) -> _Effect:
    beam = beam_of(*trace_copies(lens, deviations, view))
    step_mm = _STEP_SHARE * lens.surfaces[gap].thickness_mm
    thickness = deviations.thickness_mm.copy()
    thickness[:, gap] += step_mm
    wider = beam_of(*trace_copies(lens, replace(deviations, thickness_mm=thickness), view))
    share = shares(torch.where(wider.weight > 0, beam.weight, 0.0))
    x, y = ((new - old) / step_mm for new, old in zip(wider.points, beam.points, strict=True))
    whole, slopes = about_centroid((x, y), share), about_centroid(beam.slopes, share)
    follow = product(whole, slopes, share) / product(slopes, slopes, share)
    way = follow[:, None, None, None]
    change = (whole[0] - way * slopes[0], whole[1] - way * slopes[1])
    power = product(change, change, share)
    same = power <= _LEAST_LEFT * product(whole, whole, share)
    return _Effect(beam=beam, share=share, change=change, power=torch.where(same, 0.0, power))


def _travel(lens: Lens, deviations: Deviations, view: View, gap: int, nominal: Beam) -> Tensor:
    """Return by how much the gap must grow (copy,) in mm."""
    effect = _effect(lens, deviations, view, gap)
    error = displacement(effect.beam, nominal)
    both = product(error, effect.change, effect.share)
    travel = torch.where(effect.power > 0, -both / effect.power.clamp_min(1e-300), 0.0)
    most_mm = min(_MAX_TRAVEL_MM, _MAX_SHARE * lens.surfaces[gap].thickness_mm)
    return travel.clamp(-most_mm, most_mm)
