"""Axes of an array: which are time, rows and columns, and the place to take on any further axis.

Written as a caller states them, in the order of the array: letters t, y and x, and for any other
axis a letter of its own with the place to take. "tc0yx" is time, place 0 of c, rows, columns.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from camkit.caller import option_text
from camkit.errors import ContractError

_ONE: Final = re.compile(r"([a-z])(\d{0,9})")
_WHOLE: Final = re.compile(rf"(?:{_ONE.pattern})+")
LETTERS: Final = ("txy", "xy")
"""Letters that an array must have, sorted."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """The axes of an array.

    Attributes:
        letters: One for each axis, in its order.
        places: What is taken of each; None for all of it.
    """

    letters: tuple[str, ...]
    places: tuple[int | None, ...]

    @classmethod
    def read(cls, text: str) -> Self | None:
        """Return what a text states; None if it states no axes."""
        if _WHOLE.fullmatch(text) is None:
            return None
        parts = _ONE.findall(text)
        return cls(
            letters=tuple(letter for letter, _ in parts),
            places=tuple(int(place) if place else None for _, place in parts),
        )

    @property
    def remaining(self) -> str:
        """Return the letters of what is left."""
        pairs = zip(self.letters, self.places, strict=True)
        return "".join(letter for letter, place in pairs if place is None)

    @property
    def text(self) -> str:
        """Return the axes as a caller states them."""
        pairs = zip(self.letters, self.places, strict=True)
        return "".join(letter + ("" if place is None else str(place)) for letter, place in pairs)

    def backwards(self) -> "Axes":
        """Return the axes of the array that counts them from the other end."""
        return Axes(letters=self.letters[::-1], places=self.places[::-1])

    def fits(self, shape: Sequence[int]) -> bool:
        """Return whether an array may have these axes."""
        if len(self.letters) != len(shape) or "".join(sorted(self.remaining)) not in LETTERS:
            return False
        pairs = zip(self.letters, self.places, shape, strict=True)
        return all(place is None or (n not in "tyx" and place < side) for n, place, side in pairs)

    def at_rows(self, top: int, bottom: int) -> tuple[slice | int, ...]:
        """Return the index of some rows."""
        pairs = zip(self.letters, self.places, strict=True)
        return tuple(
            place if place is not None else slice(top, bottom) if letter == "y" else slice(None)
            for letter, place in pairs
        )


def backwards(text: str) -> str:
    """Return stated axes from the other end; what states none as it is."""
    axes = Axes.read(text)
    return text if axes is None else axes.backwards().text


def axes_of(path: Path, shape: Sequence[int], stated_axes: str | None, usual: str | None) -> Axes:
    """Return the axes of an array.

    Args:
        path: The file, for errors.
        shape: Of the array.
        stated_axes: What the caller says.
        usual: What such arrays have; None where that cannot be known.

    Raises:
        ContractError: If axes are stated that cannot be, or none are known.
    """
    shape = tuple(shape)
    if stated_axes is None and len(shape) > len("tyx"):
        example = "abcdefg"[: len(shape) - len("tyx")]
        raise ContractError(
            f"{path.name} holds an array of {shape}; expected time, rows and columns: name its "
            f"axes and the place to take of each further one, [array] axes = "
            f'"{"".join(letter + "0" for letter in example)}tyx" or what it is, in a file for '
            f"{option_text('timing')}"
        )
    text = usual if stated_axes is None else stated_axes
    if text is None:
        raise ContractError(
            f"{path.name} holds an array of {shape}: nothing says which axis is time; state "
            f'[array] axes = "yxt", "tyx" or what it is, in a file for {option_text("timing")}'
        )
    axes = Axes.read(text)
    if axes is None or not axes.fits(shape):
        raise ContractError(
            f'[array] axes = "{text}" does not fit {path.name}, an array of {shape}: expected each '
            f"of the letters {'t, y, x' if len(shape) > 2 else 'y, x'} once, in its order"
            + (
                ', and for any other axis a letter with a place, such as "c0"'
                if _more(shape)
                else ""
            )
        )
    return axes


def _more(shape: Sequence[int]) -> bool:
    return len(shape) > len("yx")
