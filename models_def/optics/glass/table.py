"""Glasses written into a prescription as `[[glass]]` tables, so that one file says everything."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from camkit.errors import ContractError
from camkit.models_def.optics.glass.material import Formula, Glass
from camkit.models_def.toml_table import section


@dataclass(frozen=True, slots=True, kw_only=True)
class _GlassTable:
    """The keys of [[glass]]."""

    name: str
    formula: Formula
    coefficients: tuple[float, ...]
    range_um: tuple[float, ...]
    source: str


def parse_glass_table(table: Mapping[str, Any]) -> Glass:
    """Read a glass from its table.

    Raises:
        ContractError: If a key is unknown, missing or of a wrong type.
    """
    where = f"glass {table.get('name')!r}" if isinstance(table, Mapping) else "[[glass]]"
    entries = section(where, _GlassTable, table)
    if len(entries.range_um) != 2:
        raise ContractError(f"{where}: range_um must be [low, high]; got {entries.range_um}")
    low, high = entries.range_um
    return Glass(
        name=entries.name,
        formula=entries.formula,
        coefficients=entries.coefficients,
        range_um=(low, high),
        source=entries.source,
    )


def glass_table(glass: Glass) -> dict[str, str | tuple[float, ...]]:
    """Return the table of a glass; `parse_glass_table` gives it back, but for the stated values."""
    return {
        "name": glass.name,
        "formula": glass.formula,
        "coefficients": glass.coefficients,
        "range_um": glass.range_um,
        "source": glass.source,
    }
