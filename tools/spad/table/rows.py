"""What tables 4.1 and 4.2 compare: samplings, networks behind them, and for how many seeds."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from camkit.errors import ContractError

Sampled = Literal["low_fill", "full_fill", "gaussian", "learned"]

SAMPLINGS: Final[dict[Sampled, str]] = {
    "low_fill": "3 % fill factor",
    "full_fill": "full fill",
    "gaussian": "best Gaussian",
    "learned": "learned plate",
}
MANY_SEEDS: Final = (1, 2, 3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A network behind a sampling.

    Attributes:
        sampling: How the array samples.
        size: Of the network, as `spad_sr.toml` names it.
        seeds: Of its trainings.
    """

    sampling: Sampled
    size: str
    seeds: tuple[int, ...] = (1,)

    @property
    def key(self) -> str:
        """Name it, SAMPLING.SIZE."""
        return f"{self.sampling}.{self.size}"

    def run(self, seed: int) -> str:
        """Name one of its trainings."""
        return f"{self.key}-{seed}"


ROWS: Final = (
    Row(sampling="learned", size="M", seeds=MANY_SEEDS),
    Row(sampling="low_fill", size="M", seeds=MANY_SEEDS),
    Row(sampling="learned", size="S"),
    Row(sampling="gaussian", size="M"),
    Row(sampling="full_fill", size="M"),
    Row(sampling="learned", size="dbpn"),
    Row(sampling="learned", size="srcnn"),
    Row(sampling="learned", size="vdsr"),
)


def chosen_runs(names: Iterable[str] | None) -> list[tuple[Row, int]]:
    """Return trainings by the names of rows or of trainings; all without names.

    The first seed of every row goes before the second of any.

    Raises:
        ContractError: If there is none of that name.
    """
    every = sorted(((row, seed) for row in ROWS for seed in row.seeds), key=lambda found: found[1])
    if names is None:
        return every
    found = []
    for name in names:
        of_name = [(r, seed) for r, seed in every if name in {r.key, r.run(seed)}]
        if not of_name:
            known = ", ".join(row.key for row in ROWS)
            raise ContractError(f"there is no row {name!r}; there are {known}, each with -SEED")
        found += of_name
    return found
