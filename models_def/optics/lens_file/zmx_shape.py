"""The shape and the phase of a surface of a .zmx file: PARM and XDAT of each type, in and out."""

from collections.abc import Callable
from typing import Any, Final

from camkit.errors import DecodeError, UnsupportedError
from camkit.models_def.optics.lens_file.zmx_records import Record, Records, last
from camkit.models_def.optics.prescription import Surface
from camkit.models_def.optics.shape.phase import Phase
from camkit.models_def.optics.shape.polynomial import without_last_zeros

EVEN_TERMS: Final = 8
MOST_EXTRA: Final = 240
_FIRST_EXTRA: Final = 3
"""XDAT 1 is the number of terms, XDAT 2 the normalisation radius."""

Shape = dict[str, Any]


def read_shape(records: Records, mm_per_unit: float) -> Shape:
    """Return the fields of `Surface` that hold its polynomial part and its phase.

    Raises:
        DecodeError: If a number is damaged or missing.
        UnsupportedError: If its type is none that camkit traces.
    """
    kind = last(records, "TYPE")
    name = kind.words[0].upper() if kind is not None and kind.words else "STANDARD"
    return READERS[name](records, mm_per_unit)


def _parameters(records: Records, kind: str, first: int = 1) -> list[float]:
    """Return PARM `first`..8 in their order."""
    values = [0.0] * (EVEN_TERMS + 1)
    for record in records.get("PARM", []):
        number, value = record.number(0), record.number(1)
        if number not in range(EVEN_TERMS + 1) or (number < first and value):
            raise DecodeError(
                f"line {record.line}: PARM of {kind} is {first}..{EVEN_TERMS}; "
                f"got {record.words[0]}"
            )
        values[int(number)] = value
    return values[first:]


def _powers(values: list[float], powers: range, mm_per_unit: float) -> tuple[float, ...]:
    """Return coefficients of r^p in mm; they have the unit length^(1 - p)."""
    pairs = zip(values, powers, strict=False)
    return without_last_zeros([value / mm_per_unit ** (p - 1) for value, p in pairs])


def _nothing(records: Records, mm_per_unit: float) -> Shape:  # noqa: ARG001
    return {}


def _even(records: Records, mm_per_unit: float) -> Shape:
    values = _parameters(records, "an even asphere")
    return {"even_asphere": _powers(values, range(2, 99, 2), mm_per_unit)}


def _odd(records: Records, mm_per_unit: float) -> Shape:
    return _mixed(_parameters(records, "an odd asphere"), mm_per_unit)


def _mixed(values: list[float], mm_per_unit: float) -> Shape:
    """Return coefficients of r, r^2, r^3, ..."""
    return {
        "odd_asphere": _powers(values[::2], range(1, 999, 2), mm_per_unit),
        "even_asphere": _powers(values[1::2], range(2, 999, 2), mm_per_unit),
    }


def _extra(records: Records) -> tuple[Record, float, list[float]]:
    """Return the last XDAT record, the normalisation radius and the coefficients."""
    values: dict[int, float] = {}
    record = None
    for record in records.get("XDAT", []):
        number = record.number(0)
        if number not in range(1, MOST_EXTRA + _FIRST_EXTRA):
            raise DecodeError(
                f"line {record.line}: XDAT is 1..{MOST_EXTRA + _FIRST_EXTRA - 1}; "
                f"got {record.words[0]}"
            )
        values[int(number)] = record.number(1)
    if record is None or 1 not in values or not values.get(2, 0.0) > 0:
        kind = last(records, "TYPE")
        line = f"line {kind.line}: " if kind else ""
        raise DecodeError(
            f"{line}a surface of this type needs XDAT 1 (number of terms) and XDAT 2 "
            "(normalisation radius, > 0)"
        )
    numbers = range(_FIRST_EXTRA, _FIRST_EXTRA + min(int(values[1]), MOST_EXTRA))
    return record, values[2], [values.get(i, 0.0) for i in numbers]


