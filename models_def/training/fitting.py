"""Which fitter trains a network: the house's, or one that the kind brings for a role.

The part of a kind with losses of its own defines `FITTING` beside its `PART`, which fulfils
`FittingKind`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from camkit.errors import ContractError
from camkit.kinds import find_kind
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import Fits
from camkit.models_def.training.recipe import NetworkRecipe


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRequest:
    """What is to be fitted.

    Attributes:
        recipe: Of a kind.
        role: Of the network.
        entry: The network and its schedule.
        device: cpu or cuda.
        first: First weights; None for random ones.
        vgg: Weights of VGG-19; None where none were given.
    """

    recipe: Any
    role: str
    entry: NetworkRecipe
    device: str = "cpu"
    first: FirstWeights | None = None
    vgg: Path | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnFitting:
    """A fitter that a kind brings.

    Attributes:
        make: Makes it.
        credit: What it adds to the training data, for the card.
    """

    make: Callable[[], Fits]
    credit: str = ""


class FittingKind(Protocol):
    """A kind of camera with fitters of its own."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Give the fitter of a role, None for the house's; raise ContractError if it lacks."""
        ...


def own_fitting(kind: str, request: FitRequest) -> OwnFitting | None:
    """Give the fitter that a kind brings for a role, None for the house's.

    Raises:
        ContractError: If something is missing, or weights of VGG-19 were given in vain.
    """
    part = find_kind(kind).part("models_def")
    brought = cast("FittingKind | None", getattr(part, "FITTING", None))
    found = None if brought is None else brought.fitting(request)
    if found is None and request.vgg is not None:
        raise ContractError(
            f"the loss of {request.entry.network} in the role {request.role!r} does not look at "
            "VGG-19: leave --vgg away, or say --fine-tune FROM too"
        )
    return found
