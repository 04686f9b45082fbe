"""The language of the code: first words of docstrings, openings of modules, names, base names.

`language.toml` holds the words, and the folders in which a rule does not hold yet.
"""

import ast
import functools
import gc
import re
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[1]
SOURCES = ("camkit", "runtime", "models_def", "export", "tools")
LINKS = ("camkit/runtime", "camkit/export", "camkit/models_def")
TABLE = tomllib.loads(Path(__file__).with_name("language.toml").read_text(encoding="utf-8"))
LATER = TABLE["later"]
VERBS = set(TABLE["docstrings"]["verbs"].split())
HEADLESS = set(TABLE["docstrings"]["headless"].split())
METHODS = set(TABLE["names"]["methods"].split())
KEYS = {path: set(text.split()) for path, text in TABLE["names"]["keys"].items()}
PAIRS = {word: set(text.split()) for word, text in TABLE["names"]["pairs"].items()}
BANNED = {*TABLE["names"]["participles"].split(), *TABLE["names"]["prepositions"].split(), *PAIRS}
FLOORS: dict[str, list[str]] = TABLE["floors"]
FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)
DOCUMENTED = (ast.Module, ast.ClassDef, *FUNCTIONS)


class Fault(NamedTuple):
    """A place that breaks a rule."""

    path: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.path}:{self.line}: {self.text}"


class Name(NamedTuple):
    """A name that code defines."""

    text: str
    line: int
    is_method: bool = False

    @property
    def word(self) -> str:
        return self.text.strip("_").lower()


Rule = Callable[[str, ast.Module], Iterator[Fault]]


@functools.cache
def _trees() -> dict[str, ast.Module]:
    """Return the syntax tree of every module; the collector would take most of the time."""
    paths = [path for source in SOURCES for path in sorted((ROOT / source).rglob("*.py"))]
    names = {path.relative_to(ROOT).as_posix(): path for path in paths}
    gc.disable()
    try:
        return {
            name: ast.parse(path.read_text(encoding="utf-8"))
            for name, path in names.items()
            if not _lies_in(name, LINKS)
        }
    finally:
        gc.enable()


def _lies_in(path: str, folders: Sequence[str]) -> bool:
    return any(path == folder or path.startswith(f"{folder}/") for folder in folders)


def _is_property(node: ast.AST) -> bool:
    names = [ast.unparse(item).rpartition(".")[2] for item in getattr(node, "decorator_list", ())]
    return not {"property", "cached_property"}.isdisjoint(names)


def docstring_faults(path: str, tree: ast.Module) -> Iterator[Fault]:
    for node in ast.walk(tree):
        text = ast.get_docstring(node) if isinstance(node, DOCUMENTED) else None
        if text is None:
            continue
        word, line = re.match(r"[\w'-]*", text)[0], getattr(node, "lineno", 1)
        name = getattr(node, "name", "the module")
        if not isinstance(node, FUNCTIONS) or _is_property(node):
            if word in HEADLESS:
                yield Fault(path, line, f"{name} opens with {word!r}; name the thing")
        elif word not in VERBS:
            yield Fault(path, line, f"{name} opens with {word!r}, which is no verb of the list")
        elif word == "Return" and _returns_nothing(node) and not text.startswith("Return None"):
            yield Fault(path, line, f"{name} says Return and returns nothing")


def _returns_nothing(node: ast.FunctionDef) -> bool:
    return isinstance(node.returns, ast.Constant) and node.returns.value is None


def _names(statement: ast.stmt) -> Iterator[Name]:
    for node in ast.walk(statement):
        match node:
            case ast.Name():
                if isinstance(node.ctx, ast.Store):
                    yield Name(node.id, node.lineno)
            case ast.Attribute():
                if isinstance(node.ctx, ast.Store):
                    yield Name(node.attr, node.lineno)
            case ast.arg():
                yield Name(node.arg, node.lineno)
            case ast.ClassDef():
                yield Name(node.name, node.lineno)
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                first = next(iter(node.args.posonlyargs + node.args.args), None)
                is_method = first is not None and first.arg in {"self", "cls"}
                yield Name(node.name, node.lineno, is_method)
            case ast.ExceptHandler(name=str(text)):
                yield Name(text, node.lineno)


