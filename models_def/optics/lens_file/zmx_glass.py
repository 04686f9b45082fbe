"""Glasses named as .zmx files name them: trade names in capitals, in the order of the GCAT line.

Beside its name a GLAS line may state n_d and V_d, and a file made from a patent names a glass that
is only near to them. A rule decides between the two: where their indices differ by more than 1e-3,
or the name stands in no catalogue, the numbers hold. Programs that know none write 1.5 and 40, or
zeros: those state nothing.

A glass that no catalogue file can name (a plastic of the literature, a model glass) is written as
a model glass with its strict name as the comment of the surface, from which it is read back.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal, get_args

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.glass.catalogue import (
    GlassCatalogue,
    builtin_catalogues,
    catalogues_of,
    find_glass,
    maker_of,
    trade_name_of,
)
from camkit.models_def.optics.glass.dispersion import index_and_abbe
from camkit.models_def.optics.glass.material import Glass
from camkit.models_def.optics.glass.model_glass import MODEL_PREFIX, model_glass
from camkit.models_def.optics.glass.nearness import near_glasses, near_text
from camkit.models_def.optics.lens_file.zmx_records import Record

MODEL_NAME: Final = "___BLANK"
COMMENT: Final = "glass "
GlassRule = Literal["nearest", "names", "numbers"]
GLASS_RULES: Final[tuple[GlassRule, ...]] = get_args(GlassRule)
MOST_DIFFERENCE: Final = 1e-3
"""In n_d or n_F - n_C, up to which a name holds against the numbers beside it."""
LEAST_DIFFERENCE: Final = 1e-4
"""From which the two are said to disagree: makers print five digits."""
_MODEL_FLAG: Final = "1"
_FILLED_IN: Final = (1.5, 40.0)
_SAME: Final = 1e-9
"""Other programs write 13 digits or more."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GlassOrder:
    """The order in which the catalogues of a .zmx file are searched for glasses.

    Attributes:
        user_catalogues: The user's catalogues; asked first.
        listed: Those of camkit that the user prefers, then those that the GCAT line names, in
            their order; the first that has a name decides. A name that none of them has must stand
            in exactly one of the others.
        rule: What holds where a line has a name and numbers; `nearest`: the name as long as its
            index is that of the numbers within `MOST_DIFFERENCE`.
    """

    user_catalogues: tuple[GlassCatalogue, ...] = ()
    listed: tuple[GlassCatalogue, ...] = ()
    rule: GlassRule = "nearest"


@dataclass(frozen=True, slots=True, kw_only=True)
class StatedNumbers:
    """The numbers of a GLAS line beside the name.

    Attributes:
        index_d: n_d.
        abbe_number: V_d; 0 for no dispersion.
        deviation: Of P_gF from the normal line.
    """

    index_d: float
    abbe_number: float
    deviation: float = 0.0

    def difference(self, glass: Glass) -> float:
        """Return the larger of the differences in n_d and n_F - n_C; 0 where a glass has none."""
        index_d, abbe = index_and_abbe(glass)
        if not index_d:
            return 0.0
        ours, theirs = (
            (n - 1) / v if v else 0.0
            for n, v in ((self.index_d, self.abbe_number), (index_d, abbe))
        )
        return max(abs(self.index_d - index_d), abs(ours - theirs))


def glass_order(
    names: Sequence[str],
    user_catalogues: Sequence[GlassCatalogue],
    rule: GlassRule = "nearest",
    preferred: Sequence[GlassCatalogue] = (),
) -> GlassOrder:
    """Return the order for a GCAT line; catalogues that camkit does not have are passed over.

    Args:
        names: Of the GCAT line.
        user_catalogues: Asked first.
        rule: For glasses whose line states numbers beside the name.
        preferred: Asked before those of the GCAT line.
    """
    listed = (*preferred, *(c for name in names for c in catalogues_of(name)))
    return GlassOrder(
        user_catalogues=tuple(user_catalogues), listed=tuple(dict.fromkeys(listed)), rule=rule
    )


def gcat_name(catalogue: GlassCatalogue) -> str:
    """Return the name that a GCAT line has for one of camkit's catalogues."""
    return maker_of(catalogue).upper()


def stated_numbers(glass: Record) -> StatedNumbers | None:
    """Return what a GLAS line with a name states besides; None where it states nothing."""
    try:
        index_d, abbe, *rest = map(float, glass.words[3:6])
    except ValueError:
        return None
    # a model glass may have no dispersion, and any name
    least_abbe = 0.0 if glass.words[1] == _MODEL_FLAG else math.ulp(0.0)
    if index_d <= 1 or not abbe >= least_abbe or (index_d, abbe) == _FILLED_IN:
        return None
    return StatedNumbers(index_d=index_d, abbe_number=abbe, deviation=rest[0] if rest else 0.0)


def read_glass(record: Record, order: GlassOrder) -> Glass:
    """Return the glass of a GLAS line with a name, by the rule of the order.

    Raises:
        ContractError: If no catalogue has the name, or several do that GCAT does not name, and no
            numbers stand beside it or the rule forbids them.
    """
    numbers = stated_numbers(record)
    if numbers is None:
        return find_zmx_glass(record.words[0], order)
    if order.rule == "names":
        return _by_name(record.words[0], numbers, order)
    model = model_glass(numbers.index_d, numbers.abbe_number, numbers.deviation)
    if order.rule == "numbers":
        return model
    try:
        glass = find_zmx_glass(record.words[0], order)
    except ContractError:
        return model
    return glass if numbers.difference(glass) <= MOST_DIFFERENCE else model


