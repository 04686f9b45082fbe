"""Networks and linear estimates on test pictures, whatever they were told of the PSF."""

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from torch import nn

from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import SETS, evaluate, read_set
from camkit.models_def.kinds.spad.sampling import Sampling
from camkit.models_def.training.kind import Restorer
from tools.spad.linear import linear_restorer

LEVELS: Final[Mapping[str, float]] = {"no noise": math.inf, "10000": 1e4, "1000": 1e3}
"""Photons of white."""

Sets = Mapping[str, Sequence[FloatArray]]
Method = Callable[[Exposure], Restorer]
"""What makes pictures finer, at a level of light."""


def read_sets(folder: Path) -> Sets:
    """Read the test sets that lie in a folder.

    Raises:
        ContractError: If there is none.
    """
    found = {name: read_set(folder / name) for name in SETS if (folder / name).is_dir()}
    if not found:
        raise ContractError(f"{folder} holds none of the folders {', '.join(SETS)}")
    return found


def network_method(network: nn.Module) -> Method:
    """Return a network as a method."""
    return lambda _: network


def linear_method(told: Sampling) -> Method:
    """Return the runtime's linear estimate, told a PSF that need not be the one that is."""
    return lambda exposure: linear_restorer(told, exposure)


def scored(sets: Sets, sampling: Sampling, method: Method, photons: float) -> dict[str, Any]:
    """Return set -> PSNR and SSIM of what a method makes of the light behind a plate."""
    exposure = Exposure(photons=photons)
    found = {}
    for name, pictures in sets.items():
        score = evaluate(pictures, sampling, exposure, method(exposure))
        found[name] = {"psnr_db": round(score.psnr_db, 3), "ssim": round(score.ssim, 4)}
    return found


def scored_levels(sets: Sets, sampling: Sampling, method: Method) -> dict[str, Any]:
    """Return level of light -> what `scored` gives."""
    return {name: scored(sets, sampling, method, photons) for name, photons in LEVELS.items()}
