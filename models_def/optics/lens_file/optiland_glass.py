"""Glasses as optiland's JSON has them.

A glass of a maker goes out by name and catalogue, since optiland has the same catalogues; any other
goes out with its coefficients, so that the other program traces the same rays. Each surface has its
strict name as comment, from which it is read back unless the numbers were changed.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import PureWindowsPath
from typing import Any, Final

import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.optics.glass.catalogue import (
    AIR,
    GlassCatalogue,
    builtin_catalogues,
    catalogues_of,
    find_glass,
    trade_name_of,
)
from camkit.models_def.optics.glass.dispersion import (
    C_LINE_UM,
    D_LINE_UM,
    F_LINE_UM,
    refractive_index,
)
from camkit.models_def.optics.glass.material import Formula, Glass
from camkit.models_def.optics.glass.model_glass import model_glass
from camkit.models_def.optics.lens_file.json_table import (
    Table,
    number_at,
    numbers_at,
    table_at,
    text_at,
)

COMMENT: Final = "glass "
_MAKERS: Final = ("Schott", "Ohara", "Hoya", "Hikari", "CDGM")
"""Catalogues that both programs have from refractiveindex.info."""
_AMBIGUOUS: Final = ("SF5", "SF10", "SF11", "BAF10", "FDS90(P)")
"""Names that stand twice in a catalogue of optiland 0.6.3, or in none."""
_SAME: Final = 1e-9
_MIXED: Final = (0.0, 0.0, 1.0, 1.0)
_SCHOTT_POWERS: Final = (0.0, 2.0, -2.0, -4.0, -6.0, -8.0)
_STEP_UM: Final = 0.001
_VISIBLE_UM: Final = (0.36, 1.1)


def glass_table(glass: Glass, wavelengths_um: Sequence[float]) -> dict[str, Any]:
    """Return the table of a glass.

    Args:
        glass: Any.
        wavelengths_um: Of the lens; where a glass has no formula of refractiveindex.info it is a
            table of indices with these among its wavelengths.
    """
    if glass.formula == "constant":
        return _material("IdealMaterial", index=glass.coefficients[0], absorp=0.0)
    trade_name = trade_name_of(glass)
    makers = () if trade_name in _AMBIGUOUS else builtin_catalogues()
    for catalogue in makers:
        if catalogue.name in _MAKERS and catalogue.get(glass.name) == glass:
            maker = catalogue.name.lower()
            facts: dict[str, Any] = {"name": trade_name, "reference": maker, "catalog": maker}
            facts |= {"match_policy": "strict", "robust_search": None, "bounds": "clamp"}
            return _material("Material", **facts, min_wavelength=None, max_wavelength=None)
    kind, coefficients = _FORMULAS.get(glass.formula, _no_formula)(glass.coefficients)
    if kind:
        dispersion: dict[str, Any] = {"kind": "formula", "formula": kind}
        dispersion |= {"coefficients": coefficients, "wavelength_range_um": None}
    else:
        dispersion = _samples(glass, wavelengths_um)
    definition = {"dispersion": dispersion, "extinction": None, "thermal": None}
    return _material(
        "DataMaterial", definition=definition, name=glass.name, metadata={}, bounds="raise"
    )


def read_glass_table(
    table: Table,
    comment: str,
    where: str,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
) -> Glass:
    """Return the glass of a table.

    Args:
        table: `material_post` of a surface.
        comment: Of the surface.
        where: For messages.
        catalogues: The user's; asked first.
        preferred: Those of camkit that are asked first for a name without catalogue.

    Raises:
        UnsupportedError: If the material is of a kind that camkit has not.
        ContractError: If a glass is unknown.
    """
    kind = text_at(table, "type")
    reader = _READERS.get(kind)
    if kind == "Material":
        return _named_glass(table, catalogues, preferred)
    if reader is None:
        raise UnsupportedError(
            f"{where}: material {kind or 'without a type'}; camkit reads Material, "
            f"{', '.join(_READERS)}"
        )
    glass = reader(table, where)
    return _glass_of_comment(glass, comment, catalogues) or glass


def _material(kind: str, **facts: Any) -> dict[str, Any]:
    return {"type": kind, "propagation_model": {"class": "HomogeneousPropagation"}, **facts}


def _glass_of_comment(
    glass: Glass, comment: str, catalogues: Sequence[GlassCatalogue]
) -> Glass | None:
    """Return the glass that camkit wrote, if its indices are still those of the file."""
    if not comment.startswith(COMMENT):
        return None
    lines = torch.tensor([D_LINE_UM, F_LINE_UM, C_LINE_UM], dtype=torch.float64)
    try:
        candidate = find_glass(comment.removeprefix(COMMENT), catalogues)
        pairs = zip(
            refractive_index(candidate, lines).tolist(),
            refractive_index(glass, lines).tolist(),
            strict=True,
        )
        return candidate if all(abs(a - b) <= _SAME for a, b in pairs) else None
    except ContractError:
        return None


def _named_glass(
    table: Table, catalogues: Sequence[GlassCatalogue], preferred: Sequence[GlassCatalogue]
) -> Glass:
    """Return a glass by the file that optiland found it in, else by its name and catalogue."""
    file = PureWindowsPath(text_at(table, "filename"))
    folders = [part.lower() for part in file.parts[:-1]]
    name = file.stem if "glass" in folders else text_at(table, "name")
    for maker in (text_at(table, "catalog"), *folders[::-1], text_at(table, "reference")):
        for catalogue in catalogues_of(maker) if maker else ():
            matches = catalogue.with_trade_name(name) or catalogue.with_trade_name(name.upper())
            if matches:
                return matches[0]
    for group in (catalogues, preferred):
        for catalogue in group:
            if catalogue.with_trade_name(name):
                return catalogue.with_trade_name(name)[0]
    return find_glass(name, catalogues, preferred)


def _ideal(table: Table, where: str) -> Glass:
    index = number_at(table, "index", where)
    return AIR if index == 1 else model_glass(index, 0.0)


def _abbe(table: Table, where: str) -> Glass:
    return model_glass(number_at(table, "index", where), number_at(table, "abbe", where))


def _data(table: Table, where: str) -> Glass:
    dispersion = table_at(table_at(table, "definition", where), "dispersion", where)
    kind, numbers = text_at(dispersion, "formula"), numbers_at(dispersion, "coefficients", where)
    name = text_at(table, "name") or "glass"
    if text_at(dispersion, "kind") == "tabulated":
        waves = numbers_at(dispersion, "wavelengths_um", where)
        return _glass_of_samples(name, waves, numbers_at(dispersion, "indices", where), where)
    pairs = [v for pair in zip(numbers[1::2], numbers[2::2], strict=False) for v in pair]
    offset = numbers[0] if numbers else 0.0
    formula: Formula
    if kind in ("formula 1", "formula 2"):
        squared = [v**2 if i % 2 and kind == "formula 1" else v for i, v in enumerate(pairs)]
        formula, terms = "sellmeier_offset", [1 + offset, *squared]
    elif kind == "formula 3":
        formula, terms = "powers", [offset, 0.0, *pairs]
    elif kind == "formula 5" and pairs[1::2] == [-1.0, -3.5]:
        formula, terms = "conrady", [offset, *pairs[::2]]
    elif kind == "formula 5" and pairs[1::2] == [-2.0 * i for i in range(1, len(pairs) // 2 + 1)]:
        formula, terms = "cauchy", [offset, *pairs[::2]]
    else:
        raise UnsupportedError(f"{where}: dispersion {kind or 'without a formula'} of {name}")
    return Glass(
        name=f"{name.replace('-', '_')}-optiland",
        formula=formula,
        coefficients=tuple(terms),
        source="optiland file",
    )


def _glass_of_samples(
    name: str, waves: tuple[float, ...], indices: tuple[float, ...], where: str
) -> Glass:
    """Return the named glass that a table of indices samples."""
    try:
        glass = find_glass(name)
        lines = torch.tensor(waves, dtype=torch.float64)
        pairs = zip(refractive_index(glass, lines).tolist(), indices, strict=True)
        if all(abs(a - b) <= _SAME for a, b in pairs):
            return glass
    except (ContractError, ValueError):
        pass
    raise UnsupportedError(
        f"{where}: a table of indices for {name}; camkit has formulas: give a named glass or the "
        "n_d and V_d of a model glass"
    )


_READERS: Final[Mapping[str, Callable[[Table, str], Glass]]] = {
    "IdealMaterial": _ideal,
    "AbbeMaterial": _abbe,
    "DataMaterial": _data,
}


def _samples(glass: Glass, wavelengths_um: Sequence[float]) -> dict[str, Any]:
    low = max(glass.range_um[0], _VISIBLE_UM[0])
    high = min(glass.range_um[1], _VISIBLE_UM[1])
    count = math.floor((high - low) / _STEP_UM)
    grid = {low + i * _STEP_UM for i in range(count)} | {high, *wavelengths_um}
    waves = sorted(grid)
    indices = refractive_index(glass, torch.tensor(waves, dtype=torch.float64)).tolist()
    return {"kind": "tabulated", "wavelengths_um": waves, "indices": indices}


_Row = tuple[str, list[float]]


def _sellmeier(offset: float, pairs: Sequence[float]) -> _Row:
    return "formula 2", [offset, *pairs]


def _powers(pairs: Sequence[tuple[float, float]]) -> _Row:
    constant = sum(a for a, power in pairs if not power)
    return "formula 3", [constant, *(v for pair in pairs if pair[1] for v in pair)]


def _no_formula(_: Sequence[float]) -> _Row:
    return "", []


_FORMULAS: Final[Mapping[Formula, Callable[[tuple[float, ...]], _Row]]] = {
    "sellmeier": lambda c: _sellmeier(0.0, c),
    "sellmeier_offset": lambda c: _sellmeier(c[0] - 1, c[1:]),
    "sellmeier_mixed": lambda c: (
        "formula 4",
        [1 + c[0], c[1], 2.0, c[2], 2.0, c[3], 0.0, c[4], 2.0],
    ),
    "handbook_1": lambda c: ("formula 4", [c[0], c[1], 0.0, c[2], 1.0, *_MIXED, -c[3], 2.0]),
    "handbook_2": lambda c: ("formula 4", [c[0], c[1], 2.0, c[2], 1.0, *_MIXED, -c[3], 2.0]),
    "schott": lambda c: _powers(list(zip(c, _SCHOTT_POWERS, strict=True))),
    "powers": lambda c: _powers(list(zip(c[::2], c[1::2], strict=True))),
    "cauchy": lambda c: (
        "formula 5",
        [c[0], *(v for i, a in enumerate(c[1:], start=1) for v in (a, -2.0 * i))],
    ),
    "conrady": lambda c: ("formula 5", [c[0], c[1], -1.0, c[2], -3.5]),
    "herzberger": lambda c: ("formula 7", list(c)),
}
"""By camkit's formula: that of refractiveindex.info with its coefficients."""
