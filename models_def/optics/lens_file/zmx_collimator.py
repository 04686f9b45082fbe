"""An ideal lens in front of a lens that sends an object at its focus to infinity.

Files of experiments hold one: a chart at the focus of a collimator. The lens behind it sees an
object at infinity, and the heights of the chart are angles.
"""

import math
from dataclasses import replace
from typing import Final

from camkit.models_def.optics.lens_file.zmx_records import Record, ZmxRecords, last

_TYPE: Final = "PARAXIAL"
_TOLERANCE: Final = 1e-6
_OBJECT_HEIGHTS: Final = 1
_FIELDS: Final = ("XFLN", "YFLN", "XFLD", "YFLD")
_ENTRANCE_APERTURES: Final = ("ENPD", "OBNA")
"""Apertures that would be those of the collimator."""


def without_collimator(records: ZmxRecords) -> tuple[ZmxRecords, tuple[str, ...]]:
    """Return a file whose object lies at infinity, where its first surface is a collimator.

    Args:
        records: The file.

    Returns:
        The file without the collimator, and a note of it; any other file as it is.
    """
    kind = last(records.surfaces[1], "TYPE")
    focal = _focal_length(records)
    fields = last(records.system, "FTYP")
    if (
        kind is None
        or focal is None
        or fields is None
        or fields.number(0, 0.0) != _OBJECT_HEIGHTS
        or any(key in records.system for key in _ENTRANCE_APERTURES)
        or "STOP" in records.surfaces[1]
    ):
        return records, ()
    system = {**records.system, "FTYP": [replace(fields, words=("0", *fields.words[1:]))]}
    for key in _FIELDS:
        record = last(records.system, key)
        if record is not None:
            system[key] = [_as_angles(record, focal)]
    chart = records.surfaces[0]
    infinity = replace(chart["DISZ"][-1], words=("INFINITY",))
    surfaces = ({**chart, "DISZ": [infinity]}, *records.surfaces[2:])
    note = (
        f"line {kind.line}: the ideal lens of focal length {focal:g} has the object at its focus: "
        "left out, the object is at infinity and its heights are angles"
    )
    return ZmxRecords(system=system, surfaces=surfaces), (note,)


def _focal_length(records: ZmxRecords) -> float | None:
    """Return the focal length of an ideal lens with the object at its focus, in units of the file.

    None if the first surface is none.
    """
    kind = last(records.surfaces[1], "TYPE")
    distance = last(records.surfaces[0], "DISZ")
    if kind is None or kind.words[:1] != (_TYPE,) or len(records.surfaces) < 4:
        return None
    focal = next(
        (p.number(1) for p in records.surfaces[1].get("PARM", []) if p.number(0) == 1), 0.0
    )
    if not focal > 0 or distance is None or distance.words[:1] == ("INFINITY",):
        return None
    return focal if abs(distance.number(0) - focal) <= _TOLERANCE * focal else None


def _as_angles(record: Record, focal: float) -> Record:
    degrees = (math.degrees(math.atan(height / focal)) for height in record.numbers())
    return replace(record, words=tuple(repr(angle) for angle in degrees))
