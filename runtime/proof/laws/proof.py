"""The laws of a bundle's pictures held against what it states of them."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any, Final, cast

from camkit.bundle.facts import StatedLaw
from camkit.bundle.manifest import LIGHT_VERSION, Manifest
from camkit.bundle.reader import Bundle
from camkit.errors import ParityError
from camkit.progress import counted
from camkit.runtime.kind import part_of
from camkit.runtime.proof.laws.law import Law, Laws

SLACK: Final = 1.1
"""On another processor a broken law may be broken by so many times what is stated."""


class BrokenLawsError(ParityError):
    """Laws that a bundle breaks and does not state as broken.

    Attributes:
        facts: Every law, as JSON.
    """

    def __init__(self, message: str, facts: Sequence[Mapping[str, Any]]) -> None:
        super().__init__(message)
        self.facts = facts


MeasuredLaws = Mapping[str | None, tuple[Law, ...]] | str
"""Size -> laws, None for a bundle without networks; or why none can be held."""


def measure_laws(bundle: Bundle, *, threads: int = 1) -> MeasuredLaws:
    """Measure the laws for every size of a bundle."""
    module = import_module(part_of(bundle.manifest).laws)
    laws = cast("Laws", module.LAWS)
    laws_by_size: dict[str | None, tuple[Law, ...]] = {}
    for size in counted(bundle.manifest.sizes or (None,), "measuring laws", "sizes"):
        measured = laws(bundle, size, threads)
        if isinstance(measured, str):
            return measured
        laws_by_size[size] = measured
    return laws_by_size


def with_laws(manifest: Manifest, measured: MeasuredLaws) -> Manifest:
    """Return a manifest that states laws; as it is where none can be held."""
    if isinstance(measured, str):
        return manifest
    entries = {
        size: {law.name: law.to_stated() for law in laws}
        for size, laws in measured.items()
        if size is not None
    }
    version = max(manifest.version_pair, LIGHT_VERSION)
    return manifest.model_copy(
        update={"laws": entries, "format_version": ".".join(map(str, version))}
    )


def prove_laws(
    bundle: Bundle, *, threads: int
) -> tuple[bool, str] | tuple[bool, str, Sequence[Mapping[str, Any]]]:
    """Measure the laws of pictures, and compare with what the bundle states.

    Raises:
        BrokenLawsError: If a law is broken that the bundle does not state as broken so far.
    """
    measured = measure_laws(bundle, threads=threads)
    if isinstance(measured, str):
        return False, measured
    facts, unstated, lines = [], [], []
    for size, laws in measured.items():
        entries = (bundle.manifest.laws or {}).get(size or "", {})
        facts += [{"size": size} | law.to_json() for law in laws]
        unstated += [f"{size}: {law.describe()}" for law in laws if not _is_stated(law, entries)]
        lines.append("".join([f"{size}: " if size else "", ", ".join(map(_line, laws))]))
    if unstated:
        raise BrokenLawsError("; ".join(unstated), facts)
    return True, "; ".join(lines), facts


def _is_stated(law: Law, entries: Mapping[str, StatedLaw]) -> bool:
    """Return whether a law is kept, or broken no further than is stated."""
    if law.is_kept:
        return True
    entry = entries.get(law.name)
    return entry is not None and not entry.kept and law.worst <= SLACK * entry.worst


def _line(law: Law) -> str:
    return law.describe().replace("BROKEN", "broken as stated")
