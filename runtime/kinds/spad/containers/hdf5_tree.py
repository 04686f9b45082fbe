"""Content of an HDF5 file, found without following links and without reading any of it.

A file of some kilobytes may announce arrays, texts and packed pieces of any size, groups without an
end, and groups that hold themselves; so depth and number are bounded here, and everything is
measured in bytes before it is read.
"""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import h5py

from camkit.errors import DecodeError, UnsupportedError

MOST_DEPTH: Final = 32
MOST_ITEMS: Final = 100_000
SMALL_BYTES: Final = 1_000_000
"""Of a value that states something of times."""
HEAP_BYTES: Final = 64_000_000
"""Of a file, beside its data sets, where text of any length is read from it."""
REFERENCES: Final = "#refs#"
"""Place in which MATLAB keeps the cells; whoever refers to them finds them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tree:
    """Content of a file.

    Attributes:
        sets: Data sets by name.
        links: Names that lead elsewhere -> where.
        items: The file itself, groups and data sets.
        spare_bytes: Of the file beside its data sets.
    """

    sets: Mapping[str, Any]
    links: Mapping[str, str]
    items: tuple[Any, ...]
    spare_bytes: int


def tree_of(path: Path, file: Any) -> Tree:
    """Find the data sets of an open file; each object once, by its first name.

    Raises:
        DecodeError: If groups are nested too deep, or there are too many.
    """
    sets: dict[str, Any] = {}
    links: dict[str, str] = {}
    items = [file]
    addresses = {_address(file)}
    waiting = [("", file, 0)]
    while waiting:
        prefix, group, depth = waiting.pop()
        if depth > MOST_DEPTH:
            raise DecodeError(f"{path.name} nests groups more than {MOST_DEPTH} deep")
        for name in group:
            where = f"{prefix}{name}"
            if where == REFERENCES:
                continue
            if (target := _target(group, name)) is not None:
                links[where] = target
                continue
            item = group[name]
            if _address(item) in addresses:
                continue
            addresses.add(_address(item))
            items.append(item)
            if len(items) > MOST_ITEMS:
                raise DecodeError(f"{path.name} holds more than {MOST_ITEMS} groups and data sets")
            if isinstance(item, h5py.Group):
                waiting.append((f"{where}/", item, depth + 1))
            elif isinstance(item, h5py.Dataset) and type_of(item) is not None:
                sets[where] = item
    stored = sum(item.id.get_storage_size() for item in sets.values())
    spare = path.stat().st_size - stored
    return Tree(sets=sets, links=links, items=tuple(items), spare_bytes=max(spare, 0))


def type_of(item: Any) -> Any:
    """Return the type of a data set or attribute as numpy has it; None for what numpy has not."""
    try:
        return item.dtype
    except (TypeError, ValueError):
        return None


def small_attributes(tree: Tree, item: Any, names: Iterable[str]) -> dict[str, Any]:
    """Return the small attributes of an item that have one of some names."""
    values: dict[str, Any] = {}
    for name in names:
        if name in item.attrs and is_small(item.attrs.get_id(name), tree):
            values[name] = item.attrs[name]
    return values


def is_small(item: Any, tree: Tree) -> bool:
    """Return whether a data set or attribute may be read whole: plain, and small in bytes."""
    dtype = type_of(item)
    shape = item.shape
    if dtype is None or shape is None:
        return False
    count = math.prod(shape)
    text = h5py.check_string_dtype(dtype)
    if text is not None and text.length is None:  # as long as the file's own heap at most
        return count == 1 and tree.spare_bytes <= HEAP_BYTES
    is_plain = dtype.kind in "biufSU" and dtype.itemsize > 0
    return is_plain and count * dtype.itemsize <= SMALL_BYTES and piece_bytes(item) <= SMALL_BYTES


def piece_bytes(item: Any) -> int:
    """Return what is unpacked at once of a data set, in bytes; 0 where nothing is packed."""
    chunks = getattr(item, "chunks", None)
    return 0 if chunks is None else math.prod(chunks) * item.dtype.itemsize


def check_readable(path: Path, name: str, item: Any) -> None:
    """Refuse a data set that lies elsewhere, or is packed in a way that is not known here.

    Raises:
        DecodeError: If it lies in other files.
        UnsupportedError: If it is packed by a filter that HDF5 does not have here.
    """
    if item.is_virtual or item.external:
        raise DecodeError(f"{path.name}: {name} lies in other files; store it in one")
    packed = item.id.get_create_plist()
    for number in range(packed.get_nfilters()):
        code, _, _, filter_name = packed.get_filter(number)
        if not h5py.h5z.filter_avail(code):
            label = filter_name.decode("utf-8", "replace") or "without a name"
            raise UnsupportedError(
                f"{path.name}: {name} is packed by the HDF5 filter {code} ({label}), which is not "
                "installed; pack it anew with h5repack -f GZIP=4"
            )


def links_told(tree: Tree, names: Collection[str] | None) -> list[str]:
    """Return what to say of links, of those with some names; None for all."""
    return [
        f"{name} is a link to {target}, and links are not followed"
        for name, target in sorted(tree.links.items())
        if names is None or name in names or name.rsplit("/", 1)[-1] in names
    ]


def _target(group: Any, name: str) -> str | None:
    """Return where a link leads; None for what lies here itself."""
    link = group.get(name, getlink=True)
    if isinstance(link, h5py.ExternalLink):
        return f"{link.path} in {link.filename}"
    return link.path if isinstance(link, h5py.SoftLink) else None


def _address(item: Any) -> tuple[int, int]:
    info = h5py.h5o.get_info(item.id)
    return int(info.fileno), int(info.addr)
