"""Docstrings of the public Python face state shape and unit of every array that crosses it."""

import dataclasses
import importlib
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import camkit

DOCS = Path(__file__).resolve().parents[2] / "docs"
SHELVES = ("start", "guides", "reference")
IMPORTED = re.compile(r"from (camkit(?:\.\w+)*) import (?:\(([^)]*)\)|([\w, ]+))")
SHOWN = re.compile(r"^::: (camkit[\w.]*)\.(\w+)$", re.MULTILINE)
ARRAY = re.compile(r"ndarray|NDArray|torch\.Tensor|\bTensor\b")
SHAPE = re.compile(r"\((?:[a-z0-9_. ]+,)+(?: ?[a-z0-9_. ]+)?\)|[Ss]hape of|one-dimensional")
UNIT = re.compile(
    r"\b(?:px|mm|um|m|cm|rad|deg|ps|s|DN|EV|dB|electrons|photons|counts|codes|cycles|linear|white|"
    r"sRGB|share|shares|relative|weights?|sums? to 1|factors?|indices|boolean|coordinates|true|"
    r"True|number|numbers|no unit)\b|[0-9]\.0|0 to 1"
)


def _objects() -> dict[str, Any]:
    """Return the face, what its reference shows, and what the manuals import from camkit."""
    names = _shown()
    for shelf in SHELVES:
        for page in (DOCS / shelf).rglob("*.md"):
            for home, several, one in IMPORTED.findall(page.read_text(encoding="utf-8")):
                names |= {(home, name) for name in re.findall(r"\w+", several or one)}
    objects = _exported("camkit", camkit.__all__)
    for home, name in sorted(names):
        objects |= _exported(home, [name])
    return objects


def _functions(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield a function, or the public methods of a class."""
    if inspect.isclass(value):
        for part, method in vars(value).items():
            inner = method.fget if isinstance(method, property) else method
            inner = getattr(inner, "__func__", inner)
            if inspect.isfunction(inner) and not part.startswith("_"):
                yield f"{name}.{part}", inner
    elif inspect.isfunction(value):
        yield name, value


def _faults(name: str, text: str, section: str, entry: str | None) -> Iterator[str]:
    """Yield what a docstring leaves open about one array."""
    body = re.search(rf"^{section}:\n((?: +.*\n|\n)+)", text + "\n", re.MULTILINE)
    words = "" if body is None else inspect.cleandoc(body[1])
    if entry is not None:
        found = re.search(rf"^\*{{0,2}}{entry}: ((?:.*\n)(?: +.*\n?)*)", words + "\n", re.MULTILINE)
        words = "" if found is None else found[1]
    elif not words:
        words = text.partition("\n\n")[0]
    if not SHAPE.search(words):
        yield f"{name}: {section} {entry or ''} states no shape"
    if not UNIT.search(words):
        yield f"{name}: {section} {entry or ''} states no unit"


def _exported(home: str, names: list[str]) -> dict[str, Any]:
    """Return what a package exports by its full name, its modules replaced by what they export."""
    objects: dict[str, Any] = {}
    for name in names:
        value = getattr(importlib.import_module(home), name, None)
        if inspect.ismodule(value):
            objects |= _exported(f"{home}.{name}", getattr(value, "__all__", []))
        elif value is not None and not name.startswith("_"):
            objects[f"{home}.{name}"] = value
    return objects


def _shown() -> set[tuple[str, str]]:
    """Return (module, name) of what the pages of the reference show."""
    pages = (DOCS / "reference" / "python").glob("*.md")
    return {pair for page in pages for pair in SHOWN.findall(page.read_text(encoding="utf-8"))}


def test_every_name_of_the_face_stands_in_the_reference() -> None:
    assert set(_exported("camkit", camkit.__all__)) <= {".".join(pair) for pair in _shown()}


def test_every_array_of_the_public_face_has_a_shape_and_a_unit() -> None:
    objects = _objects()
    assert len(objects) > 40
    faults: list[str] = []
    arrays = 0
    for name, value in objects.items():
        if dataclasses.is_dataclass(value):
            for field in dataclasses.fields(value):
                if ARRAY.search(str(field.type)) and not field.name.startswith("_"):
                    arrays += 1
                    faults += _faults(name, inspect.getdoc(value) or "", "Attributes", field.name)
        for path, function in _functions(name, value):
            text = inspect.getdoc(function) or ""
            signature = inspect.signature(function)
            for parameter in signature.parameters.values():
                if ARRAY.search(str(parameter.annotation)):
                    arrays += 1
                    faults += _faults(path, text, "Args", parameter.name)
            if ARRAY.search(str(signature.return_annotation)):
                arrays += 1
                section = "Yields" if "Iterator" in str(signature.return_annotation) else "Returns"
                faults += _faults(path, text, section, None)
    assert arrays > 20
    assert not faults, "\n".join(faults)


def test_an_array_without_shape_or_unit_is_named() -> None:
    text = "Return it.\n\nArgs:\n    light: (h, w), linear.\n    psf: The kernel.\n"
    assert not list(_faults("f", text, "Args", "light"))
    assert len(list(_faults("f", text, "Args", "psf"))) == 2
    assert len(list(_faults("f", text, "Returns", None))) == 2
