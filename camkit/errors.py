"""The errors of camkit, one tree.

    CamkitError
    |-- ContractError (also ValueError)   the caller broke a promise: shape, range, option
    |   `-- MemoryCapError                the memory cap is too small for this capture
    |-- DecodeError                       a capture or picture cannot be read
    |-- BundleError                       a bundle was refused
    |-- UnsupportedError                  understood, but not offered here
    |-- WorkerError                       a worker process ended, and so did its substitute
    `-- ParityError                       two computations that must agree do not

A message says what was expected, what came, and what to do.
"""

from typing import Final

_MOST_CHARACTERS: Final = 1000
_LAST_CHARACTERS: Final = 300


class CamkitError(Exception):
    """Every error that camkit raises on purpose; its text is one printable line."""

    def __str__(self) -> str:
        return one_line(super().__str__())


def one_line(text: str) -> str:
    """Return a text as one printable line of bounded length, whatever files put into it."""
    line = " ".join(text.split())
    printable = "".join(letter if letter.isprintable() else "?" for letter in line)
    if len(printable) <= _MOST_CHARACTERS:
        return printable
    # the reason stands behind a long name
    return (
        printable[: _MOST_CHARACTERS - _LAST_CHARACTERS - 3] + "..." + printable[-_LAST_CHARACTERS:]
    )


def unexpected(error: Exception) -> str:
    """Return one line about an error that nobody foresaw."""
    reason = one_line(str(error))
    return (
        f"unexpected {type(error).__name__}{': ' if reason else ''}{reason}; please report it with "
        "the file, --debug shows where"
    )


class ContractError(CamkitError, ValueError):
    """An argument breaks the stated contract (shape, range, unknown option)."""


class MemoryCapError(ContractError):
    """The memory cap is too small for a capture: raise `max_mem_bytes`.

    Attributes:
        need_bytes: A cap that is enough; 0 where that is not known.
    """

    def __init__(self, text: str = "", need_bytes: int = 0) -> None:
        super().__init__(text)
        self.need_bytes = need_bytes


class DecodeError(CamkitError):
    """A capture or picture file cannot be decoded, or its content is not believable."""


class BundleError(CamkitError):
    """A bundle was refused: damaged, hostile, too new, or contradicting itself."""


class UnsupportedError(CamkitError):
    """The request is understood but not offered here (missing extra, unknown variant)."""


class WorkerError(CamkitError):
    """A worker process of a pool failed: it ended, and so did the one that tried once more.

    The system may lack memory, or a library may crash over the capture. Also raised if a process
    runs out of memory by itself, or over a fault of camkit.
    """


class ParityError(CamkitError):
    """Two computations that must agree (torch and ONNX, tiled and whole) do not."""
