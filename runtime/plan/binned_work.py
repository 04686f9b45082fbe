"""The work on a capture whose mosaic is averaged over squares first.

    options, stages -> side of the squares -> no network, or less of what it adds

A network was trained on pixels of full size. Of pictures at half scale it adds three quarters of
what it would, at a quarter it would do harm (docs/results/plan.md).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from camkit.bundle.manifest import Manifest
from camkit.bundle.stages import Network, StageEntry
from camkit.runtime.options import Options, Scale
from camkit.runtime.plan.bounded_networks import front_end
from camkit.runtime.plan.decision import Work
from camkit.runtime.plan.ways import without_networks
from camkit.runtime.stage_finder import module_of

SIDES_PX: Final[Mapping[Scale, int]] = {"1": 1, "1/2": 2, "1/4": 4}
DRAFT_SIDE_PX: Final = 2
NETWORK_SIDE_PX: Final = 2
"""Of squares for which a network still helps."""
NETWORK_SHARE: Final = 0.75
"""Of what a network adds at that scale."""


def binned_work(manifest: Manifest, options: Options, work: Work, side_px: int) -> Work:
    """Return the work on pixels that are means over squares.

    Args:
        manifest: Of the camera.
        options: What the caller chose; a size or a method of theirs stands.
        work: The work on the mosaic itself.
        side_px: Side of the squares; 1 changes nothing.
    """
    if side_px == 1 or not work.networks:
        return work
    if side_px > NETWORK_SIDE_PX and options.size is None and options.method is None:
        return without_networks(manifest, work) or work
    return replace(work, strength=NETWORK_SHARE)


def no_binning(stages: Sequence[StageEntry]) -> str:
    """Return why the mosaic of a camera is not averaged; empty where it may be."""
    needing = [s.type for s in stages if getattr(module_of(s), "ON_MOSAIC", False)]
    if needing:
        return f"its stage {needing[0]} works on the mosaic"
    networks = [stage for stage in stages if isinstance(stage, Network)]
    if any(front_end(network, stages) is None for network in networks):
        return "its network stands alone, and was trained on pixels of full size"
    return ""


def draft_side_px(options: Options, stages: Sequence[StageEntry]) -> int:
    """Return the side of the squares that a draft averages over; 1 for none."""
    is_draft = options.quality == "draft" and options.method is None
    return DRAFT_SIDE_PX if is_draft and not no_binning(stages) else 1
