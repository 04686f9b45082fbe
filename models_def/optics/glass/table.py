"""Glasses written into a prescription as `[[glass]]` tables, so that one file says everything."""

from collections.abc import Mapping
from typing import Any, Final

from camkit.errors import ContractError
from camkit.models_def.optics.glass.material import Glass

KEYS: Final = ("name", "formula", "coefficients", "range_um", "source")


def parse_glass_table(table: Mapping[str, Any]) -> Glass:
    """Read a glass from its table.

    Raises:
        ContractError: If a key is unknown, missing or of a wrong type.
    """
    name = table.get("name")
    if set(table) != set(KEYS):
        raise ContractError(
            f"a [[glass]] table needs the keys {', '.join(KEYS)}; got {', '.join(sorted(table))}"
        )
    if not all(isinstance(table[key], str) for key in ("name", "formula", "source")):
        raise ContractError(f"glass {name!r}: name, formula and source must be text")
    range_um = _numbers(table["range_um"], name)
    if len(range_um) != 2:
        raise ContractError(f"glass {name!r}: range_um must be [low, high]; got {range_um}")
    return Glass(
        name=table["name"],
        formula=table["formula"],
        coefficients=_numbers(table["coefficients"], name),
        range_um=(range_um[0], range_um[1]),
        source=table["source"],
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


def _numbers(value: object, name: object) -> tuple[float, ...]:
    if not isinstance(value, list) or any(
        isinstance(v, bool) or not isinstance(v, int | float) for v in value
    ):
        raise ContractError(f"glass {name!r}: expected a list of numbers; got {value!r}")
    return tuple(map(float, value))
