"""Blocks of the bank that no kept result reads, except plain cells."""

import numpy as np

from camkit.runtime.bank.blocks import PlainBlock, Span
from camkit.runtime.content import CELL_PX
from camkit.runtime.plan.decision import PLAIN, Labels


def plain_blocks(labels: Labels, reach_px: int) -> PlainBlock | None:
    """Return the test for blocks that stay as they are; None if no cell is plain.

    Args:
        labels: (row, column) tiers of the cells.
        reach_px: How far the networks look beyond their cells.
    """
    plain = labels == PLAIN
    if not plain.any():
        return None

    def is_plain(row: Span, column: Span) -> bool:
        rows, columns = _cells(row, reach_px), _cells(column, reach_px)
        return bool(plain[rows, columns].all())

    return is_plain


def plain_share(
    labels: Labels, reach_px: int, rows: tuple[Span, ...], columns: tuple[Span, ...]
) -> float:
    """Return the share of blocks that stay as they are."""
    test = plain_blocks(labels, reach_px)
    if test is None:
        return 0.0
    return float(np.mean([test(row, column) for row in rows for column in columns]))


def _cells(span: Span, reach_px: int) -> slice:
    """Return the cells that the live part of a block and its surroundings touch."""
    first = span.start + span.inner.start - reach_px
    last = span.start + span.inner.stop - 1 + reach_px
    return slice(max(first, 0) // CELL_PX, last // CELL_PX + 1)
