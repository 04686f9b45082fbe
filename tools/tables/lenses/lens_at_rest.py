"""A lens that does not move in the loop of a design: any prescription, as it is.

Its kernels are traced once, with every ray aimed at the real stop, so that lenses that were made
elsewhere and never meant for these fields are judged by what their metal lets through.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import torch
from torch import Tensor, nn

from camkit.errors import ContractError
from camkit.models_def.design.fabrication import Copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.optics.asymmetric.turning import turned_back, turned_lens
from camkit.models_def.optics.focus import FocusMerit, with_focus
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.psf import energy_diameter, splat, with_object_distance
from camkit.models_def.optics.pupil import both_halves, half_disc
from camkit.models_def.optics.scaling import with_f_number
from camkit.models_def.optics.search.problem import Problem
from camkit.models_def.optics.search.splat import Pixels
from camkit.models_def.optics.search.variables import FreeLens
from camkit.models_def.optics.spot import Spots, trace_spots
from camkit.units import UM_PER_MM

# spots hundreds of pixels wide need them: their contrast is known to 1 / sqrt(rays) or better
REST_RAYS: Final = 16_000
_WINDOW_RAYS: Final = 1000
_LIGHT_SHARE: Final = 0.995
_LEAST_PX: Final = 33


class LensAtRest(DesignLens):
    """Kernels that stay as they are, with what a loop asks of a lens.

    Attributes:
        kernels: (depth, field, 3, k, k).
    """

    kernels: Tensor

    def __init__(self, problem: Problem, pixels: Pixels, kernels: Tensor) -> None:
        """Store kernels (depth, field, 3, k, k)."""
        super().__init__()
        self.problem, self.pixels = problem, pixels
        self.register_buffer("kernels", kernels)
        self.register_buffer("begin", torch.zeros(0, dtype=torch.float64))
        self.moves = nn.Parameter(torch.zeros_like(self.begin))

    def scaled(self) -> Tensor:
        """Return no free number."""
        return self.moves

    def forward(self) -> tuple[Tensor, Tensor]:
        """Return kernels (depth, field, 3, k, k) and no penalty."""
        return self.kernels, torch.zeros((), dtype=self.kernels.dtype)

    def made_kernels(self, copy: Copy) -> Tensor:
        """Refuse: a lens at rest is judged as it was traced."""
        raise ContractError(f"a lens at rest has no copies; got {copy}")

    def views(self) -> list[tuple[Problem, Tensor]]:
        """Return the one problem, without variables."""
        return [(self.problem, self.begin)]

    def finished(self) -> Lens:
        """Return the lens as it is."""
        return self.lens()

    def lens(self) -> Lens:
        """Return the lens as a prescription."""
        return self.problem.free.lens


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldLight:
    """Kernels and light of a lens at every depth and field.

    Attributes:
        kernels: (depth, field, 3, k, k), each sums to 1.
        share_inside: (depth, field), share of the arriving light that falls into the window.
        arriving: (depth, field), share of the rays of the stop that reach the sensor.
        rms_mm: (depth, field), RMS spot radius of all wavelengths; NaN without light.
    """

    kernels: Tensor
    share_inside: Tensor
    arriving: Tensor
    rms_mm: Tensor


def at_work(
    lens: Lens, *, f_number: float, object_distance_mm: float, focus: FocusMerit | None = None
) -> Lens:
    """Return a lens set to an F-number and focused at a distance.

    Args:
        lens: The prescription.
        f_number: EFL / entrance pupil diameter.
        object_distance_mm: Where the scene is.
        focus: How the sensor is placed; None leaves it in a lens that is made for this distance
            and puts it at the paraxial image otherwise.
    """
    is_made_for_it = math.isclose(lens.object_distance_mm, object_distance_mm, rel_tol=1e-9)
    near = with_f_number(with_object_distance(lens, object_distance_mm), f_number)
    return near if focus is None and is_made_for_it else with_focus(near, focus or "paraxial")


def window_of(problem: Problem, pixels: Pixels, largest_px: int) -> int:
    """Return the odd window that holds 99.5 % of the light of every field and depth, or the cap."""
    problem = replace(problem, samples=half_disc(_WINDOW_RAYS))
    diameters = [
        energy_diameter(spots, _LIGHT_SHARE).max()
        for depth_mm in problem.depths_mm
        for spots in _field_spots(problem, depth_mm)
        if spots is not None
    ]
    if not diameters:
        raise ContractError("no field of the lens gets light; check stop, rims and fields")
    side = float(torch.stack(diameters).max()) * UM_PER_MM / pixels.pitch_um
    return min(max(_LEAST_PX, 2 * math.ceil(side / 2) + 3), largest_px)


def trace_at_rest(problem: Problem, pixels: Pixels) -> FieldLight:
    """Trace the kernels of a lens.

    Light outside the window is spread evenly over it: none is lost, and it carries no picture.
    Light that the rims of the lens take away is made up for, as a longer exposure would. A field
    without light has an even kernel.

    Args:
        problem: Its lens as it works, fields, wavelengths, depths and samples of half the pupil.
        pixels: Pitch, colours and window.
    """
    light = [
        [
            _field(spots, pixels, whole_pupil=problem.whole_pupil)
            for spots in _field_spots(problem, depth_mm)
        ]
        for depth_mm in problem.depths_mm
    ]

    def table(part: int) -> Tensor:
        return torch.stack([torch.stack([field[part] for field in fields]) for fields in light])

    return FieldLight(kernels=table(0), share_inside=table(1), arriving=table(2), rms_mm=table(3))


def _field_spots(problem: Problem, depth_mm: float) -> list[Spots | None]:
    """Return spots (1, wave, ray) about the centroid of all rays; None without light."""
    lens, azimuths = with_object_distance(problem.free.lens, depth_mm), problem.azimuths_rad
    samples = problem.samples if azimuths is None else both_halves(problem.samples)
    fields: list[Spots | None] = []
    for i, slope in enumerate(problem.slopes):
        azimuth_rad = 0.0 if azimuths is None else float(azimuths[i])
        try:
            turned = turned_lens(lens, azimuth_rad)
            spots = trace_spots(turned, slope[None], problem.wavelengths_um, samples)
        except ContractError:
            # not even the chief ray arrives: this field is beyond the lens
            fields.append(None)
            continue
        alive = bool((spots.weight.sum(-1) > 0).all())
        if azimuths is not None:
            x_mm, y_mm = turned_back(spots.x_mm, spots.y_mm, azimuth_rad)
            spots = replace(spots, x_mm=x_mm - _mean(spots, x_mm)[:, None, None], y_mm=y_mm)
        middle = _mean(spots, spots.y_mm)
        fields.append(replace(spots, chief_y_mm=middle) if alive else None)
    return fields


def _mean(spots: Spots, places_mm: Tensor) -> Tensor:
    """Return the mean (field,) of places of all rays."""
    return (spots.weight * places_mm).sum((1, 2)) / spots.weight.sum((1, 2))


def _field(spots: Spots | None, pixels: Pixels, *, whole_pupil: bool) -> tuple[Tensor, ...]:
    """Return kernel (3, k, k), share inside, share arriving and RMS radius of one field."""
    size = pixels.kernel_px
    even = torch.full((3, size, size), 1 / size**2, dtype=torch.float64)
    none = torch.zeros((), dtype=torch.float64)
    if spots is None:
        return even, none, none, torch.full_like(none, math.nan)
    traced = splat(spots, size, pixels.pitch_um, whole_pupil=whole_pupil)
    energy = pixels.color_weights * traced.energy_kept
    kernel = torch.einsum("cw,wyx->cyx", energy, traced.kernels[0])
    share_inside = energy.sum(1)[:, None, None]
    share = spots.weight / spots.weight.sum()
    off_y = spots.y_mm - spots.chief_y_mm[:, None, None]
    rms = torch.sqrt((share * (spots.x_mm**2 + off_y**2)).sum())
    arriving = (spots.weight > 0).double().mean()
    return kernel + (1 - share_inside).clamp_min(0) * even, share_inside.min(), arriving, rms


def at_rest(
    lens: Lens, problem: Problem, pixels: Pixels, rays: int = REST_RAYS
) -> tuple[LensAtRest, FieldLight]:
    """Return a lens at rest that looks at the fields, wavelengths and depths of a problem.

    Args:
        lens: As it works.
        problem: Its own lens and samples are not used.
        pixels: Pitch, colours and window.
        rays: In half the stop; with azimuths in all of it.
    """
    problem_at_rest = replace(
        problem,
        free=FreeLens(lens=lens, variables=(), rides=False),
        samples=half_disc(rays // 2 if problem.whole_pupil else rays),
    )
    light = trace_at_rest(problem_at_rest, pixels)
    return LensAtRest(problem_at_rest, pixels, light.kernels.float()), light
