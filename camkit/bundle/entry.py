"""The base class of every part of the manifest."""

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Count = Annotated[int, Field(ge=0)]
Word = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
"""A name that the manifest itself defines: of a plane, a role, a product."""


def _sorted(mapping: dict[str, Any]) -> dict[str, Any]:
    return dict(sorted(mapping.items()))


Sorted = AfterValidator(_sorted)
"""Sorted by key, so that equal manifests are equal bytes whatever order they were filled in."""


@dataclass(frozen=True, slots=True)
class Since:
    """The format that brought something: an `Entry` as such, or a field that is not at its default.

    What came with format 2.4 or before needs none: no bundle is written in an older one.

    Attributes:
        version: (major, minor) of the format.
        what: A clause for people, as in "the optics have a haze".
    """

    version: tuple[int, int]
    what: str


class Entry(BaseModel):
    """A part of the manifest: unknown fields, NaN and inf are refused.

    Attributes:
        since: What a bundle with this part needs of a reader; None for what every reader knows.
            Fields that came later are annotated with theirs.
    """

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        allow_inf_nan=False,
        defer_build=True,  # a part is compiled where it is checked: most are within the manifest
    )
    since: ClassVar[Since | None] = None

    def needs(self) -> list[Since]:
        """Return what of this part readers of older formats do not know."""
        entry_marks = [] if self.since is None else [self.since]
        fields = [
            mark
            for name, field in type(self).model_fields.items()
            for mark in field.metadata
            if isinstance(mark, Since) and getattr(self, name) != field.default
        ]
        return entry_marks + fields
