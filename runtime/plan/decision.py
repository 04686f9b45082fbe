"""The decision of one rule, the work that results, and the facts that rules may use."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.facts import NetworkFacts
from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.errors import ContractError
from camkit.runtime.content import CELL_PX, Content
from camkit.runtime.geometry.placement import Placement
from camkit.runtime.options import Mode, Options
from camkit.runtime.plan.bounded_networks import bounded_stages

Labels = NDArray[np.int8]

DEVELOP: Final = "develop"
"""The method that restores nothing."""

PLAIN: Final = 0
WIENER: Final = 1
SMALL: Final = 2
FULL: Final = 3
TIER_NAMES: Final = ("plain", "wiener", "small", "full")
"""What a lattice cell gets: its developed samples, the bank, the smaller network, the network."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """The subject of a plan, and the facts that its rules may use.

    Attributes:
        bundle: The camera.
        options: What the caller chose.
        height_px: Rows of the capture.
        width_px: Columns of the capture.
        placement: Where the capture lies on the sensor.
        content: What was measured; None where nothing may be skipped.
        lights: (row, column) of squares of `LIGHT_PX`, true where any sample is clipped; None where
            no rule asks.
        loss_db: Predicted loss that the rules may spend, in dB against `exact`.
        side_px: Side of the squares of the mosaic that the pixels of the capture are means over; 1
            for its own pixels.
        enlarged: Whether the picture gets the size of the mosaic back.
    """

    bundle: Bundle
    options: Options
    height_px: int
    width_px: int
    placement: Placement
    content: Content | None = None
    lights: NDArray[np.bool_] | None = None
    loss_db: float = 0.0
    side_px: int = 1
    enlarged: bool = False

    @property
    def role(self) -> str | None:
        """Name the role of the one network of the camera; None if it has none or several."""
        roles = {stage.role for stage in self.bundle.manifest.stages_of(Network)}
        return next(iter(roles)) if len(roles) == 1 else None

    def facts(self, size: str) -> NetworkFacts:
        """Return the facts of one size of the first network of the camera."""
        return self.bundle.network_facts(next(iter(self.bundle.manifest.networks)), size)

    def reach_px(self, size: str) -> int:
        """Return the reach of the first network of the camera, with that of the stage behind it."""
        stages = bounded_stages(self.bundle.manifest, self.options.laws)
        extra_px = [stage.extra_reach_px for stage in stages if isinstance(stage, Network)]
        return self.facts(size).reach_px + max(extra_px, default=0)

    def global_text(self, sizes: Iterable[str]) -> str:
        """Return the operators that see the whole picture, of networks of some sizes."""
        networks = self.bundle.manifest.networks.values()
        texts = (one[size].global_text for size in sizes for one in networks if size in one)
        return next(filter(None, texts), "")

    @property
    def megapixels(self) -> float:
        """Return the size of the capture."""
        return self.height_px * self.width_px / 1e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Work:
    """The work on a capture.

    Attributes:
        method: Way of a stage, as `--method` names it: the network, a classical method alone, or
            DEVELOP; None for the usual way of every stage.
        networks: Whether any network runs.
        size: Size of network that cells of tier FULL get.
        small: Size that cells of tier SMALL get; None without one.
        mode: Tiling.
        labels: (row, column) tier of every lattice cell; None for FULL everywhere.
        left_out: Types of stages that are left out beside what the method leaves out.
        strength: Share of what the networks add that is kept, of that which the caller wants.
    """

    method: str | None = None
    networks: bool = True
    size: str = "M"
    small: str | None = None
    mode: Mode = "exact"
    labels: Labels | None = None
    left_out: frozenset[str] = frozenset()
    strength: float = 1.0

    def __post_init__(self) -> None:
        if self.labels is None:
            return
        if self.labels.ndim != 2 or not np.isin(self.labels, (PLAIN, WIENER, SMALL, FULL)).all():
            raise ContractError("labels must be a 2-D array of tiers 0..3")
        if self.small is None and (self.labels == SMALL).any():
            raise ContractError("cells of tier SMALL need a smaller size of network")

    def sizes(self) -> tuple[str, ...]:
        """Return the sizes of the networks that will run."""
        if not self.networks:
            return ()
        if self.labels is None:
            return (self.size,)
        both = ((FULL, self.size), (SMALL, self.small))
        return tuple(s for tier, s in both if s is not None and (self.labels == tier).any())

    def network_labels(self) -> Labels | None:
        """Return (row, column): 0 no network, n the n-th of `sizes`; None for one everywhere."""
        if self.labels is None:
            return None
        numbers = np.zeros(self.labels.shape, np.int8)
        for number, size in enumerate(self.sizes(), start=1):
            tier = FULL if size == self.size else SMALL
            numbers[self.labels == tier] = number
        return numbers


def cells_record(labels: Labels) -> dict[str, Any]:
    """Return the tiers of (row, column) cells for a sidecar: a letter each, a text per row.

    Cells count from the top left of the capture, in sensor orientation.
    """
    letters = np.array([name[0].upper() for name in TIER_NAMES])
    return {"side_px": CELL_PX, "rows": ["".join(row) for row in letters[labels]]}


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """The decision of one rule.

    Attributes:
        what: Name of the rule.
        choice: What will be done.
        reason: Why.
        cost_db: Expected loss against `exact` in dB; negative where it should be better.
        saving_s: Expected seconds saved against not deciding so; None until estimated.
    """

    what: str
    choice: str
    reason: str
    cost_db: float = 0.0
    saving_s: float | None = None

    def to_json(self) -> dict[str, Any]:
        """Return the decision as plain JSON values."""
        return {
            "what": self.what,
            "choice": self.choice,
            "reason": self.reason,
            "saving_s": None if self.saving_s is None else round(self.saving_s, 3),
            "cost_db": round(self.cost_db, 4),
        }
