"""The page docs/reference/recipes.md: every key of a design recipe, and what `lens optimize` frees.

Keys, types and defaults are those of the dataclasses that `design_recipe.TABLES` names; meanings
are the docstrings of their attributes. To change the page, change those.
"""

import inspect
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, fields
from types import UnionType
from typing import Any, Final, Literal, get_args, get_origin, get_type_hints

from camkit.models_def.design.design_recipe import (
    REPEATED,
    REQUIRED,
    STATE_KEY,
    TABLES,
    DesignRecipe,
)
from camkit.models_def.networks.catalog import NETWORK_NAMES
from camkit.models_def.optics.analysis.psf_model import PSF_REGIMES
from camkit.models_def.optics.configuration.configuration_table import ConfigurationTable
from camkit.models_def.optics.search.improvement import RANGES
from camkit.models_def.optics.search.joint_states import JointVariable
from camkit.models_def.optics.search.variables import KINDS, PARAMETERS
from camkit.models_def.toml_table import TYPE_NAMES, key_line
from tools.reference.command_page import table

UNITS: Final = {
    "_per_mm": "1/mm",
    "_mm": "mm",
    "_um": "µm",
    "_deg": "degrees",
    "_rad": "rad",
    "_px": "pixels",
}
"""By the end of a key; the first that fits counts."""
CHOICES: Final[Mapping[str, Sequence[str]]] = {
    "network.name": NETWORK_NAMES,
    "optics.psf_model": PSF_REGIMES,
}
"""Texts that are checked against a list; literal types name theirs."""
HEADER: Final = ("key", "value", "unit", "default", "meaning")
EXAMPLE: Final = """\
name = "my-triplet"
prescription = "cooke-triplet"
vary = [
    { kind = "curvature", surface = 0, low = 0.02, high = 0.07 },
    { kind = "thickness", surface = 1, low = 3.0, high = 9.0 },
]

[optics]
half_field_deg = 12.0
efl_mm = 50.0

[pixels]
pitch_um = 6.0
"""
INTRODUCTION: Final = f"""\
<!-- Written by `python -m tools.reference` from the code that reads recipes. -->

# Design recipes

This page lists every key of a recipe for `camkit design`, and the numbers that `camkit lens \
optimize` frees. How to choose them: see [design](../guides/design.md).

The least that a recipe needs:

```toml
{EXAMPLE}```

Other tables and keys have defaults. An unknown key, a missing one or a wrong type is an error \
that names it. Surfaces are counted from 0. The recipes in `models_def/recipes` whose names end \
in `_lens` or `_joint` are complete.
"""
RANGE_TEXT: Final = """\
`camkit lens optimize` takes what is free from `--vary`, for all refracting surfaces, or from \
`vary = ["curvature", "conic"]` of each `[[surface]]` in the lens file. Each number moves within \
a range about its value. To go further, optimize the result again. With `--configurations` the \
focal length of each state is kept by the merit, and the last gap takes the place of `defocus`: \
in each state if states differ in it.
"""
STATE_TEXT: Final = """\
Keys of `[[configuration]]` in a lens file (`.toml`), for zoom lenses and moving groups: see \
[lens files](../guides/lens-files.md#configurations). `default_configuration`, before the tables, \
names the state that is taken where none is named; without it the first one is.
"""


def recipe_page() -> str:
    """Return the page: the tables of a recipe in order, ranges, configurations."""
    parts = [INTRODUCTION, "## Top of the file\n", *_top(), *_tables()]
    parts += ["## Ranges of lens optimize\n", RANGE_TEXT, _ranges()]
    states = f"{' '.join(_summary(ConfigurationTable))}\n"
    parts += ["## Configurations of a lens\n", STATE_TEXT, states, _keys("", ConfigurationTable)]
    return "\n".join(parts)


def _top() -> Iterator[str]:
    meanings = attribute_texts(DesignRecipe)
    rows = [(f"`{key}`", "text", "", "required", meanings[key]) for key in ("name", "prescription")]
    yield table(HEADER, rows)
    tables = [
        (f"[{_title(key)}](#{key})", "required" if key in REQUIRED else "", _summary(kind)[0])
        for key, kind in TABLES.items()
    ]
    yield table(("table", "", "purpose"), tables)


def _tables() -> Iterator[str]:
    for key, kind in TABLES.items():
        yield f"## {_title(key)}\n"
        yield "\n\n".join(_summary(kind)) + "\n"
        more = []
        if key == "vary":
            meaning = attribute_texts(JointVariable)["state"]
            more = [(f"`{STATE_KEY}`", "text", "", '`""`', meaning)]
        yield _keys(key, kind, more)
        if key == "vary":
            yield table(("kind", "unit", "free number"), [(f"`{k}`", *v) for k, v in KINDS.items()])


def _ranges() -> str:
    rows = [(f"`{kind}`", *KINDS[kind], RANGES[kind]) for kind in PARAMETERS]
    return table(("name", "unit", "free number", "range"), rows)


def _title(key: str) -> str:
    return f"`[[{key}]]`" if key in REPEATED else f"`[{key}]`"


def _keys(name: str, kind: type, more: Sequence[Sequence[str]] = ()) -> str:
    """Return the table of the keys that a dataclass is read from."""
    hints, meanings = get_type_hints(kind), attribute_texts(kind)
    rows = [
        (
            f"`{one.name}`",
            _value(hints[one.name], CHOICES.get(f"{name}.{one.name}", ())),
            next((unit for end, unit in UNITS.items() if one.name.endswith(end)), ""),
            _default(one),
            meanings[one.name],
        )
        for one in fields(kind)
    ]
    return table(HEADER, [*rows, *more])


def _summary(kind: type) -> list[str]:
    """Return the paragraphs of a docstring that stand before its attributes."""
    lead = (inspect.getdoc(kind) or "").partition("Attributes:")[0]
    return [" ".join(text.split()) for text in lead.strip().split("\n\n")]


def attribute_texts(kind: type) -> dict[str, str]:
    """Return the texts of the attributes of a docstring by their names."""
    block = (inspect.getdoc(kind) or "").partition("Attributes:\n")[2].partition("\n\n")[0]
    texts = re.findall(r"^    (\w+): (.*(?:\n {8,}.*)*)", block, re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in texts}


def _value(hint: Any, choices: Sequence[str]) -> str:
    """Return what a key takes, in words."""
    if isinstance(hint, UnionType):
        (hint,) = (one for one in get_args(hint) if one is not type(None))
    if get_origin(hint) is Literal:
        choices = get_args(hint)
    if choices:
        return ", ".join(f"`{choice}`" for choice in choices)
    if get_origin(hint) is tuple:
        inner = _value(get_args(hint)[0], ())
        return f"list of {inner.replace('list ', 'lists ') if 'list' in inner else f'{inner}s'}"
    return TYPE_NAMES[get_origin(hint) or hint].removeprefix("a ")


def _default(one: "Field[Any]") -> str:
    if one.default_factory is not MISSING:
        return "`{}`"
    if one.default is MISSING:
        return "required"
    if one.default is None:
        return ""
    return f"`{key_line('', one.default).removeprefix(' = ')}`"
