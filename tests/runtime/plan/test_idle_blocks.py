"""Blocks stay as they are only where nothing else reads them."""

import numpy as np

from camkit.runtime.bank.blocks import lay_spans
from camkit.runtime.content import CELL_PX
from camkit.runtime.plan.decision import FULL, PLAIN, WIENER
from camkit.runtime.plan.idle_blocks import plain_blocks, plain_share


def test_a_block_is_plain_when_all_cells_it_reaches_are() -> None:
    labels = np.full((4, 6), PLAIN, np.int8)
    labels[:, 4:] = FULL
    test = plain_blocks(labels, 96)
    assert test is not None
    rows, columns = (lay_spans(n * CELL_PX, 256, 64) for n in (4, 6))
    for column in columns:
        reach = column.start + column.inner.stop + 96
        assert test(rows[1], column) == (reach <= 4 * CELL_PX)


def test_no_plain_cell_means_no_plain_block() -> None:
    assert plain_blocks(np.full((2, 2), WIENER, np.int8), 10) is None


def test_share_counts_blocks() -> None:
    spans = lay_spans(4 * CELL_PX, 256, 64)
    assert plain_share(np.full((4, 4), PLAIN, np.int8), 0, spans, spans) == 1.0
    assert plain_share(np.full((4, 4), FULL, np.int8), 0, spans, spans) == 0.0
