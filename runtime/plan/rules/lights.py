"""The rule for a network that acts near lights alone: elsewhere its input is its output."""

from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.bundle.stages import Network
from camkit.runtime.content import CELL_PX, LIGHT_PX, lattice_shape
from camkit.runtime.network.cell_windows import RAMP_PX
from camkit.runtime.plan.decision import FULL, PLAIN, Decision, Subject, Work

ORDER: Final = 25


def needs_lights(bundle: Bundle) -> bool:
    """Return whether a network of a bundle acts near lights alone."""
    return any(stage.lights_px is not None for stage in bundle.manifest.stages_of(Network))


def decide(subject: Subject, work: Work) -> tuple[Work, Decision | None]:
    """Exclude cells that no light reaches from the network.

    Where it runs in some cells no bit depends on it; a picture without lights is spared the way to
    equal noise and back as well, which rounds.
    """
    reaches_px = [stage.lights_px for stage in subject.bundle.manifest.stages_of(Network)]
    if not work.networks or subject.lights is None or len(reaches_px) != 1 or not reaches_px[0]:
        return work, None
    shape = lattice_shape(subject.height_px, subject.width_px)
    near = _near(subject.lights, reaches_px[0] + RAMP_PX, shape)
    if not near.any():
        unwanted = {stage.type for stage in subject.bundle.manifest.stages_of(Network)}
        return replace(work, networks=False, left_out=work.left_out | unwanted), Decision(
            what="lights", choice="no network", reason="nothing clipped"
        )
    labels = np.full(shape, FULL, np.int8) if work.labels is None else work.labels
    near_labels = np.where(near, labels, PLAIN).astype(np.int8)
    count = int((near_labels != PLAIN).sum())
    return replace(work, labels=near_labels), Decision(
        what="lights",
        choice=f"{count} of {near_labels.size} cells",
        reason=f"the network changes nothing farther than {reaches_px[0]} px from a light",
    )


def _near(lights: NDArray[np.bool_], reach_px: int, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the cells (row, column) with a square of which a light is within reach.

    The reach holds the ramp to cells without a network, so that it lies where nothing changes.
    """
    import scipy.ndimage

    squares = -(-reach_px // LIGHT_PX)
    wide = scipy.ndimage.maximum_filter(lights, size=2 * squares + 1, mode="constant")
    per_cell = CELL_PX // LIGHT_PX
    rows, columns = shape
    whole = np.zeros((rows * per_cell, columns * per_cell), np.bool_)
    whole[: wide.shape[0], : wide.shape[1]] = wide
    return np.asarray(whole.reshape(rows, per_cell, columns, per_cell).any(axis=(1, 3)))
