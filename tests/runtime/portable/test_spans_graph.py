"""The graph of the blocks along an axis leaves no line between them."""

from dataclasses import replace

import numpy as np
import onnxruntime
import pytest

from camkit.bundle.reader import built_in_bundles, open_bundle
from camkit.runtime.portable.facts import CameraFacts, facts_of
from camkit.runtime.portable.spans_graph import spans_graph

SIZE_PX = 1100
AXIS_PX = 700.0


@pytest.fixture(scope="module")
def facts() -> CameraFacts:
    """Return the facts of a camera."""
    return facts_of(open_bundle(built_in_bundles()["duet"]))


@pytest.mark.parametrize("overlap_px", [0, 1, 2, 3, 128])
def test_windows_of_blocks_sum_to_one(facts: CameraFacts, overlap_px: int) -> None:
    bank = facts.bank.model_copy(update={"overlap_px": overlap_px})
    graph = spans_graph(replace(facts, bank=bank))
    values = {"size_px": np.array([SIZE_PX]), "axis_px": np.array([AXIS_PX]), "red": np.array([0])}
    session = onnxruntime.InferenceSession(graph.to_bytes())
    blocks = dict(zip(graph.outputs, session.run(graph.outputs, values), strict=True))
    margin = bank.block_px
    total = np.zeros(SIZE_PX + 2 * margin)
    for first, turn, window in zip(
        *(blocks[n] for n in ("first_px", "turn", "window")), strict=True
    ):
        total[first + margin : first + margin + bank.block_px] += window[::turn]
    np.testing.assert_allclose(total[margin:-margin], 1, atol=1e-6)
