"""What the tables compare: optics, how they are read, and for how many seeds."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final, Literal

from camkit.errors import ContractError

Method = Literal["input", "guess", "physics", "network", "whole"]

BARE: Final = "bare-lens"
CROSS: Final = "streak-cross"
OURS: Final = "streak_hdr.toml"
THESIS: Final = "streak_thesis.toml"
PLATES: Final = {
    BARE: "bare lens",
    "dual-peak": "dual peak",
    CROSS: "rank-1 cross",
    "streak-3": "three lines",
    "streak-4": "four lines",
}
"""Name of a built-in plate -> what it is called in the tables."""
MANY_SEEDS: Final = (1, 2, 3)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A row of the tables.

    Attributes:
        key: Its name, PLATE.WHAT.
        plate: Before the lens.
        label: What it is called in the tables.
        method: input (the bare lens, clipped), guess (from the size of blobs), physics (the solve),
            network (the solve and the network of a bundle behind it), whole (a network from the
            capture to the picture).
        recipe: Of the network, among those that ship; None without one.
        role: Of the network.
        size: Of the network.
        seeds: Of its trainings; one of 0 without a network.
        needs_vgg: Whether training looks at pictures through VGG-19.
    """

    key: str
    plate: str
    label: str
    method: Method
    recipe: str | None = None
    role: str = "highlights"
    size: str = "S"
    seeds: tuple[int, ...] = (0,)
    needs_vgg: bool = False

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
        """Name it, and the folder of its training."""
        return f"{self.row.key}-{self.seed}" if self.row.recipe else self.row.key


def _solved(plate: str, seeds: tuple[int, ...] = (1,)) -> tuple[Row, Row]:
    """Return the rows of the solve behind a plate, alone and with our network."""
    words = PLATES[plate]
    return (
        Row(key=f"{plate}.physics", plate=plate, label=f"{words}, solve", method="physics"),
        Row(
            key=f"{plate}.network",
            plate=plate,
            label=f"{words}, solve and network",
            method="network",
            recipe=OURS,
            seeds=seeds,
        ),
    )


def _thesis(plate: str) -> Row:
    return Row(
        key=f"{plate}.thesis",
        plate=plate,
        label=f"{PLATES[plate]}, networks of the thesis",
        method="whole",
        recipe=THESIS,
        role="whole",
        size="M",
        seeds=(1,),
        needs_vgg=True,
    )


LDR: Final = Row(key=f"{BARE}.ldr", plate=BARE, label="LDR: bare lens, clipped", method="input")
ROWS: Final = (
    LDR,
    Row(key=f"{BARE}.guess", plate=BARE, label="guess from the size of blobs", method="guess"),
    Row(
        key=f"{BARE}.alone",
        plate=BARE,
        label="bare lens, a network alone (HDR-CNN)",
        method="whole",
        recipe="bare_lens.toml",
        role="whole",
        size="M",
        seeds=(1,),
    ),
    *_solved(BARE),
    *_solved("dual-peak"),
    *_solved(CROSS, MANY_SEEDS),
    _thesis(CROSS),
    Row(
        key=f"{CROSS}.deep-optics",
        plate=CROSS,
        label="rank-1 cross, single-stage U-Net (Deep Optics)",
        method="whole",
        recipe=THESIS,
        role="whole",
        size="deep_optics",
        seeds=(1,),
    ),
    *_solved("streak-3"),
    *_solved("streak-4", MANY_SEEDS),
    _thesis("streak-4"),
)


def chosen_rows(keys: Iterable[str] | None) -> tuple[Row, ...]:
    """Return the rows of these names, in the order of the tables; None gives all.

    Raises:
        ContractError: If there is no such row.
    """
    if keys is None:
        return ROWS
    wanted, known = set(keys), [row.key for row in ROWS]
    if unknown := sorted(wanted - set(known)):
        raise ContractError(f"there is no row {unknown[0]!r}; there are {', '.join(known)}")
    return tuple(row for row in ROWS if row.key in wanted)
