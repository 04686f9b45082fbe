"""Samplings of the pupil by name, and the pupil an analysis uses."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import torch
from numpy.polynomial import legendre
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.pupil import (
    PUPIL_DEFINITIONS,
    PupilDefinition,
    PupilSamples,
    both_halves,
    half_disc,
    hexapolar,
)

DEFAULT_SAMPLING: Final = "hexapolar:6"
MAX_RAYS: Final = 1_000_000
_RIM_RINGS: Final = 10


@dataclass(frozen=True, slots=True, kw_only=True)
class Pupil:
    """The pupil of an analysis.

    Attributes:
        definition: See `camkit.models_def.optics.pupil`. For `stop` the radius is that of the
            real marginal ray.
        sampling: Such as "hexapolar:6"; see `pupil_samples`.
        samples: The points that follow from it.
    """

    definition: PupilDefinition = "paraxial"
    sampling: str = DEFAULT_SAMPLING
    samples: PupilSamples = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.definition not in PUPIL_DEFINITIONS:
            raise ContractError(
                f"a pupil must be one of {', '.join(PUPIL_DEFINITIONS)}; got {self.definition!r}"
            )
        object.__setattr__(self, "samples", pupil_samples(self.sampling))


def pupil_samples(name: str) -> PupilSamples:
    """Return the points of a sampling by name.

    - `hexapolar:RINGS`: a centre and rings of 6, 12, ... points, each counting once, as other
      programs do; its outermost ring lies on the edge and counts in full, so that few rings
      overstate a spot.
    - `gauss:RINGSxARMS`: Gauss-Legendre in r^2 on evenly spaced arms; exact for spots that are
      polynomials of the pupil.
    - `radau:RINGSxARMS`: the same with the centre as a node.
    - `grid:SIDE`: the points of a square grid that lie in the disc.
    - `fibonacci:RAYS`: the spiral of `pupil.half_disc` and its mirror image.

    Raises:
        ContractError: If the name is none of these.

    References: Forbes 1988, J. Opt. Soc. Am. A 5, 1943 (Gauss and Radau in the pupil).
    """
    kind, _, text = name.partition(":")
    makers: dict[str, tuple[int, Callable[..., PupilSamples]]] = {
        "hexapolar": (1, hexapolar),
        "gauss": (2, lambda rings, arms: _rings_and_arms(*_gauss(rings), arms)),
        "radau": (2, lambda rings, arms: _rings_and_arms(*_radau(rings), arms)),
        "grid": (1, uniform_grid),
        "fibonacci": (1, lambda rays: both_halves(half_disc(max(1, rays // 2)))),
    }
    numbers = text.split("x")
    if kind not in makers or len(numbers) != makers[kind][0] or not all(map(_is_count, numbers)):
        raise ContractError(
            "a pupil sampling must be hexapolar:RINGS, gauss:RINGSxARMS, radau:RINGSxARMS, "
            f"grid:SIDE or fibonacci:RAYS, such as {DEFAULT_SAMPLING}; got {name!r}"
        )
    counts = [int(number) for number in numbers]
    size = 3 * counts[0] * (counts[0] + 1) if kind == "hexapolar" else math.prod(counts)
    if (size**2 if kind == "grid" else size) > MAX_RAYS:
        raise ContractError(f"a pupil has at most {MAX_RAYS} rays; got {name!r}")
    return makers[kind][1](*counts)


def rim_samples() -> PupilSamples:
    """Return points that show how far light passes a pupil, to a hundred thousandth of it at best.

    Along both axes they lie dense near the edge, which a stop's rounded size may close by a hair.
    """
    edge = np.concatenate(
        [np.linspace(0, 1, 100, endpoint=False), 1 - np.geomspace(1e-5, 1e-2, 13)]
    )
    arm = torch.from_numpy(np.append(edge, 1.0))
    zero, disc = torch.zeros_like(arm), hexapolar(_RIM_RINGS)
    x = torch.cat([disc.x, arm, -arm, zero, zero])
    return PupilSamples(x=x, y=torch.cat([disc.y, zero, zero, arm, -arm]))


def _is_count(text: str) -> bool:
    return text.isascii() and text.isdigit() and 0 < len(text) < 8 and int(text) > 0


def uniform_grid(side: int) -> PupilSamples:
    """Return the points of a side x side grid of cells whose centres lie in the unit disc."""
    cell = (torch.arange(side, dtype=torch.float64) + 0.5) * 2 / side - 1
    y, x = torch.meshgrid(cell, cell, indexing="ij")
    inside = x**2 + y**2 <= 1
    return PupilSamples(x=x[inside], y=y[inside])


def disc_quadrature(rings: int, arms: int) -> PupilSamples:
    """Return rings x arms points and weights that integrate smooth functions over the disc."""
    return _rings_and_arms(*_gauss(rings), arms)


def _gauss(rings: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    nodes, weights = legendre.leggauss(rings)
    return (nodes + 1) / 2, weights / 2


def _radau(rings: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return nodes and weights in r^2 with a node at 0."""
    both = np.zeros(rings + 1)
    both[-2:] = 1.0
    nodes = np.sort(legendre.legroots(both).real)
    nodes[0] = -1.0
    last = np.zeros(rings)
    last[-1] = 1.0
    weights = (1 - nodes) / (rings * legendre.legval(nodes, last)) ** 2
    return (nodes + 1) / 2, weights / 2


def _rings_and_arms(
    square: NDArray[np.float64], share: NDArray[np.float64], arms: int
) -> PupilSamples:
    radius = torch.from_numpy(np.sqrt(np.maximum(square, 0.0)))[:, None]
    # half a step off the meridional plane, to which the points are symmetric
    angle = (torch.arange(arms, dtype=torch.float64) + 0.5) * (2 * math.pi / arms) + math.pi / 2
    return PupilSamples(
        x=(radius * torch.cos(angle)).reshape(-1),
        y=(radius * torch.sin(angle)).reshape(-1),
        weight=torch.from_numpy(share / arms)[:, None].expand(-1, arms).reshape(-1),
    )


def sample_weights(samples: PupilSamples) -> Tensor:
    """Return the share of the disc (rays,) of each point; the sum is 1."""
    if samples.weight is not None:
        return samples.weight
    return torch.full_like(samples.x, 1 / len(samples.x))
