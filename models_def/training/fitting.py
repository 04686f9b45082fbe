"""Choice of the fitter that trains a network: the common one, or one that the kind brings.

The part of a kind with losses of its own defines `FITTING` beside its `PART`, which fulfils
`FittingKind`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Protocol

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.training.first_weights import FirstWeights
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.kind import special_part
from camkit.models_def.training.recipe import PICTURE_LOSSES, NetworkRecipe

_FILES: Final = (
    ("vgg", "VGG-19", True),
    ("sharp", "sharp pictures without captures", False),
    ("pairs", "real pairs", False),
)
"""Files of a request: option, what it holds, whether fine-tuning alone takes it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FitRequest:
    """The request for a fit.

    Attributes:
        recipe: Of a kind.
        role: Of the network.
        entry: The network and its schedule.
        device: cpu or cuda.
        first: First weights; None for random ones.
        vgg: Weights of VGG-19; None where none were given.
        sharp: Folder of sharp pictures without captures; likewise.
        pairs: Folder of real pairs; likewise.
        recipe_folder: For what the recipe names by a path.
    """

    recipe: Any
    role: str
    entry: NetworkRecipe
    device: str = "cpu"
    first: FirstWeights | None = None
    vgg: Path | None = None
    sharp: Path | None = None
    pairs: Path | None = None
    recipe_folder: Path = Path()


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnFitting:
    """A fitter that a kind brings.

    Attributes:
        make: Makes it, from the material of the samples.
        credit: What it adds to the training data, for the card.
    """

    make: Callable[[Any], Fitter]
    credit: str = ""


class FittingKind(Protocol):
    """A kind of camera with fitters of its own."""

    def fitting(self, request: FitRequest) -> OwnFitting | None:
        """Return the fitter of a role, None for the house's; raise ContractError if it lacks."""
        ...


def own_fitting(kind: str, request: FitRequest) -> OwnFitting | None:
    """Return the fitter that a kind brings for a role, None for the house's.

    Raises:
        ContractError: If something is missing, or files were given in vain.
    """
    part: FittingKind | None = special_part(kind, "FITTING")
    fitting = None if part is None else part.fitting(request)
    if fitting is not None:
        return fitting
    whose = f"{request.entry.network} in the role {request.role!r}"
    if request.entry.schedule.loss in PICTURE_LOSSES:
        raise ContractError(
            f"{whose} of the kind {kind!r} cannot be trained by the loss "
            f"{request.entry.schedule.loss}"
        )
    for option, what, is_for_tuning in _FILES:
        if getattr(request, option) is not None:
            instead = f", or add {option_text('fine_tune')} too" if is_for_tuning else ""
            raise ContractError(
                f"the loss of {whose} does not look at {what}: leave {option_text(option)} away"
                f"{instead}"
            )
    return None
