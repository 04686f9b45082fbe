"""Bounds on light put on networks that state none, where the caller enforces the laws of a picture.

stages, laws -> stages, each network behind a bank with a bound
"""

from collections.abc import Mapping, Sequence
from typing import Final

from camkit.bundle.light_bound import USUAL_BOUND
from camkit.bundle.plane import Plane
from camkit.bundle.stages import Network, Stage, Wiener
from camkit.runtime.options import Laws

ENFORCE: Final[Laws] = "enforce"


def lawful(stages: Sequence[Stage], planes: Mapping[str, Plane], laws: Laws) -> tuple[Stage, ...]:
    """Return the stages that are walked.

    Args:
        stages: Of the manifest.
        planes: By name, that of the sensor among them.
        laws: What the caller chose.
    """
    if laws != ENFORCE:
        return tuple(stages)
    return tuple(_bounded(stage, stages, planes) for stage in stages)


def front_end(network: Network, stages: Sequence[Stage]) -> Wiener | None:
    """Return the bank whose picture a network improves on; None if it improves on another."""
    banks = [stage for stage in stages if isinstance(stage, Wiener)]
    return next((bank for bank in banks if set(bank.gives) & set(network.takes)), None)


def _bounded(stage: Stage, stages: Sequence[Stage], planes: Mapping[str, Plane]) -> Stage:
    if not isinstance(stage, Network) or stage.light is not None:
        return stage
    bank = front_end(stage, stages)
    if bank is None or stage.transform != "stabilise":
        return stage
    masks = tuple(name for name in bank.takes if planes[name].domain == "mask")
    return stage.model_copy(update={"takes": stage.takes + masks, "light": USUAL_BOUND})
