"""Rows of a table as data, each trained for some seeds."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from camkit.errors import ContractError
from camkit.models_def.toml_table import read_table, section


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of a table.

    Attributes:
        key: Its name: what light passes (a plate, a sampling), a dot, what makes the picture.
        label: What it is called in the tables.
        method: How pictures are made, in the words of its table.
        recipe: Of its network, among those that ship; empty without a network.
        role: Of the network; empty for the only one.
        size: Of the network.
        seeds: Of its trainings; one of 0 without a network.
        trained_as: Row whose trainings it shows; empty for its own.
        equal_counts: Whether a large pixel counts no more than a small one.
        needs_vgg: Whether training looks at pictures through VGG-19.
    """

    key: str
    label: str
    method: str
    recipe: str = ""
    role: str = ""
    size: str = ""
    seeds: tuple[int, ...] = (0,)
    trained_as: str = ""
    equal_counts: bool = False
    needs_vgg: bool = False

    @property
    def optics(self) -> str:
        """Return what light passes before it is counted: the first part of the name."""
        return self.key.partition(".")[0]

    @property
    def runs(self) -> tuple["Run", ...]:
        """Return what is measured: the row once, or once for every seed."""
        return tuple(Run(row=self, seed=seed) for seed in self.seeds)


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A row with a seed."""

    row: Row
    seed: int

    @property
    def name(self) -> str:
        """Return the name of the row, with the seed of its network."""
        return f"{self.row.key}-{self.seed}" if self.row.recipe else self.row.key

    @property
    def training(self) -> str:
        """Return the name of the training that it shows, and of its folder."""
        return f"{self.row.trained_as or self.row.key}-{self.seed}"


def read_rows(path: Path) -> tuple[Row, ...]:
    """Read the rows of a file (TOML), in the order of the table."""
    rows = read_table(path, "table")["rows"]
    return tuple(section(f"rows[{number}]", Row, row) for number, row in enumerate(rows))


def chosen_rows(rows: Sequence[Row], keys: Iterable[str] | None) -> tuple[Row, ...]:
    """Return the rows of these names, in the order of the table; None gives all.

    Raises:
        ContractError: If there is no such row.
    """
    if keys is None:
        return tuple(rows)
    names = list(keys)
    _check_known(names, rows, [row.key for row in rows])
    return tuple(row for row in rows if row.key in names)


def chosen_trainings(rows: Sequence[Row], names: Iterable[str] | None) -> list[Run]:
    """Return trainings by the names of rows or of trainings; all without names.

    Rows without a network have none. The first seed of every row goes before the second of any.

    Raises:
        ContractError: If there is none of that name.
    """
    trainings = [run for row in rows if row.recipe and not row.trained_as for run in row.runs]
    every = sorted(trainings, key=lambda run: run.seed)
    if names is None:
        return every
    listed = set(names)
    _check_known(listed, rows, [*(row.key for row in rows), *(run.training for run in every)])
    return [run for run in every if {run.row.key, run.training} & listed]


def _check_known(names: Iterable[str], rows: Sequence[Row], valid: Sequence[str]) -> None:
    if unknown := [name for name in names if name not in valid]:
        listed = ", ".join(row.key for row in rows)
        raise ContractError(f"there is no row {unknown[0]!r}; there are {listed}")
