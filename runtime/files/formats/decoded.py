"""Result of every decoder of pictures."""

from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from camkit.picture_window import PictureWindow
from camkit.runtime.files.formats.color_space import ColorSpace


@dataclass(frozen=True, slots=True, kw_only=True)
class Decoded:
    """A decoded file, its samples neither turned nor brought to light.

    Attributes:
        samples: (h, w) grey or (3, h, w) R, G, B; uint8, uint16 or float32.
        top: The code of white; 0 for floats.
        space: What the file states of its colours; None where it states nothing, or what cannot be
            honoured.
        doubt: What it states and cannot be honoured; empty otherwise.
        window: Where the samples lie in a larger picture; None where the format knows no such
            thing.
        notes: What a person should know.
    """

    samples: NDArray[Any]
    top: int
    space: ColorSpace | None = None
    doubt: str = ""
    window: PictureWindow | None = None
    notes: tuple[str, ...] = ()
