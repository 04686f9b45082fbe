"""The result of one capture, of whatever kind: products by name, and the writer of each file."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.caller import option_text
from camkit.errors import ContractError

Write = Callable[[Path], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """The result of one capture.

    Attributes:
        arrays: The products by name. The `image` of a photograph is (3, h, w) float32, linear, in
            the colour space asked for (Rec.709 by default), in sensor orientation; h and w are
            those of the capture unless the camera makes it finer. Empty where bands went to a
            callback.
        shape: (c, h, w) of the main product.
        orientation: EXIF orientation (1..8) that a viewer should apply.
        writers: Suffix with its dot -> who writes that file, the main one first; none for
            photographs, whose files are written band by band.
        pictures: Format as options name it -> suffix and who writes that file.
        record: What was done, plain JSON values; `plan` of the sidecar.
        seconds: Seconds per stage.
        warnings: What the user should know.
        sections: What stages found of the capture, by the names of the sidecar: `hdr`, `glare`.
    """

    arrays: Mapping[str, NDArray[Any]] = field(default_factory=dict, repr=False)
    shape: tuple[int, ...] = ()
    orientation: int = 1
    writers: Mapping[str, Write] = field(default_factory=dict)
    pictures: Mapping[str, tuple[str, Write]] = field(default_factory=dict)
    record: Mapping[str, Any]
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    sections: Mapping[str, Any] = field(default_factory=dict)

    @property
    def image(self) -> FloatArray:
        """Return the picture: (3, h, w) float32, linear, see `arrays`.

        Raises:
            ContractError: If the capture became something else.
        """
        if IMAGE not in self.arrays:
            raise ContractError(
                f"this capture gives {', '.join(self.arrays) or 'no arrays'}, not an image; `run` "
                "returns them, in `arrays` of its result"
            )
        return self.arrays[IMAGE]

    def files(self, format_: str | None) -> dict[str, Write]:
        """Return who writes each file, by suffix, the main one first.

        Raises:
            ContractError: If this product has no picture of that format.
        """
        writers = dict(self.writers)
        if format_ is not None:
            if format_ not in self.pictures:
                names = ", ".join(sorted(self.pictures)) or "none"
                raise ContractError(
                    f"this product has no picture as {format_}; {option_text('format')} may be: "
                    f"{names}"
                )
            suffix, write = self.pictures[format_]
            writers[suffix] = write
        return writers
