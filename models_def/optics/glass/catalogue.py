"""Named sets of glasses, and finding one by name: exactly, or an error that names near matches.

A strict name is "material-catalogue" ("N-BK7-Schott") or "material-source" for the literature
("PMMA-Sultanova2009"). A bare trade name ("N-BK7") stands for the strict one as long as exactly
one catalogue has it; "F2", which Schott and Hikari make from different melts, is an error.
"""

import difflib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, lru_cache
from importlib import resources
from typing import Any, Final

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.glass.model_glass import parse_model_name

FORMER: Final = {"schott1983": "schott", "schottobsolete": "schott"}
"""Catalogues of glasses that a maker has no longer; people know one name for all of his."""
ALIASES: Final = {"nikon": "hikari", "nikon_hikari": "hikari", "nikon-hikari": "hikari"}
AIR: Final = Glass(name="air", formula="constant", coefficients=(1.0,), source="reference medium")
_NEAR: Final = 5
_LEAST_LIKENESS: Final = 0.6
"""Of a name that is suggested, 1 for the same letters."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GlassCatalogue:
    """A named set of glasses.

    Attributes:
        name: Of the maker, or of the file of a user's catalogue.
        glasses: Their strict names end in "-" and the name of the catalogue, except those of the
            literature, which end in their source.
        literature: Materials of many sources; other programs do not know their names.
    """

    name: str
    glasses: tuple[Glass, ...]
    literature: bool = False
    _by_name: Mapping[str, Glass] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        names = {glass.name: glass for glass in self.glasses}
        if len(names) != len(self.glasses):
            raise ContractError(f"catalogue {self.name} has two glasses of one name")
        object.__setattr__(self, "_by_name", names)

    def get(self, name: str) -> Glass | None:
        """Return the glass of exactly this strict name, or None."""
        return self._by_name.get(name)

    def with_trade_name(self, trade_name: str) -> tuple[Glass, ...]:
        """Return the glasses of this trade name: at most one but in the literature."""
        if not self.literature:
            glass = self.get(f"{trade_name}-{self.name}")
            return (glass,) if glass else ()
        return tuple(g for g in self.glasses if trade_name_of(g) == trade_name)


def trade_name_of(glass: Glass) -> str:
    """Return the name without catalogue or source."""
    return glass.name.rpartition("-")[0] or glass.name


@cache
def builtin_catalogues() -> tuple[GlassCatalogue, ...]:
    """Return the catalogues that come with camkit, Schott's first."""
    folder = resources.files("camkit.models_def.optics.glass") / "data"
    schott = ("schott", "schott1983", "schottobsolete")
    files = (*schott, "ohara", "hoya", "hikari", "cdgm", "misc", "literature")
    return tuple(
        _catalogue(json.loads((folder / f"{name}.json").read_text(encoding="utf-8")))
        for name in files
    )


def maker_of(catalogue: GlassCatalogue) -> str:
    """Return the name in small letters by which people and lens files ask for a catalogue."""
    name = catalogue.name.casefold()
    return FORMER.get(name, name)


def catalogues_of(maker: str) -> tuple[GlassCatalogue, ...]:
    """Return camkit's catalogues of a maker, today's first; none if it has none of that name."""
    name = ALIASES.get(maker.casefold(), maker.casefold())
    makers = (c for c in builtin_catalogues() if not c.literature)
    return tuple(c for c in makers if name in (maker_of(c), c.name.casefold()))


def preferred_catalogues(makers: str | None) -> tuple[GlassCatalogue, ...]:
    """Return the catalogues to be asked first, in their order.

    Args:
        makers: Names with commas between them, such as schott,hikari; None for none.

    Raises:
        ContractError: If camkit has no catalogue of a name.
    """
    preferred: list[GlassCatalogue] = []
    for maker in (makers or "").split(","):
        catalogues = catalogues_of(maker.strip())
        if not catalogues and makers is not None:
            names = {maker_of(c): None for c in builtin_catalogues() if not c.literature}
            raise ContractError(
                f"{option_text('catalogue')} names some of {', '.join(names)}, such as "
                f"schott,hikari; got {maker.strip()!r}; a catalogue of yours (.agf) is given by "
                f"{option_text('glass')}"
            )
        preferred += catalogues
    return tuple(dict.fromkeys(preferred))


