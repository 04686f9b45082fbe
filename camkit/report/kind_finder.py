"""Parts of kinds of cameras, found without knowing any."""

from typing import TypeVar

from camkit.bundle.manifest import Manifest
from camkit.errors import ContractError
from camkit.kinds import find_kind

_T = TypeVar("_T")


def find_part(kind: str, tool: str, expected: type[_T]) -> _T:
    """Return what one tool asks of a kind: a field of the `ReportPart` called PART of its module.

    A kind without such a module takes photographs as any: its part is the plain one.

    Args:
        kind: Name of the kind.
        tool: Name of the field.
        expected: Type of the field.

    Raises:
        UnsupportedError: If there is no such kind.
        ContractError: If its module defines no such part.
    """
    entry = find_kind(kind)
    if not entry.has_part("report"):
        return expected()
    module = entry.part("report")
    part = getattr(getattr(module, "PART", None), tool, None)
    if not isinstance(part, expected):
        raise ContractError(
            f"{module.__name__} must define PART as a ReportPart with a {expected.__name__}"
        )
    return part


def check_photographs(manifest: Manifest, instead: str) -> None:
    """Refuse a bundle that only takes captures that are there.

    Args:
        manifest: Of the bundle.
        instead: What to do with it, for the message.

    Raises:
        ContractError: If it states no optics.
    """
    if not manifest.has_kernels:
        optics = "no optics" if manifest.optics is None else "a lens profile without kernels"
        raise ContractError(
            f"{manifest.name} states {optics}, so nothing can be photographed with it; {instead}"
        )


def camera_of(manifest: Manifest) -> tuple[object, ...]:
    """Return what two bundles of one camera have in common."""
    return manifest.kind, manifest.sensor
