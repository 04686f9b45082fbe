"""Exact paraxial data: EFL, BFL, pupils, focus, images (the r^2 aspheric term included)."""

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.prescription import Lens, require_plain
from camkit.models_def.optics.reverse import reverse
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors


@dataclass(frozen=True, slots=True, kw_only=True)
class Paraxial:
    """First-order data at one wavelength, lengths in mm.

    Attributes:
        efl_mm: Effective focal length.
        bfl_mm: From the last vertex to the focal point.
        ffl_mm: From the first vertex to the front focal point.
        entrance_pupil_mm: Its position from the first vertex.
        entrance_pupil_diameter_mm: Its diameter.
        exit_pupil_mm: Its position from the last vertex.
        exit_pupil_diameter_mm: Its diameter.
        stop_semi_diameter_mm: Paraxial marginal height at the stop.
    """

    efl_mm: float
    bfl_mm: float
    ffl_mm: float
    entrance_pupil_mm: float
    entrance_pupil_diameter_mm: float
    exit_pupil_mm: float
    exit_pupil_diameter_mm: float
    stop_semi_diameter_mm: float

    @property
    def f_number(self) -> float:
        """EFL / entrance pupil diameter."""
        return self.efl_mm / self.entrance_pupil_diameter_mm


def vertex_curvature(tensors: SurfaceTensors) -> Tensor:
    """Return (surface, ...) vertex curvatures: c + 2 a_2.

    A term in r, a cone, has none: it is left out, and paraxial data are those of the rest.
    """
    if tensors.even_asphere.shape[1] == 0:
        return tensors.curvature_per_mm
    bend = 2 * tensors.even_asphere[:, 0]
    if tensors.series:
        scales = [1.0 if s is None else s.radius_mm**-2 for s in tensors.series]
        bend = bend * bend.new_tensor(scales).reshape(-1, *[1] * (bend.ndim - 1))
    return tensors.curvature_per_mm + bend


def phase_power(tensors: SurfaceTensors) -> Tensor | None:
    """Return (surface, ...) powers in 1/mm that phases add; None where no surface has any.

    The power is -kappa d^2 Phi / dr^2 on the axis; of a free phase its mean over azimuths.
    """
    if tensors.phase is None or tensors.order_mm is None:
        return None
    rows = []
    for i, form in enumerate(tensors.phases):
        bend = torch.zeros_like(tensors.order_mm[i])
        if form is not None:
            if form.radial:
                bend = bend + 2 * tensors.phase[i, 0]
            for j, powers in enumerate(form.powers, start=form.radial):
                if powers in {(2, 0), (0, 2)}:
                    bend = bend + tensors.phase[i, j]
            bend = bend / form.radius_mm**2
        rows.append(-tensors.order_mm[i] * bend)
    return torch.stack(torch.broadcast_tensors(*rows))  # type: ignore[no-untyped-call]


def trace_paraxial(
    tensors: SurfaceTensors, height: Tensor, slope: Tensor, surfaces: range
) -> tuple[Tensor, Tensor]:
    """Trace y, u (slope dy/dz) through surfaces; y is given on the last one, u after it.

    n' u' = n u - y (c (n' - n) + phase), and y + t u between surfaces.
    """
    curvature, phase = vertex_curvature(tensors), phase_power(tensors)
    for i in surfaces:
        before, after = tensors.index[i], tensors.index[i + 1]
        bent = before * slope - height * curvature[i] * (after - before)
        slope = (bent if phase is None else bent - height * phase[i]) / after
        if i != surfaces[-1]:
            height = height + tensors.thickness_mm[i] * slope
    return height, slope


def focal_lengths(tensors: SurfaceTensors) -> tuple[Tensor, Tensor]:
    """Return EFL and BFL in mm, differentiable, with the batch shape of the tensors."""
    one = torch.ones_like(tensors.index[0] * tensors.curvature_per_mm[0])
    surfaces = range(len(tensors.aspheric))
    height, slope = trace_paraxial(tensors, one, torch.zeros_like(one), surfaces)
    return -1 / slope, -height / slope


def image_distance(tensors: SurfaceTensors, object_distance_mm: float) -> Tensor:
    """Return the paraxial image distance in mm from the last vertex, in the batch shape."""
    one = torch.ones_like(tensors.index[0] * tensors.curvature_per_mm[0])
    count = len(tensors.aspheric)
    height, slope = trace_paraxial(tensors, one, one / object_distance_mm, range(count))
    return -height / slope


def image_of_stop(tensors: SurfaceTensors, stop: int) -> tuple[Tensor, Tensor]:
    """Return place (mm behind the last vertex) and magnification of the stop seen from behind."""
    zero = torch.zeros_like(tensors.index[0] * tensors.curvature_per_mm[0])
    rest = range(stop + 1, len(tensors.aspheric))
    if not rest:
        return zero, zero + 1
    height, slope = trace_paraxial(tensors, tensors.thickness_mm[stop] + zero, zero + 1, rest)
    place = -height / slope
    # a ray that leaves the edge of the stop parallel to the axis meets the pupil edge
    edge, lean = trace_paraxial(tensors, zero + 1, zero, rest)
    return place, edge + place * lean