def name_faults(path: str, tree: ast.Module) -> Iterator[Fault]:
    """Counterparts of a pair are looked for in the function or class at the top of the module."""
    if Path(path).stem in BANNED:
        yield Fault(path, 1, "the name of the module does not say what it holds")
    banned = BANNED - KEYS.get(path, set())
    for statement in tree.body:
        names = list(_names(statement))
        words = {name.word for name in names}
        for name in names:
            is_pair = not PAIRS.get(name.word, set()).isdisjoint(words)
            is_phrase = name.is_method and name.word in METHODS
            if name.word in banned and not is_pair and not is_phrase:
                yield Fault(path, name.line, f"{name.text!r} does not say what the value is")


def base_name_faults(floor: str) -> Iterator[Fault]:
    homes = defaultdict(list)
    for path in _trees():
        home = next(name for name, folders in FLOORS.items() if _lies_in(path, folders))
        patterns = TABLE["found_by_name"]["patterns"]
        if home == floor and not any(re.search(pattern, path) for pattern in patterns):
            homes[Path(path).stem].append(path)
    for first, *others in homes.values():
        yield from (Fault(path, 1, f"has the base name of {first}") for path in others)


def _faults(rule: Rule, paths: Sequence[str]) -> list[Fault]:
    return [fault for path in paths for fault in rule(path, _trees()[path])]


def _held(table: str) -> list[str]:
    return [path for path in _trees() if not _lies_in(path, LATER[table])]


def _text(faults: Sequence[Fault]) -> str:
    return "\n".join(map(str, faults))


def test_docstrings_open_with_what_happens_and_modules_with_their_thing() -> None:
    faults = _faults(docstring_faults, _held("docstrings"))
    assert not faults, _text(faults)


def test_no_bare_participle_or_preposition_is_a_name() -> None:
    faults = _faults(name_faults, _held("names"))
    assert not faults, _text(faults)


@pytest.mark.parametrize("floor", [floor for floor in FLOORS if floor not in LATER["base_names"]])
def test_base_names_of_modules_are_unique_within_a_floor(floor: str) -> None:
    faults = list(base_name_faults(floor))
    assert not faults, _text(faults)


def test_a_folder_that_keeps_a_rule_has_left_its_table() -> None:
    for table, rule in (("docstrings", docstring_faults), ("names", name_faults)):
        for folder in LATER[table]:
            assert _faults(rule, [p for p in _trees() if _lies_in(p, [folder])]), (table, folder)
    for floor in LATER["base_names"]:
        assert list(base_name_faults(floor)), floor


@pytest.mark.parametrize(
    ("source", "rule"),
    [
        ('"""What is measured."""', docstring_faults),
        ('def f():\n    """Give it."""', docstring_faults),
        ('def f() -> None:\n    """Return it."""', docstring_faults),
        ('class A:\n    """How it runs."""', docstring_faults),
        ("def told(): ...", name_faults),
        ("def of(x): ...", name_faults),
        ("def f(_found): ...", name_faults),
        ("def f():\n    left = 3", name_faults),
        ("class A:\n    between: int", name_faults),
    ],
)
def test_each_rule_finds_its_fault(source: str, rule: Rule) -> None:
    assert len(list(rule("a.py", ast.parse(source)))) == 1


@pytest.mark.parametrize(
    "source",
    [
        '"""The measured facts."""\ndef f():\n    """Return it."""',
        'class A:\n    """A thing."""\n    @property\n    def b(self):\n        """The size."""',
        "def f(left, right): ...",
        "def f(found_px): ...",
        "class A:\n    def of(cls, x): ...",
    ],
)
def test_sound_code_has_no_fault(source: str) -> None:
    tree = ast.parse(source)
    assert not [*docstring_faults("a.py", tree), *name_faults("a.py", tree)]