def _extended(records: Records, mm_per_unit: float, *, odd: bool) -> Shape:
    """Return an extended asphere; with a radius of 1 its coefficients are those of powers of r."""
    _, radius, values = _extra(records)
    if radius == 1:
        if odd:
            return _mixed(values, mm_per_unit)
        return {"even_asphere": _powers(values, range(2, 999, 2), mm_per_unit)}
    scaled = [value * mm_per_unit for value in values]
    shape: Shape = {"even_asphere": without_last_zeros(scaled[1::2] if odd else scaled)}
    if odd:
        shape["odd_asphere"] = without_last_zeros(scaled[::2])
    if any(map(any, shape.values())):
        shape["normal_radius_mm"] = radius * mm_per_unit
    return shape


def _extended_even(records: Records, mm_per_unit: float) -> Shape:
    return _extended(records, mm_per_unit, odd=False)


def _extended_odd(records: Records, mm_per_unit: float) -> Shape:
    return _extended(records, mm_per_unit, odd=True)


def _binary(records: Records, mm_per_unit: float) -> Shape:
    order, *values = _parameters(records, "BINARY_2", first=0)
    _, radius, coefficients = _extra(records)
    phase = Phase(
        radius_mm=radius * mm_per_unit, radial_rad=without_last_zeros(coefficients), order=order
    )
    shape: Shape = {"even_asphere": _powers(values, range(2, 99, 2), mm_per_unit)}
    return {**shape, "phase": phase} if phase.radial_rad else shape


READERS: Final[dict[str, Callable[[Records, float], Shape]]] = {
    "STANDARD": _nothing,
    "EVENASPH": _even,
    "ODDASPHE": _odd,
    "XASPHERE": _extended_even,
    "XOSPHERE": _extended_odd,
    "BINARY_2": _binary,
}


def shape_lines(surface: Surface) -> tuple[str, list[str]]:
    """Return the type of a surface and its PARM and XDAT lines.

    Raises:
        UnsupportedError: If no type of the format has its shape, or both its shape and phase.
    """
    even, odd = surface.even_asphere, surface.odd_asphere
    if surface.phase is not None:
        return "BINARY_2", _binary_lines(surface, surface.phase)
    if surface.q_bfs:
        raise UnsupportedError(
            "Q_bfs terms, of which camkit knows no type of a .zmx file; write .toml"
        )
    if surface.normal_radius_mm is None and not odd and len(even) <= EVEN_TERMS:
        return ("EVENASPH", _parm_lines(even)) if even else ("STANDARD", [])
    # a Q_con asphere goes out as the extended asphere that it is
    even = surface.polynomial.even
    values = even if not odd else tuple(_interleaved(odd, even))
    if surface.normal_radius_mm is None and len(values) <= EVEN_TERMS:
        return "ODDASPHE", _parm_lines(values)
    lines = _extra_lines(surface.normal_radius_mm or 1.0, values)
    return "XOSPHERE" if odd else "XASPHERE", lines


def _interleaved(odd: tuple[float, ...], even: tuple[float, ...]) -> list[float]:
    values = [0.0] * max(2 * len(odd) - 1, 2 * len(even))
    values[0 : 2 * len(odd) : 2] = odd
    values[1 : 2 * len(even) : 2] = even
    return values


def _parm_lines(values: tuple[float, ...]) -> list[str]:
    return [f"  PARM {i} {value!r}" for i, value in enumerate(values, start=1)]


def _extra_lines(radius_mm: float, values: tuple[float, ...]) -> list[str]:
    numbers = (len(values), radius_mm, *values)
    return [f'  XDAT {i} {value!r} 0 0 1 0 0 ""' for i, value in enumerate(numbers, start=1)]


def _binary_lines(surface: Surface, phase: Phase) -> list[str]:
    if phase.free_rad:
        raise UnsupportedError(
            "a free phase in x and y, which a BINARY_2 surface does not hold; write .toml"
        )
    part = surface.polynomial
    if part.series is not None or len(part.even) > EVEN_TERMS:
        raise UnsupportedError(
            f"a phase on an asphere that is no even one of up to {EVEN_TERMS} terms, which a "
            "BINARY_2 surface does not hold; write .toml"
        )
    return [
        f"  PARM 0 {phase.order!r}",
        *_parm_lines(part.even),
        *_extra_lines(phase.radius_mm, phase.radial_rad),
    ]
