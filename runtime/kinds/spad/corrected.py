"""Rows of a file as counts that a detector without pile-up would have given."""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.contracts import FloatArray
from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.files.counts_file import CountsFile
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.time_axis import Orientation, TimeAxis

AT_ONCE: Final = 2_000_000
"""Counts that are corrected at once."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Strip:
    """Some rows.

    Attributes:
        counts: (rows, w, bins) float32.
        blind: (rows, w) pixels of which some bins told nothing.
        worst: The largest share of cycles that a bin lost, or a gate used; 0 where unknown.
    """

    counts: FloatArray
    blind: NDArray[np.bool_]
    worst: float


class CorrectedRows:
    """A file on its time axis."""

    def __init__(
        self, file: CountsFile, axis: TimeAxis | None, *, cycles: int, stamp_ps: float
    ) -> None:
        """Store a file and its axis.

        Args:
            file: Open.
            axis: Of its times; None for counts.
            cycles: Laser cycles per bin; 0 leaves pile-up as it is.
            stamp_ps: Unit of its time stamps, if it has those.
        """
        self._file, self._cycles = file, cycles
        self._blind: dict[int, int] = {}
        # every frame of counts is a gate of its own
        self._orientation: Orientation = "gate" if axis is None else axis.orientation
        self._edges: NDArray[np.float64] | None = None
        if axis is not None and file.kind == "stamps":
            self._edges = axis.edges_ps / stamp_ps

    def rows(self, top: int, bottom: int) -> Strip:
        """Read some rows.

        Raises:
            DecodeError: If the file is damaged, or holds no counts.
            ContractError: If there are more counts than cycles.
        """
        counts = self._file.rows(top, bottom, self._edges)
        check_wish()
        blind = np.zeros(counts.shape[:2], dtype=bool)
        worst = 0.0
        if self._cycles:
            flat, told = counts.reshape(-1, counts.shape[2]), blind.reshape(-1)
            size = max(1, AT_ONCE // counts.shape[2])
            for start in range(0, len(flat), size):
                check_wish()
                part = slice(start, start + size)
                found = without_pile_up(flat[part], self._cycles, self._orientation)
                flat[part], told[part] = found.counts, found.blind
                worst = max(worst, float(found.worst.max(initial=0.0)))
        self._blind |= dict(enumerate(blind.sum(axis=1).tolist(), top))
        return Strip(counts=counts, blind=blind, worst=worst)

    @property
    def blind_pixels(self) -> int:
        """Return how many pixels of the rows read so far lost bins to pile-up."""
        return sum(self._blind.values())
