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
    stated_choice = {} if key is None else _read(key, numbers, summed)
    choice = {name: stated_choice.get(name, ALL - 1) for name in numbers}
    for name, places in numbers.items():
        if name not in stated_choice and len(places) == 1:
            choice[name] = places[0]
    is_known = stated_choice.keys() <= numbers.keys() and all(
        choice[name] in places or (choice[name] == ALL and name == summed)
        for name, places in numbers.items()
    )
    if not is_known:
        several = {name: places for name, places in numbers.items() if len(places) > 1} or numbers
        listed = "; ".join(_listed(n, k, is_summed=n == summed) for n, k in several.items())
        rejection = "" if key is None else f", and no {key!r}"
        first = ", ".join(f"{name} {places[0]}" for name, places in several.items())
        raise ContractError(
            f"{path.name} holds {listed}{rejection}; choose one in the file of "
            f'{option_text("timing")}: under [array] the line key = "{first}"'
        )
    return {
        name: ALL if choice[name] == ALL else list(places).index(choice[name])
        for name, places in numbers.items()
    }


def _read(key: str, names: Mapping[str, Sequence[int]], summed: str | None) -> dict[str, int]:
    """Return what a key states; what states no place is a name that no axis has."""
    choice: dict[str, int] = {}
    for part in (part.strip() for part in key.split(",")):
        name, _, number = part.rpartition(" ")
        if summed is not None and part == f"all {summed}s":
            choice[summed] = ALL
        elif name in names and number.isascii() and number.isdigit() and len(number) < 10:
            choice[name] = int(number)
        else:
            choice[f"{part}?"] = ALL
    return choice


def _listed(name: str, places: Sequence[int], *, is_summed: bool) -> str:
    """Return the names of all places; of many the first and the last."""
    names = [f"{name} {number}" for number in places]
    if len(names) > MOST_LISTED:
        names = [f"{names[0]} to {names[-1]}"]
    return ", ".join(names + [f"all {name}s"] * (is_summed and len(places) > 1))
