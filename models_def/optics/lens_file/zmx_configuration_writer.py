"""Fields and configurations of a `Lens` as lines of a .zmx file."""

import math
from collections.abc import Sequence

from camkit.errors import UnsupportedError
from camkit.models_def.optics.configuration.exact_text import degrees_text
from camkit.models_def.optics.paraxial import paraxial_data
from camkit.models_def.optics.prescription import Lens

FAR_TEXT = "1E+10"
"""An object at infinity in lines that have numbers only."""
_TAIL = "0 0 0 1 1 1 0 0"


def field_texts(states: Sequence[Lens]) -> list[list[str]]:
    """Return the fields of each state, all of one kind and number.

    Heights of objects if all are near, else angles, which count at the entrance pupil where the
    object is near. States with fewer fields repeat their last one.
    """
    by_height = all(math.isfinite(lens.object_distance_mm) for lens in states)
    rows = [[_field_text(lens, a, by_height) for a in lens.field_angles_rad] for lens in states]
    most = max(map(len, rows))
    return [row + row[-1:] * (most - len(row)) for row in rows]


def _field_text(lens: Lens, angle_rad: float, by_height: bool) -> str:
    if by_height:
        return _height_text(lens, angle_rad)
    distance_mm = lens.object_distance_mm
    if math.isinf(distance_mm):
        return degrees_text(angle_rad)
    from_pupil_mm = distance_mm + paraxial_data(lens).entrance_pupil_mm
    return repr(math.degrees(math.atan(math.tan(angle_rad) * distance_mm / from_pupil_mm)))


def _height_text(lens: Lens, angle_rad: float) -> str:
    """Return the object height that becomes this angle again."""
    height_mm = math.tan(angle_rad) * lens.object_distance_mm
    low = high = height_mm
    for _ in range(8):
        for value in (low, high):
            if math.atan(value / lens.object_distance_mm) == angle_rad:
                return repr(value)
        low, high = math.nextafter(low, 0), math.nextafter(high, math.inf)
    return repr(height_mm)


def configuration_lines(states: Sequence[Lens], current: int) -> list[str]:
    """Return MNUM and its operands, each with all configurations in a row, as readers need them.

    Args:
        states: The lens in each.
        current: Place of the one that the rest of the file shows.

    Raises:
        UnsupportedError: If the states differ in what the format does not hold.
    """
    if len({lens.aperture_kind for lens in states}) > 1:
        raise UnsupportedError(
            "configurations whose apertures are of several kinds; a .zmx file has one: write .toml"
        )
    openings = [repr(lens.aperture_value) for lens in states]
    distances_mm = [lens.object_distance_mm for lens in states]
    is_floating = states[0].aperture_kind == "stop_semi_diameter_mm"
    if is_floating:
        _check_stops(states, current)
    lines = [f"MNUM {len(states)} {current + 1}"]
    lines += [] if is_floating else _operand_lines("APER", 0, openings)
    for number, texts in enumerate(zip(*field_texts(states), strict=True), start=1):
        lines += _operand_lines("YFIE", number, texts)
    lines += _operand_lines(
        "THIC", 0, [FAR_TEXT if math.isinf(mm) else repr(mm) for mm in distances_mm]
    )
    for place in range(len(states[0].surfaces)):
        surfaces = [lens.surfaces[place] for lens in states]
        rims = [surface.semi_diameter_mm for surface in surfaces]
        is_opening = is_floating and place == states[0].stop
        if len(set(rims)) > 1 and math.inf in rims:
            raise UnsupportedError(
                f"surface {place} has a rim in some configurations alone; write .toml"
            )
        lines += _operand_lines(
            "SDIA", place + 1, openings if is_opening else list(map(repr, rims))
        )
        lines += _operand_lines("THIC", place + 1, [repr(s.thickness_mm) for s in surfaces])
    return lines


def _operand_lines(operand: str, number: int, texts: Sequence[str]) -> list[str]:
    """Return a line for each configuration; none where nothing differs."""
    if len(set(texts)) == 1:
        return []
    return [f"{operand}   {number}   {i} {text} {_TAIL}" for i, text in enumerate(texts, start=1)]


def _check_stops(states: Sequence[Lens], current: int) -> None:
    """Refuse stops whose rim neither is their aperture in every state nor stays as it is."""
    pairs = [(s.surfaces[s.stop].semi_diameter_mm, s.aperture_value) for s in states]
    rim_mm, opening_mm = pairs[current]
    follows = all(rim == opening for rim, opening in pairs)
    stays = all(rim == rim_mm for rim, _ in pairs)
    is_fixed = all(opening == opening_mm for _, opening in pairs)
    if not (follows or (stays and (rim_mm != opening_mm or is_fixed))):
        raise UnsupportedError(
            "the stop has a rim that is not its aperture in every configuration; write .toml"
        )
