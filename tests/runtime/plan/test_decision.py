"""Decisions of a plan as a sidecar keeps them."""

import numpy as np

from camkit.runtime.content import CELL_PX
from camkit.runtime.plan.decision import FULL, PLAIN, SMALL, WIENER, cells_record


def test_every_cell_has_the_letter_of_its_tier() -> None:
    labels = np.array([[PLAIN, WIENER], [SMALL, FULL]], np.int8)
    assert cells_record(labels) == {"side_px": CELL_PX, "rows": ["PW", "SF"]}