def _catalogue(table: Mapping[str, Any]) -> GlassCatalogue:
    suffix = "" if table["literature"] else f"-{table['catalogue']}"
    return GlassCatalogue(
        name=table["catalogue"],
        literature=table["literature"],
        glasses=tuple(_glass(row, suffix, table["source"]) for row in table["glasses"]),
    )


def _glass(row: Sequence[Any], suffix: str, source: str) -> Glass:
    name, formula, range_um, index_d, abbe_number, coefficients, *own_source = row
    return Glass(
        name=f"{name}{suffix}",
        formula=formula,
        coefficients=tuple(coefficients),
        source=own_source[0] if own_source else source,
        range_um=(range_um[0], range_um[1]),
        stated_index_d=index_d,
        stated_abbe_number=abbe_number,
    )


def find_glass(
    name: str,
    catalogues: Sequence[GlassCatalogue] = (),
    preferred: Sequence[GlassCatalogue] = (),
) -> Glass:
    """Return the glass of this name.

    Args:
        name: A strict name, "air", a model glass (see `model_glass`), or a trade name that exactly
            one catalogue has.
        catalogues: The user's; they are asked before those of camkit.
        preferred: Those of camkit; the first that has a trade name decides.

    Raises:
        ContractError: If there is none, or a trade name stands for several; the message names near
            matches. Nothing is guessed.
    """
    if name == AIR.name:
        return AIR
    for catalogue in (*catalogues, *builtin_catalogues()):
        match = catalogue.get(name)
        if match is not None:
            return match
    model = parse_model_name(name)
    if model is not None:
        return model
    several: list[tuple[Glass, bool]] = []
    for group in (catalogues, *((c,) for c in preferred), builtin_catalogues()):
        several = [(g, c.literature) for c in group for g in c.with_trade_name(name)]
        # a material of the literature is no trade name: its source decides its index
        if len(several) == 1 and not several[0][1]:
            return several[0][0]
        if several:
            break
    near = [glass.name for glass, _ in several] or _near_names(name, catalogues)
    choice = f", or choose by {option_text('catalogue')}" if len(several) > 1 else ""
    remedy = f"write {' or '.join(near)}{choice}" if near else "no glass has a name like it"
    raise ContractError(f"glass must be a known name with its source; got {name!r}; {remedy}")


def own_glass(glass: Glass, catalogues: Iterable[GlassCatalogue]) -> Glass | None:
    """Return the glass back if it comes from one of the user's catalogues, else None."""
    return glass if any(c.get(glass.name) is glass for c in catalogues) else None


def _near_names(name: str, catalogues: Sequence[GlassCatalogue]) -> list[str]:
    folded_name = name.casefold()
    user_glasses = (glass for catalogue in catalogues for glass in catalogue.glasses)
    pairs = [*_near(folded_name, user_glasses), *_builtin_near(folded_name)]
    return [glass_name for _, glass_name in sorted(pairs, key=lambda pair: -pair[0])[:_NEAR]]


@lru_cache(maxsize=256)
def _builtin_near(folded_name: str) -> list[tuple[float, str]]:
    """Return the near ones of camkit's: names that are no glass of it come again and again."""
    return _near(folded_name, (glass for c in builtin_catalogues() for glass in c.glasses))


def _near(folded_name: str, glasses: Iterable[Glass]) -> list[tuple[float, str]]:
    """Return how like the names of glasses are to one, and the names; without unlike ones."""
    parts = {folded_name, folded_name.rpartition("-")[0]}  # a maker may follow
    matchers = [difflib.SequenceMatcher(None, "", part) for part in parts]
    near = []
    for glass in glasses:
        trade_name = trade_name_of(glass).casefold()
        ratios = [_likeness(matcher, trade_name) for matcher in matchers]
        likeness = max(*ratios, 0.99 * (glass.name.casefold() == folded_name), 0.0)
        if likeness >= _LEAST_LIKENESS:
            near.append((likeness, glass.name))
    return near


def _likeness(matcher: difflib.SequenceMatcher[str], text: str) -> float:
    """Return the ratio of a text, or 0 where a bound that takes less time lies below the least."""
    matcher.set_seq1(text)
    bounds = (matcher.real_quick_ratio, matcher.quick_ratio)
    if any(bound() < _LEAST_LIKENESS for bound in bounds):
        return 0.0
    return matcher.ratio()
