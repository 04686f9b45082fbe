"""Rows of counts that a detector without pile-up would have given, with what is known of pixels."""

from typing import Final

import numpy as np

from camkit.runtime.cancel import check_wish
from camkit.runtime.kinds.spad.captures.photon_capture import PhotonCapture
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.pixels import Pixels, by_pixel
from camkit.runtime.kinds.spad.time_axis import Orientation
from camkit.runtime.rows import Rows, RowSource

AT_ONCE: Final = 2_000_000
"""Counts that are corrected at once."""


class CorrectedRows:
    """Counts of a capture, pile-up undone.

    Attributes:
        pixels: What is known of them; grows with the rows that are read.
    """

    def __init__(self, counts: RowSource, capture: PhotonCapture, *, owned: bool) -> None:
        """Read the maps of a capture.

        Args:
            counts: Its rows.
            capture: What is known of its times.
            owned: Whether what is read of them may be changed.

        Raises:
            ContractError: If a map cannot be read or is of another size.
        """
        timing, shape = capture.timing, capture.shape
        self._counts, self._cycles, self._owned = counts, timing.timing.cycles, owned
        # every frame of counts is a gate of its own
        self._orientation: Orientation = (
            "gate" if capture.axis is None else capture.axis.orientation
        )
        self.pixels = Pixels.unknown(shape, hot=timing.hot(shape), dark=timing.dark(shape))

    @property
    def shape(self) -> tuple[int, int, int]:
        """Return (t, h, w)."""
        return self._counts.shape

    def read(self, top: int, bottom: int) -> Rows:
        """Return rows top..bottom.

        Raises:
            DecodeError: If the file is damaged, or holds no counts.
            ContractError: If there are more counts than cycles.
        """
        counts = by_pixel(self._counts.read(top, bottom))
        counts = counts if self._owned else counts.copy()
        check_wish()
        if self._cycles:
            flat, pixels = counts.reshape(-1, counts.shape[2]), self.pixels
            blind = np.zeros(len(flat), dtype=bool)
            worst = np.zeros(len(flat))
            size = max(1, AT_ONCE // counts.shape[2])
            for start in range(0, len(flat), size):
                check_wish()
                part = slice(start, start + size)
                found = without_pile_up(flat[part], self._cycles, self._orientation)
                flat[part], blind[part], worst[part] = found.counts, found.blind, found.worst
            pixels.blind[top:bottom] = blind.reshape(counts.shape[:2])
            pixels.worst[top:bottom] = worst.reshape(counts.shape[:2]).max(axis=1)
        return counts.transpose(2, 0, 1)
