"""XML of lensfun's database, read so that no file can do harm.

Entities, document types of their own, depth and size are refused before anything is built of them.
"""

from pathlib import Path
from typing import Final
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from camkit.errors import ContractError, DecodeError
from camkit.side_file import read_side_bytes

MOST_BYTES: Final = 2**24
MOST_DEPTH: Final = 32
MOST_ELEMENTS: Final = 1_000_000
ROOT: Final = "lensdatabase"
_WHOLE: Final = True


def read_xml(path: Path) -> Element:
    """Read a file of the database.

    Raises:
        DecodeError: If it cannot be read, is too large, malformed, declares entities, or is no
            file of lensfun's.
    """
    try:
        data = read_side_bytes(path, "the lensfun database", most_bytes=MOST_BYTES)
    except ContractError as error:
        raise DecodeError(f"{error} (no database is larger than {MOST_BYTES} bytes)") from error
    root = parse_xml(data, str(path))
    if root.tag != ROOT:
        raise DecodeError(f"{path} is no lensfun database: expected <{ROOT}>, got <{root.tag}>")
    return root


def parse_xml(data: bytes, what: str) -> Element:
    """Parse bytes; see `read_xml`."""
    builder, limits = TreeBuilder(), _Limits(what)
    parser = expat.ParserCreate()

    def start(tag: str, attributes: dict[str, str]) -> None:
        limits.enter()
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        limits.leave()
        builder.end(tag)

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    parser.StartDoctypeDeclHandler = limits.document_type
    parser.EntityDeclHandler = limits.entity
    try:
        parser.Parse(data, _WHOLE)
        return builder.close()
    except (expat.ExpatError, AssertionError, LookupError, ValueError) as error:
        raise DecodeError(f"{what} is no sound XML: {error}") from error


class _Limits:
    """Limits of a file."""

    def __init__(self, what: str) -> None:
        self._what, self._depth, self._elements = what, 0, 0

    def enter(self) -> None:
        self._depth += 1
        self._elements += 1
        if self._depth > MOST_DEPTH or self._elements > MOST_ELEMENTS:
            raise DecodeError(f"{self._what}: elements are nested too deep or too many; refused")

    def leave(self) -> None:
        self._depth -= 1

    def document_type(self, _name: str, _system: object, _public: object, is_own: bool) -> None:
        if is_own:
            raise DecodeError(f"{self._what} declares a document type of its own; refused")

    def entity(self, *_: object) -> None:
        raise DecodeError(f"{self._what} declares entities; refused")
