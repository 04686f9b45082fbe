"""The reader of glass catalogue files (.agf), the format in which makers hand out their glasses.

One glass is a line `NM name formula MIL-number n_d V_d ...` and the lines after it: `CD` with the
dispersion coefficients, `LD` with the valid wavelengths in um, `GC` with a comment; `ED`, `TD`,
`OD`, `MD`, `BD`, `IT` and others carry what camkit does not use. Indices are relative to air.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from camkit.errors import ContractError, DecodeError
from camkit.models_def.optics.glass.catalogue import GlassCatalogue
from camkit.models_def.optics.glass.encoding import read_text
from camkit.models_def.optics.glass.material import Formula, Glass

MAX_GLASSES: Final = 20_000

_Converted = tuple[Formula, tuple[float, ...]]


def _pairs(values: list[float]) -> _Converted:
    pairs = zip(values[::2], values[1::2], strict=False)
    return "sellmeier", tuple(v for b, c in pairs if b for v in (b, c))


def _powers(*powers: float) -> Callable[[list[float]], _Converted]:
    def convert(values: list[float]) -> _Converted:
        pairs = zip(values, powers, strict=False)
        return "powers", tuple(v for a, p in pairs if a for v in (a, p))

    return convert


def _first(formula: Formula, count: int) -> Callable[[list[float]], _Converted]:
    return lambda values: (formula, tuple([*values, *[0.0] * count][:count]))


_FORMULAS: Final[Mapping[int, Callable[[list[float]], _Converted]]] = {
    1: _first("schott", 6),
    2: _pairs,
    3: _first("herzberger", 6),
    4: _first("sellmeier_mixed", 5),
    5: _first("conrady", 3),
    6: _pairs,
    7: _first("handbook_1", 4),
    8: _first("handbook_2", 4),
    9: _first("sellmeier_offset", 5),
    10: _powers(0, 2, -2, -4, -6, -8, -10, -12),
    11: _pairs,
    12: _powers(0, 2, -2, -4, -6, -8, 4, 6),
    13: _powers(0, 2, 4, -2, -4, -6, -8, -10, -12),
}
"""By the number in the NM line: Schott, Sellmeier 1, Herzberger, Sellmeier 2, Conrady,
Sellmeier 3, Handbook of Optics 1 and 2, Sellmeier 4, Extended, Sellmeier 5, Extended 2 and 3."""


@dataclass(slots=True)
class _Draft:
    """A glass while its lines are read."""

    line: int
    name: str
    formula: int
    index_d: float | None
    abbe_number: float | None
    comment: str = ""
    coefficients: list[float] = field(default_factory=list)
    range_um: tuple[float, float] | None = None


def read_agf(path: Path) -> GlassCatalogue:
    """Read a catalogue; its name is that of the file without suffix, "-" written as "_".

    Raises:
        DecodeError: If the file is not text or a line is damaged; the message gives the line.
    """
    return parse_agf(read_text(path), path.stem.replace("-", "_"))


def parse_agf(text: str, name: str) -> GlassCatalogue:
    """Read a catalogue from its text; see `read_agf`."""
    drafts: list[_Draft] = []
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        if not words:
            continue
        key = words[0].upper()
        if key == "NM":
            drafts.append(_start(words, number))
            if len(drafts) > MAX_GLASSES:
                raise DecodeError(f"line {number}: more than {MAX_GLASSES} glasses")
        elif key in {"CD", "LD", "GC"}:
            if not drafts:
                raise DecodeError(f"line {number}: {key} before the first NM line")
            _add(drafts[-1], key, words[1:], number)
    if not drafts:
        raise DecodeError(f"{name} must be an .agf glass catalogue; it has no NM line")
    glasses = [_finish(draft, name) for draft in drafts]
    _refuse_doubles(drafts)
    return GlassCatalogue(name=name, glasses=tuple(glasses))


def _start(words: list[str], number: int) -> _Draft:
    if len(words) < 3:
        raise DecodeError(f"line {number}: NM needs a name and a formula number; got {words[1:]}")
    formula = _number(words[2], number)
    if formula not in _FORMULAS:
        raise DecodeError(
            f"line {number}: dispersion formula must be 1..{max(_FORMULAS)}; got {words[2]}"
        )
    printed = [_number(word, number) for word in words[4:6]]
    # 1.0 and 0.0 stand for unknown
    index_d = printed[0] if printed and printed[0] > 1 else None
    abbe_number = printed[1] if index_d and len(printed) > 1 and printed[1] else None
    return _Draft(number, words[1], int(formula), index_d, abbe_number)


def _add(draft: _Draft, key: str, words: list[str], number: int) -> None:
    if key == "GC":
        draft.comment = " ".join(words)
        return
    values = [_number(word, number) for word in words]
    if key == "CD":
        draft.coefficients = values
    elif len(values) < 2 or not 0 <= values[0] < values[1]:
        raise DecodeError(f"line {number}: LD needs the least and greatest wavelength; got {words}")
    else:
        draft.range_um = values[0], values[1]


def _finish(draft: _Draft, catalogue: str) -> Glass:
    if not draft.coefficients or draft.range_um is None:
        missing = "LD" if draft.coefficients else "CD"
        raise DecodeError(f"line {draft.line}: glass {draft.name} has no {missing} line")
    formula, coefficients = _FORMULAS[draft.formula](draft.coefficients)
    try:
        return Glass(
            name=f"{draft.name}-{catalogue}",
            formula=formula,
            coefficients=coefficients,
            source=" ".join(f"{catalogue}.agf {draft.comment}".split()),
            range_um=draft.range_um,
            stated_index_d=draft.index_d,
            stated_abbe_number=draft.abbe_number,
        )
    except ContractError as error:
        raise DecodeError(f"line {draft.line}: {error}") from error


def _refuse_doubles(drafts: list[_Draft]) -> None:
    first: dict[str, int] = {}
    for draft in drafts:
        if draft.name in first:
            raise DecodeError(
                f"line {draft.line}: glass {draft.name} stands already in line {first[draft.name]}"
            )
        first[draft.name] = draft.line


def _number(word: str, line: int) -> float:
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise DecodeError(f"line {line}: expected a number; got {word[:40]!r}")
    return value
