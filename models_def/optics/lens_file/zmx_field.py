"""Fields of a .zmx file (angles, object heights, image heights) as camkit's field angles.

camkit's field angle is seen from the first vertex, and a lens is round: only the distance of a
field from the axis counts, not its sign or azimuth.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from enum import IntEnum

import torch

from camkit.errors import UnsupportedError
from camkit.models_def.optics.aiming.chief_path import chief_path
from camkit.models_def.optics.aiming.field import field_angle
from camkit.models_def.optics.configuration.field_limits import widest_deg
from camkit.models_def.optics.lens_file.zmx_records import Records, last
from camkit.models_def.optics.paraxial import paraxial_data, trace_paraxial
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.spot import slopes_for_heights
from camkit.models_def.optics.trace import SurfaceTensors, surface_tensors
from camkit.units import to_degrees, to_radians


class FieldType(IntEnum):
    """The first number of the FTYP line."""

    ANGLE = 0
    OBJECT_HEIGHT = 1
    PARAXIAL_IMAGE_HEIGHT = 2
    REAL_IMAGE_HEIGHT = 3


def with_fields(lens: Lens, system: Records, mm_per_unit: float) -> tuple[Lens, tuple[str, ...]]:
    """Return the lens with the fields of its file, increasing, each once, and what was left out.

    Args:
        lens: Everything else about it.
        system: The records outside the surfaces.
        mm_per_unit: Length unit of the file.

    Raises:
        UnsupportedError: If the fields are of a type that camkit does not convert, or chief rays
            are not to go through the stop.
    """
    record = last(system, "FTYP")
    if record is not None and record.number(1, 0.0) != 0:
        raise UnsupportedError(
            f"line {record.line}: the object space is telecentric; camkit sends chief rays "
            "through the stop"
        )
    number = int(record.number(0, 0.0)) if record else FieldType.ANGLE
    if number not in list(FieldType):
        line = f"line {record.line}: " if record else ""
        raise UnsupportedError(
            f"{line}fields are of kind {number}; camkit reads angles (0), object heights (1), "
            "paraxial (2) and real image heights (3)"
        )
    return with_field_points(lens, FieldType(number), _points(system), mm_per_unit)


def with_field_points(
    lens: Lens,
    kind: FieldType,
    points: Sequence[tuple[float, float]],
    mm_per_unit: float = 1.0,
) -> tuple[Lens, tuple[str, ...]]:
    """Return the lens with fields as other programs state them, and notes on those left out.

    Fields are increasing, each once; left out are those to which the lens cannot be aimed.

    Args:
        lens: Everything else about it.
        kind: What the points are.
        points: (x, y): angles in degrees, or heights in units of the file.
        mm_per_unit: That unit.

    Raises:
        UnsupportedError: If object heights belong to a distant object.
    """
    notes: tuple[str, ...] = ()
    if kind == FieldType.ANGLE and math.isinf(lens.object_distance_mm):
        angles = {_skew_angle(x, y) for x, y in points}
    elif kind == FieldType.ANGLE:
        at_pupil = {_skew_angle(x, y) for x, y in points}
        angles = {_angle_from_vertex(lens, a) if a < math.pi / 2 else a for a in at_pupil}
    else:
        heights = sorted({math.hypot(x, y) * mm_per_unit for x, y in points})
        if kind == FieldType.REAL_IMAGE_HEIGHT:
            heights, notes = _heights_within(lens, heights)
        angles = set(_angles_of_heights(lens, kind, heights))
    widest = widest_deg(lens.object_distance_mm)
    angles_within = sorted(angle for angle in angles if angle < to_radians(widest))
    if len(angles_within) < len(angles):
        names = ", ".join(
            f"{to_degrees(angle):.4g}" for angle in sorted(angles - set(angles_within))
        )
        note = f"fields at {names} degrees are left out: camkit aims rays up to {widest:g}"
        notes = (*notes, note)
    return replace(lens, field_angles_rad=tuple(angles_within or [0.0])), notes


def _heights_within(lens: Lens, heights_mm: list[float]) -> tuple[list[float], tuple[str, ...]]:
    """Return the image heights to which the lens can be aimed, and a note on the others."""
    if not any(heights_mm):
        return heights_mm, ()
    path = chief_path(lens)
    widest_mm = abs(float(path.heights_mm[path.outermost]))
    heights_beyond = [height for height in heights_mm if height > widest_mm]
    if not heights_beyond:
        return heights_mm, ()
    names = ", ".join(f"{height:g} mm" for height in heights_beyond)
    note = f"fields at {names} are left out: the lens is aimed to {path.reach}"
    return [height for height in heights_mm if height <= widest_mm] or [0.0], (note,)


def _points(system: Records) -> list[tuple[float, float]]:
    """Return the fields (x, y) that are in use: FTYP says how many of the numbers."""
    record = last(system, "FTYP")
    x_record = last(system, "XFLN") or last(system, "XFLD")
    y_record = last(system, "YFLN") or last(system, "YFLD")
    xs = x_record.numbers() if x_record else ()
    ys = y_record.numbers() if y_record else ()
    length = max(len(xs), len(ys), 1)
    pairs = [(xs[i] if i < len(xs) else 0.0, ys[i] if i < len(ys) else 0.0) for i in range(length)]
    count = int(record.number(2, 0.0)) if record else 0
    return pairs[:count] if count > 0 else pairs


def _skew_angle(x_deg: float, y_deg: float) -> float:
    if not (x_deg and y_deg):
        return to_radians(max(math.fabs(x_deg), math.fabs(y_deg)))
    return math.atan(math.hypot(math.tan(to_radians(x_deg)), math.tan(to_radians(y_deg))))


def _angle_from_vertex(lens: Lens, angle_rad: float) -> float:
    """Convert an angle at the entrance pupil, as other programs have it for a near object."""
    distance_mm = lens.object_distance_mm
    pupil_mm = paraxial_data(lens).entrance_pupil_mm
    return math.atan(math.tan(angle_rad) * (distance_mm + pupil_mm) / distance_mm)


def _angles_of_heights(lens: Lens, field_type: FieldType, heights_mm: list[float]) -> list[float]:
    near = math.isfinite(lens.object_distance_mm)
    if field_type == FieldType.REAL_IMAGE_HEIGHT:
        slopes = slopes_for_heights(lens, torch.tensor(heights_mm, dtype=torch.float64))
        return field_angle(slopes.abs()).tolist()
    if field_type == FieldType.OBJECT_HEIGHT:
        if not near:
            raise UnsupportedError("object heights need an object at a finite distance")
        return [math.atan(height / lens.object_distance_mm) for height in heights_mm]
    if not near:
        focal_mm = _front_focal_length(lens)
        return [math.atan(height / focal_mm) for height in heights_mm]
    scale = _magnification(lens) * lens.object_distance_mm
    return [math.atan(height / scale) for height in heights_mm]


def _front_focal_length(lens: Lens) -> float:
    """Return |image height / slope of a distant object|: n over the power of the lens."""
    tensors, one = _tensors(lens)
    _, slope = trace_paraxial(tensors, one, 0 * one, range(len(lens.surfaces)))
    return abs(float(tensors.index[0] / (slope * tensors.index[-1])))


def _magnification(lens: Lens) -> float:
    """Return |image height / object height|: n over n' times the ratio of the marginal slopes."""
    tensors, one = _tensors(lens)
    surfaces = range(len(lens.surfaces))
    _, slope = trace_paraxial(tensors, lens.object_distance_mm * one, one, surfaces)
    return abs(float(tensors.index[0] / (slope * tensors.index[-1])))


def _tensors(lens: Lens) -> tuple[SurfaceTensors, torch.Tensor]:
    """Return a lens at its reference wavelength, and a paraxial height or slope of 1."""
    wave = torch.tensor(lens.reference_wavelength_um, dtype=torch.float64)
    return surface_tensors(lens, wave), torch.ones((), dtype=torch.float64)
