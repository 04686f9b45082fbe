"""Fitting the bank of a camera whose colours are restored together, for the kinds that have one.

The part of such a kind defines `BANK_FITTING` beside its `PART`, which fulfils `BankFittingKind`.
"""

import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from pydantic import ValidationError

from camkit.bundle.stages import Together
from camkit.bundle.stages.together import Spread
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.training.kind import special_part

_REST: Final = r"[ \t]*(?:#.*)?\n(?:(?!\[).*\n|\n)*"
WIENER: Final = re.compile(r"^\[wiener\]" + _REST, re.MULTILINE)
TOGETHER: Final = re.compile(r"^\[wiener\.together(?:\.spread)?\]" + _REST, re.MULTILINE)
_EXAMPLE: Final = Together(
    noise=(0.0,),
    noise_rise=(0.0,),
    scale=1.0,
    exponent=2.0,
    follow=0.0,
    own=1.0,
    mistrust=0.0,
    spread=Spread(heights_mm=(0.0,), frequencies=(0.0, 1.0), variance=(((0.0, 0.0),),)),
)
"""Numbers to try whether a recipe takes any."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BankFitOptions:
    """The options of a fit.

    Attributes:
        pictures: Folder to draw scenes from; None for procedural ones.
        recipe_folder: For a lens that the recipe names by its path.
        output_folder: Where the recipe with the numbers will lie; None for the same.
        cache_folder: Where traced kernels are kept.
        samples: How many are photographed.
        steps: Of the descent.
        seed: Of samples and descent.
    """

    pictures: Path | None
    recipe_folder: Path
    cache_folder: Path
    samples: int = 240
    steps: int = 160
    seed: int = 0
    output_folder: Path | None = None

    def __post_init__(self) -> None:
        if self.samples < 1 or self.steps < 1 or self.seed < 0:
            raise ContractError(
                "samples and steps must be >= 1, the seed >= 0; got "
                f"{self.samples}, {self.steps}, {self.seed}"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class BankFit:
    """The fitted numbers, and their gain on samples that were not used.

    Attributes:
        together: The numbers.
        gain_db: Over the bank that restores every colour alone, mean over held-out samples.
        samples: Without clipped light, both kinds together.
        steps: Of the descent.
    """

    together: Together
    gain_db: float
    samples: int
    steps: int


class BankFittingKind(Protocol):
    """A kind of camera with a bank to fit."""

    def fit(self, recipe: Any, options: BankFitOptions, tell: Callable[[str], None]) -> BankFit:
        """Fit the numbers of a recipe's camera; raise ContractError if that cannot be done."""
        ...


def bank_fitting_kind(name: str) -> BankFittingKind:
    """Return the part of a kind that fits banks.

    Raises:
        UnsupportedError: If its cameras have none.
    """
    part: BankFittingKind | None = special_part(name, "BANK_FITTING")
    if part is None:
        raise UnsupportedError(f"cameras of the kind {name!r} have no bank of colours to fit")
    return part


def check_text(recipe: str) -> None:
    """Check that a recipe takes numbers, before they are fitted.

    Raises:
        ContractError: As `with_bank`.
    """
    with_bank(recipe, _EXAMPLE)


def with_bank(recipe: str, together: Together) -> str:
    """Return text of a recipe with these numbers in its table [wiener], and nothing else changed.

    Raises:
        ContractError: If it has no such table, or says them in another way than this writes them.
    """
    plain = TOGETHER.sub("", recipe if recipe.endswith("\n") else recipe + "\n")
    heading = WIENER.search(plain)
    if heading is None:
        raise ContractError("the recipe has no table [wiener] to put the numbers into")
    head, rest = plain[: heading.end()].rstrip("\n"), plain[heading.end() :]
    text = f"{head}\n\n{bank_table(together)}\n{rest}"
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ContractError(f"the recipe states its bank in a way of its own: {error}") from error
    try:
        written = Together.model_validate(table["wiener"].get("together"))
    except ValidationError:
        written = None
    if written != together:
        raise ContractError("the recipe states its bank in a way of its own; take that out first")
    return text


def bank_table(together: Together) -> str:
    """Return the numbers as tables of a recipe."""
    lines = ["[wiener.together]"]
    for name, value in together.model_dump(exclude={"spread"}).items():
        lines.append(f"{name} = {list(value) if isinstance(value, tuple) else value!r}")
    spread = together.spread
    lines += [
        "",
        "[wiener.together.spread]",
        f"heights_mm = {list(spread.heights_mm)}",
        f"frequencies = {list(spread.frequencies)}",
        "variance = [",
    ]
    for of_height in spread.variance:
        lines += ["    [", *(f"        {list(line)}," for line in of_height), "    ],"]
    return "\n".join([*lines, "]", ""])
