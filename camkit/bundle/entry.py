"""The base class of every part of the manifest."""

from typing import Annotated, Any

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


class Entry(BaseModel):
    """A part of the manifest: unknown fields, NaN and inf are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