def _by_name(name: str, numbers: StatedNumbers, order: GlassOrder) -> Glass:
    """Return the glass of a name; its error names what is near to the numbers beside it."""
    try:
        return find_zmx_glass(name, order)
    except ContractError as error:
        near = near_text(near_glasses(numbers.index_d, numbers.abbe_number, order.user_catalogues))
        if not near:
            raise
        raise ContractError(f"{error}; near to its n_d and V_d: {near}") from error


def glass_note(record: Record, order: GlassOrder, glass: Glass) -> str | None:
    """Return how a glass was read, where name and numbers of its line disagree; else None."""
    name, numbers = record.words[0], stated_numbers(record)
    if name == MODEL_NAME or numbers is None:
        return None
    text = f"n_d {numbers.index_d:.6g} and V_d {numbers.abbe_number:.4g}"
    try:
        catalogue_glass = find_zmx_glass(name, order)
    except ContractError:
        near = near_text(near_glasses(numbers.index_d, numbers.abbe_number, order.user_catalogues))
        hint = f"; near to them: {near}" if near else ""
        return f"{name} is no glass of one catalogue: read by its numbers, {text}{hint}"
    if numbers.difference(catalogue_glass) < LEAST_DIFFERENCE:
        return None
    index_d, abbe = index_and_abbe(catalogue_glass)
    way = "name" if glass == catalogue_glass else "numbers"
    return (
        f"{name} states {text}, {catalogue_glass.name} has {index_d:.6g} and {abbe:.4g}: read by "
        f"its {way} ({option_text('glass')} decides)"
    )


def find_zmx_glass(name: str, order: GlassOrder) -> Glass:
    """Return the glass that a GLAS line names.

    Raises:
        ContractError: If no catalogue has it, or several do that GCAT does not name.
    """
    for catalogue in (*order.user_catalogues, *order.listed):
        match = _in_capitals(catalogue, name)
        if match is not None:
            return match
    rest = [c for c in builtin_catalogues() if not c.literature and c not in order.listed]
    several = [glass for c in rest if (glass := _in_capitals(c, name))]
    if len(several) == 1:
        return several[0]
    if several:
        names = " or ".join(glass.name for glass in several)
        raise ContractError(
            f"glass {name} may be {names}; choose by {option_text('catalogue')}, or name its "
            "catalogue in the GCAT line of the file"
        )
    try:
        return find_glass(name)
    except ContractError as error:
        raise ContractError(
            f"{error}; or give its catalogue, a file in .agf, with {option_text('glass')}"
        ) from error


def _in_capitals(catalogue: GlassCatalogue, name: str) -> Glass | None:
    glasses = catalogue.with_trade_name(name)
    if glasses:
        return glasses[0]
    full_name = f"{name}-{catalogue.name}".upper()
    several = [glass for glass in catalogue.glasses if glass.name.upper() == full_name]
    return several[0] if len(several) == 1 else None


def read_model_glass(numbers: Sequence[float], comment: str, order: GlassOrder) -> Glass:
    """Return the glass of a `GLAS ___BLANK` line: (n_d, V_d, dP_gF), and the surface's comment."""
    model = model_glass(*numbers)
    if comment.startswith(COMMENT):
        try:
            glass = find_glass(comment.removeprefix(COMMENT), order.user_catalogues)
        except ContractError:
            return model
        # someone may have changed the numbers in another program: then they hold
        pairs = zip(index_and_abbe(glass), numbers, strict=False)
        if all(math.isclose(nominal, written, rel_tol=_SAME) for nominal, written in pairs):
            return glass
    return model


def glass_words(glass: Glass, order: GlassOrder, *, is_user_glass: bool) -> tuple[str, str]:
    """Return the text of a GLAS line and the comment that goes with it.

    Args:
        glass: Not air.
        order: Of the catalogues that the GCAT line of the file will name.
        is_user_glass: It comes from a user's catalogue, which a reader must be given too.
    """
    if glass.name.startswith(MODEL_PREFIX):
        words = [*glass.name.removeprefix(MODEL_PREFIX).split(","), "0.0"][:3]
        return f"{MODEL_NAME} 1 0 {' '.join(words)} 0 0 0 0 0", ""
    index_d, number = index_and_abbe(glass)
    numbers = f"{index_d!r} {number!r} 0 0 0 0 0 0"
    trade_name = trade_name_of(glass)
    if (is_user_glass and " " not in trade_name) or _reads_back(trade_name, glass, order):
        return f"{trade_name if is_user_glass else trade_name.upper()} 0 0 {numbers}", ""
    if index_d:
        return f"{MODEL_NAME} 1 0 {numbers}", f"{COMMENT}{glass.name}"
    return f"{glass.name} 0 0 {numbers}", ""


def _reads_back(trade_name: str, glass: Glass, order: GlassOrder) -> bool:
    try:
        return find_zmx_glass(trade_name.upper(), order).name == glass.name
    except ContractError:
        return False
