"""The files that captures of a kind become, and what of them lies in memory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from camkit.arrays import FloatArray
from camkit.runtime.capture_result import Result
from camkit.runtime.job.reconstruction import Reconstruction
from camkit.runtime.options import Options
from camkit.runtime.write_options import WriteOptions


@dataclass(frozen=True, slots=True, kw_only=True)
class FileSet:
    """The files of one capture.

    Attributes:
        suffixes: With their dots; the main file comes first.
        write: Writes them under other names, in this order; gives the seconds of writing.
        result: What became of the capture, once they are written; without arrays where no array
            held it.
    """

    suffixes: tuple[str, ...]
    write: Callable[[Sequence[Path]], float]
    result: Callable[[], Result]


def _no_bytes(*_: object) -> int:
    return 0


def _nothing(*_: object) -> Mapping[str, Any]:
    return {}


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """The files and results of the captures of a kind.

    Attributes:
        names: (capture's file, options, how it is written) -> names of all files that may appear,
            the main one first; refuses what cannot be written so.
        files: (capture on its way, how it is written) -> its files.
        finish: (capture on its way, names of products or None, array to fill or None) -> what
            becomes of it in memory.
        format: How it is written -> the format that decides the bytes.
        reserved_bytes: (capture, how it is written) -> memory that its files take while they are
            written.
        identity: (options, capture's file) -> what decides the products beyond these two, such as
            the content of a file that the options name; plain JSON values.
        facts: (capture on its way, how it is written) -> what the sidecar says of the capture.
        summary: Capture on its way, whose rows are all out -> its result without arrays; None where
            products are whole things that cannot be handed on in bands of rows.
    """

    names: Callable[[Path, Options, WriteOptions], tuple[str, ...]]
    files: Callable[[Reconstruction, WriteOptions], FileSet]
    finish: Callable[[Reconstruction, Sequence[str] | None, FloatArray | None], Result]
    format: Callable[[WriteOptions], str | None]
    reserved_bytes: Callable[[Any, WriteOptions], int] = _no_bytes
    identity: Callable[[Options, Path], Mapping[str, Any]] = _nothing
    facts: Callable[[Reconstruction, WriteOptions], Mapping[str, Any]] = _nothing
    summary: Callable[[Reconstruction], Result] | None = None