def entrance_pupil(tensors: SurfaceTensors, stop: int) -> tuple[Tensor, Tensor]:
    """Return place (mm behind the first vertex) and magnification of the entrance pupil."""
    # a stop at a surface: rays in front of it see it through the surfaces before it only
    place, scale = image_of_stop(reverse(tensors), len(tensors.aspheric) - 1 - stop)
    return -place, scale


def paraxial_data(lens: Lens, wavelength_um: float | None = None) -> Paraxial:
    """Compute the first-order data of a lens (object at infinity).

    Args:
        lens: The prescription.
        wavelength_um: The reference wavelength by default.
    """
    wave = lens.reference_wavelength_um if wavelength_um is None else wavelength_um
    tensors = surface_tensors(lens, torch.tensor(wave, dtype=torch.float64))
    efl, bfl = (float(v) for v in focal_lengths(tensors))
    ffl = -float(focal_lengths(reverse(tensors))[1])
    entrance_mm, front_scale = (float(v) for v in entrance_pupil(tensors, lens.stop))
    exit_mm, exit_scale = (float(v) for v in image_of_stop(tensors, lens.stop))
    stop_mm = _stop_semi_diameter(lens, efl, front_scale)
    return Paraxial(
        efl_mm=efl,
        bfl_mm=bfl,
        ffl_mm=ffl,
        entrance_pupil_mm=entrance_mm,
        entrance_pupil_diameter_mm=2 * stop_mm * abs(front_scale),
        exit_pupil_mm=exit_mm,
        exit_pupil_diameter_mm=2 * stop_mm * abs(exit_scale),
        stop_semi_diameter_mm=stop_mm,
    )


def widest_stop_mm(lens: Lens) -> float:
    """Return the semi-diameter of the stop whose beam on the axis just passes the other rims.

    inf where no surface has a rim.
    """
    tensors = surface_tensors(lens, torch.tensor(lens.reference_wavelength_um, dtype=torch.float64))
    one, far_mm = torch.ones((), dtype=torch.float64), lens.object_distance_mm
    heights = [
        abs(float(trace_paraxial(tensors, one, one / far_mm, range(i + 1))[0]))
        for i in range(len(lens.surfaces))
    ]
    rims = [surface.semi_diameter_mm for i, surface in enumerate(lens.surfaces) if i != lens.stop]
    others = [height for i, height in enumerate(heights) if i != lens.stop]
    room = min((rim / height for rim, height in zip(rims, others, strict=True)), default=math.inf)
    return room * heights[lens.stop]


def _stop_semi_diameter(lens: Lens, efl_mm: float, pupil_scale: float) -> float:
    if lens.aperture_kind == "stop_semi_diameter_mm":
        return lens.aperture_value
    diameter_mm = lens.aperture_value
    if lens.aperture_kind == "f_number":
        diameter_mm = abs(efl_mm) / lens.aperture_value
    return diameter_mm / 2 / abs(pupil_scale)


@dataclass(frozen=True, slots=True, kw_only=True)
class Image:
    """The paraxial image of the object plane.

    Attributes:
        distance_mm: From the last vertex; the BFL for an object at infinity.
        magnification: Image height / object height, negative if inverted; 0 at infinity.
        working_f_number: 1 / (2 n' u'), u' the slope of the paraxial marginal ray at the image;
            at infinity EFL / entrance pupil diameter.
    """

    distance_mm: float
    magnification: float
    working_f_number: float


def paraxial_image(lens: Lens, wavelength_um: float | None = None) -> Image:
    """Return the place, the size and the f-number of the image of a lens's object plane.

    Args:
        lens: The prescription.
        wavelength_um: The reference wavelength by default.

    Raises:
        ContractError: If the light leaves the lens parallel: there is no image.
    """
    wave = lens.reference_wavelength_um if wavelength_um is None else wavelength_um
    tensors = surface_tensors(lens, torch.tensor(wave, dtype=torch.float64))
    data = paraxial_data(lens, wave)
    edge_mm, distance_mm = data.entrance_pupil_diameter_mm / 2, lens.object_distance_mm
    if math.isinf(distance_mm):
        start, lean = edge_mm, 0.0
    else:
        lean = edge_mm / (distance_mm + data.entrance_pupil_mm)
        start = distance_mm * lean
    column = torch.tensor([start, lean], dtype=torch.float64)
    surfaces = range(len(tensors.aspheric))
    height, slope = (float(v) for v in trace_paraxial(tensors, column[0], column[1], surfaces))
    if slope == 0:
        raise ContractError(f"{lens.name} has no image: the light leaves it parallel")
    before, after = float(tensors.index[0]), float(tensors.index[-1])
    return Image(
        distance_mm=-height / slope,
        magnification=before * lean / (after * slope),
        working_f_number=1 / (2 * after * abs(slope)),
    )


def with_paraxial_focus(lens: Lens) -> Lens:
    """Return the lens with its sensor at the paraxial image of its object, reference wavelength."""
    require_plain(lens, "the paraxial focus")
    last = replace(lens.surfaces[-1], thickness_mm=paraxial_image(lens).distance_mm)
    return replace(lens, surfaces=(*lens.surfaces[:-1], last))
