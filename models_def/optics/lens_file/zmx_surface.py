"""One surface of a .zmx file as a `Surface` in millimetres."""

import math
from dataclasses import dataclass
from typing import Final

from camkit.errors import ContractError, DecodeError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import AIR, own_glass
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.lens_file.zmx_glass import (
    MODEL_NAME,
    GlassOrder,
    read_glass,
    read_model_glass,
)
from camkit.models_def.optics.lens_file.zmx_records import Record, Records, last
from camkit.models_def.optics.lens_file.zmx_shape import READERS, read_shape
from camkit.models_def.optics.prescription import Surface

_FIXED: Final = (1, 2)
"""Stated, and picked up from another surface; 0 and 3 follow the rays."""
_OBSTACLES: Final = ("SQAP", "SQOB", "ELAP", "ELOB", "USAP", "USOB", "OBSC", "SPID")


@dataclass(frozen=True, slots=True, kw_only=True)
class SurfaceContext:
    """The facts of its file that a surface needs.

    Attributes:
        number: Of the surface, from the object (0).
        mm_per_unit: Length unit of the file.
        order: Where glasses are looked for.
    """

    number: int
    mm_per_unit: float
    order: GlassOrder


def read_surface(records: Records, context: SurfaceContext) -> Surface:
    """Read a surface between object and image.

    An automatic semi-diameter (DIAM flag 0) is what the rays of the file happened to need: it
    limits nothing. A fixed one (flag 1, or 2 if picked up from another) vignettes, and so does a
    circular aperture (CLAP), which takes its place. MEMA, FLAP (a floating aperture: DIAM says it
    all) and drawing data are passed over.

    Raises:
        UnsupportedError: If its type, aperture or tilt is none that camkit traces.
        DecodeError: If a number is damaged.
    """
    refuse_unsupported(records, context.number)
    scale = context.mm_per_unit
    thickness = last(records, "DISZ")
    if thickness is None:
        raise DecodeError(f"surface {context.number} has no DISZ; is the file cut off?")
    if thickness.words[:1] == ("INFINITY",):
        raise UnsupportedError(
            f"line {thickness.line}: surface {context.number} is infinitely thick; "
            "only the object may be"
        )
    glass = medium_after(records, context)
    return Surface(
        curvature_per_mm=_value(records, "CURV") / scale,
        thickness_mm=thickness.number(0) * scale,
        glass=glass.name,
        material=own_glass(glass, context.order.user_catalogues),
        semi_diameter_mm=_semi_diameter(records, context.number) * scale,
        conic=_value(records, "CONI"),
        **read_shape(records, scale),
    )


def refuse_unsupported(records: Records, number: int) -> None:
    """Refuse a surface that camkit does not trace, by name.

    Raises:
        UnsupportedError: If it is of another type, a mirror, tilted, or not round.
    """
    kind = last(records, "TYPE")
    if kind is not None and (kind.words[:1] or ("nothing",))[0].upper() not in READERS:
        raise UnsupportedError(
            f"line {kind.line}: surface {number} is of type {' '.join(kind.words)[:40]}; "
            f"camkit reads {', '.join(READERS)}"
        )
    glass = last(records, "GLAS")
    if glass is not None and glass.words[:1] == ("MIRROR",):
        raise UnsupportedError(
            f"line {glass.line}: surface {number} is a mirror; camkit traces lenses only"
        )
    for key in _OBSTACLES:
        record = last(records, key)
        if record is not None:
            raise UnsupportedError(
                f"line {record.line}: surface {number} has an aperture {key}; camkit has round "
                "ones about the axis (CLAP from 0)"
            )
    for key, first in (("OBDC", 0), ("SCBD", 3)):
        record = last(records, key)
        if record is not None and any(record.number(i) for i in range(first, len(record.words))):
            raise UnsupportedError(
                f"line {record.line}: surface {number} is tilted or decentred ({key}); "
                "camkit traces centred lenses"
            )


def _value(records: Records, key: str) -> float:
    record = last(records, key)
    return record.number(0) if record else 0.0


def medium_after(records: Records, context: SurfaceContext) -> Glass:
    """Return the glass that a surface states, air where it states none."""
    record = last(records, "GLAS")
    if record is None or not record.words or record.words[0].upper() == "AIR":
        return AIR
    name = record.words[0]
    try:
        if name == MODEL_NAME:
            comment = last(records, "COMM")
            numbers = [record.number(3), record.number(4), record.number(5, 0.0)]
            return read_model_glass(numbers, comment.text.strip() if comment else "", context.order)
        return read_glass(record, context.order)
    except ContractError as error:
        where = f"line {record.line}: surface {context.number}"
        raise ContractError(f"{where}: {error}") from error


def _semi_diameter(records: Records, number: int) -> float:
    aperture, diameter = last(records, "CLAP"), last(records, "DIAM")
    if aperture is not None:
        if aperture.number(0) != 0:
            raise UnsupportedError(
                f"line {aperture.line}: surface {number} has a central obscuration"
            )
        return _positive(aperture, aperture.number(1))
    if diameter is None or diameter.number(1, 0.0) not in _FIXED or diameter.number(0) == 0:
        return math.inf
    return _positive(diameter, diameter.number(0))


def _positive(record: Record, value: float) -> float:
    if not value > 0:
        raise DecodeError(f"line {record.line}: {record.key} must be > 0; got {value}")
    return value
