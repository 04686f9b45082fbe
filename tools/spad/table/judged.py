"""What is judged: every training of the tables, and what stands beside it without one.

A full pixel is judged twice: by its own light, 16 times that of a sub-pixel in the 4x4 model, and
at equal counts.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from camkit.errors import ContractError
from tools.spad.table.rows import ROWS, SAMPLINGS, Row

GAUSSIAN_UNTRAINED: Final = "gaussian_untrained"
NAMES: Final = {
    "M": "M",
    "S": "S",
    "dbpn": "D-DBPN",
    "srcnn": "SRCNN",
    "vdsr": "VDSR",
    "linear": "linear",
    "bicubic": "bicubic",
}
PLAIN: Final = ("linear", "bicubic")
_BY_KEY: Final = {row.key: row for row in ROWS}
_EQUAL: Final = "=equal"


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """A row of the record.

    Attributes:
        key: Its name.
        label: For people.
        sampling: How the array samples; gaussian_untrained for a network that never saw that.
        method: Size of network, linear or bicubic.
        trained: Its trainings; None for what needs none.
        equal_counts: Whether a full pixel counts no more than a small one.
        like: Row whose Gaussian it has.
    """

    key: str
    label: str
    sampling: str
    method: str
    trained: Row | None = None
    equal_counts: bool = False
    like: Row | None = None

    @property
    def seeds(self) -> tuple[int, ...]:
        """Return the seeds of its trainings; one place for what needs none."""
        return (0,) if self.trained is None else self.trained.seeds

    def run(self, seed: int) -> str:
        """Name one of its trainings, as it was judged here."""
        return self.key if self.trained is None else f"{self.key}-{seed}"


def _trained(row: Row) -> Judged:
    label = f"{SAMPLINGS[row.sampling]}, {NAMES[row.size]}"
    return Judged(key=row.key, label=label, sampling=row.sampling, method=row.size, trained=row)


def _judged() -> tuple[Judged, ...]:
    found = [_trained(row) for row in ROWS]
    full = _BY_KEY["full_fill.M"]
    found.append(
        Judged(
            key=f"{full.key}{_EQUAL}",
            label=f"{SAMPLINGS[full.sampling]}, equal counts, M",
            sampling=full.sampling,
            method=full.size,
            trained=full,
            equal_counts=True,
        )
    )
    learned = _BY_KEY["learned.M"]
    found.append(
        Judged(
            key=f"{GAUSSIAN_UNTRAINED}.M",
            label="thesis's Gaussian, network of the plate, M",
            sampling=GAUSSIAN_UNTRAINED,
            method=learned.size,
            trained=learned,
        )
    )
    return (
        *found,
        *(
            Judged(
                key=f"{sampling}.{method}",
                label=f"{label}, {NAMES[method]}",
                sampling=sampling,
                method=method,
                like=_BY_KEY["gaussian.M"] if sampling == "gaussian" else None,
            )
            for sampling, label in SAMPLINGS.items()
            for method in PLAIN
        ),
    )


JUDGED: Final = _judged()


def chosen_judged(names: Iterable[str] | None) -> tuple[Judged, ...]:
    """Return rows by name; all without names.

    Raises:
        ContractError: If there is none of that name.
    """
    if names is None:
        return JUDGED
    by_key = {row.key: row for row in JUDGED}
    wanted = list(names)
    if unknown := [name for name in wanted if name not in by_key]:
        raise ContractError(f"there is no row {unknown[0]!r}; there are {', '.join(by_key)}")
    return tuple(by_key[name] for name in wanted)
