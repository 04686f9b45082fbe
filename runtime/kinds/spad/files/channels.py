"""One of several channels, slices or frames: asked for by name, never summed in silence."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from camkit.caller import option_text
from camkit.errors import ContractError

ALL: Final = -1
MOST_LISTED: Final = 16


def chosen_places(
    path: Path, numbers: Mapping[str, Sequence[int]], key: str | None, *, summed: str | None = None
) -> dict[str, int]:
    """Return the place of the one that is meant, of every axis.

    Args:
        path: The file, for errors.
        numbers: Name of an axis, such as "channel" -> what its places are called.
        key: What the caller says: "channel 1", or "channel 1, slice 0" where there are several.
        summed: An axis of which a caller may take all, which gives `ALL`.

    Raises:
        ContractError: If nobody says which of several, or the choice is none of them.
    """
    stated = {} if key is None else _read(key, numbers, summed)
    found = {name: stated.get(name, ALL - 1) for name in numbers}
    for name, known in numbers.items():
        if name not in stated and len(known) == 1:
            found[name] = known[0]
    is_known = stated.keys() <= numbers.keys() and all(
        found[name] in known or (found[name] == ALL and name == summed)
        for name, known in numbers.items()
    )
    if not is_known:
        several = {name: known for name, known in numbers.items() if len(known) > 1} or numbers
        listed = "; ".join(_listed(n, k, is_summed=n == summed) for n, k in several.items())
        asked = "" if key is None else f", and no {key!r}"
        first = ", ".join(f"{name} {known[0]}" for name, known in several.items())
        raise ContractError(
            f"{path.name} holds {listed}{asked}; choose one in the file of "
            f'{option_text("timing")}: under [array] the line key = "{first}"'
        )
    return {
        name: ALL if found[name] == ALL else list(known).index(found[name])
        for name, known in numbers.items()
    }


def _read(key: str, names: Mapping[str, Sequence[int]], summed: str | None) -> dict[str, int]:
    """Return what a key states; what states no place is a name that no axis has."""
    found: dict[str, int] = {}
    for part in (part.strip() for part in key.split(",")):
        name, _, number = part.rpartition(" ")
        if summed is not None and part == f"all {summed}s":
            found[summed] = ALL
        elif name in names and number.isascii() and number.isdigit() and len(number) < 10:
            found[name] = int(number)
        else:
            found[f"{part}?"] = ALL
    return found


def _listed(name: str, known: Sequence[int], *, is_summed: bool) -> str:
    """Return the names of all places; of many the first and the last."""
    own = [f"{name} {number}" for number in known]
    if len(own) > MOST_LISTED:
        own = [f"{own[0]} to {own[-1]}"]
    return ", ".join(own + [f"all {name}s"] * (is_summed and len(known) > 1))
