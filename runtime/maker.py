"""Products of captures that are no photographs, made whole and written together.

    file -> Maker.make -> Made: arrays by name, and who writes each file

A kind whose captures become products has a `Maker` in its part of the runtime; pictures by bands,
stages and their writers are for the kinds that have none.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.caller import option_list, option_text
from camkit.errors import ContractError
from camkit.kinds import Kind
from camkit.runtime.cancel import Cancel
from camkit.runtime.network.tiling import Progress
from camkit.runtime.options import Options, check_kind_options, given_options

Write = Callable[[Path], None]
GENERAL: Final = frozenset({"max_mem_bytes", "threads", "method"})
"""Options that mean something to every maker."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Making:
    """One capture to be made.

    Attributes:
        path: The capture.
        bundle: The camera; None makes what the capture alone gives.
        options: What the caller chose.
        threads: Threads to compute with.
        progress: Called with (work done, work in all).
        cancel: Asked between pieces of work; true raises `Cancelled`.
    """

    path: Path
    bundle: Bundle | None
    options: Options
    threads: int
    progress: Progress | None = None
    cancel: Cancel | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Made:
    """The products of one capture.

    Attributes:
        arrays: The products by name.
        writers: Suffix with its dot -> who writes that file; the main file comes first.
        pictures: --format -> suffix and who writes that file, where it was asked for.
        record: What was done, plain JSON values; `plan` of the sidecar.
        seconds: Seconds per stage.
        warnings: What the user should know.
        sections: What was found of the capture, by the names of the sidecar.
    """

    arrays: Mapping[str, NDArray[Any]]
    writers: Mapping[str, Write]
    pictures: Mapping[str, tuple[str, Write]] = field(default_factory=dict)
    record: Mapping[str, Any]
    seconds: dict[str, float]
    warnings: tuple[str, ...] = ()
    sections: Mapping[str, Any] = field(default_factory=dict)

    def files(self, format_: str | None) -> dict[str, Write]:
        """Return who writes each file, by suffix, the main one first.

        Raises:
            ContractError: If this product has no picture of that format.
        """
        found = dict(self.writers)
        if format_ is not None:
            if format_ not in self.pictures:
                offered = ", ".join(sorted(self.pictures)) or "none"
                raise ContractError(
                    f"this product has no picture as {format_}; {option_text('format')} may be: "
                    f"{offered}"
                )
            suffix, write = self.pictures[format_]
            found[suffix] = write
        return found


def _nameless(_: Path) -> None:
    return None


def _undescribed(_: Path) -> Mapping[str, Any]:
    return {}


def _stem(path: Path) -> str:
    return path.stem


@dataclass(frozen=True, slots=True, kw_only=True)
class Maker:
    """The maker of products of a kind of camera.

    Attributes:
        make: A capture -> its products.
        plan: A capture -> what would be done, as plain JSON values, without doing it.
        suffix: Of the main file, with its dot.
        beside: Options -> suffixes of the files that may appear beside it.
        formats: What --format may say, each with its suffix.
        methods: What --method may say.
        identity: (options, capture's file) -> what decides the products beyond these two, such as
            the content of a file that the options name; plain JSON values.
        with_bundle: Names of the options that mean something with a bundle alone.
        named: A capture's file -> the bundle that it names; None if it names none.
        stem: A capture's file -> the name of its products, without suffix.
        describe: A capture's file -> what it is, as plain JSON values.
    """

    make: Callable[[Making], Made]
    plan: Callable[[Making], Mapping[str, Any]]
    suffix: str
    beside: Callable[[Options], tuple[str, ...]]
    formats: Mapping[str, str]
    methods: tuple[str, ...]
    identity: Callable[[Options, Path], Mapping[str, Any]]
    with_bundle: frozenset[str] = frozenset()
    named: Callable[[Path], str | None] = _nameless
    stem: Callable[[Path], str] = _stem
    describe: Callable[[Path], Mapping[str, Any]] = _undescribed

    def check(self, kind: Kind, bundle: Bundle | None, options: Options) -> None:
        """Refuse options before any work.

        Raises:
            ContractError: If one means nothing to this kind, or the method is none of it.
        """
        where = "without a bundle" if bundle is None else f"to bundle {bundle.manifest.name}"
        check_kind_options(options, kind, where)
        known = GENERAL | {option.name for option in kind.options}
        if bundle is not None:
            known |= self.with_bundle
        if foreign := [name for name in given_options(options) if name not in known]:
            raise ContractError(
                f"{option_list(foreign)} does not apply to captures of the kind "
                f"{kind.name}; leave it out"
            )
        if options.method is not None and options.method not in self.methods:
            raise ContractError(
                f"{option_text('method')} must be one of {', '.join(self.methods)} for captures of "
                f"the kind {kind.name}; got {options.method!r}"
            )

    def names(self, source: Path, options: Options, format_: str | None) -> tuple[str, ...]:
        """Return all files that may appear of a capture, the main one first.

        Raises:
            ContractError: If the format is none of this kind.
        """
        if format_ is not None and format_ not in self.formats:
            raise ContractError(
                f"{option_text('format')} must be one of {', '.join(sorted(self.formats))} for "
                f"such captures; got {format_}"
            )
        picture = () if format_ is None else (self.formats[format_],)
        stem = self.stem(source)
        return tuple(stem + end for end in (self.suffix, *self.beside(options), *picture))
