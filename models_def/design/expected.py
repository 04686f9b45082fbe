"""The error that the bank of a camera is expected to leave, in closed form: no pictures, no chance.

With the prior of the bank (`camkit.models_def.sensors.together`), its noise and V, the best linear
estimate of a frequency leaves

    r = sum |H_c|^2 / D_c,   D_c = (own |H_c|^2 + mistrust V_c) S + N_c
    covariance of x = S / (1 + S r) g g^T + diag(own S g),   g_c = 1 - own S |H_c|^2 / D_c

in the colours of the camera, for light that all colours share alike. Its sum over frequencies in
Rec.709, in dB, is a merit of a lens with exact gradients, V's included: a descent on it takes a
hundredth of the time that pictures take, and goes further. It does not know the network.
"""

import math
from dataclasses import dataclass
from typing import Final

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.fabrication import Copy
from camkit.models_def.design.lens import DesignLens
from camkit.models_def.design.shipped_camera import Camera
from camkit.models_def.sensors.together import CORNER_FREQUENCY, frequencies_squared
from camkit.models_def.sensors.wiener import to_otf
from camkit.models_def.toml_table import check_least

GRID_PX: Final = 96
"""Side of the grid of frequencies; a kernel that is wider wraps, which keeps its transfer there."""

LOST_SHARE: Final = 0.005
"""Of the light: so much may fall outside the window of a kernel."""
LOST_WEIGHT: Final = 40.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Descent:
    """The descent of a lens on the error that the bank is expected to leave, before the loop.

    It needs `[camera]` and `[fabrication]`, and takes no pictures.

    Attributes:
        rounds: Descents from the best lens; each with moves that are whitened anew.
        evaluations: Evaluations of the error in a round.
        starts: Lenses that are descended from, the given one among them.
        spread: Standard deviation of the moves to the other lenses; a move of 1 changes the
            spots by one pixel.
        copies: Monte-Carlo samples that the spread of the lens is measured with.
        iso: ISO values at which the error is expected.
        level: Level of the scene; 1.0 = white level.
        evenness: Weight of small gains over the lens at the start, per dB. 0 is the plain mean,
            which takes from the corner for the axis; with a large value only the least gain of
            a field and ISO counts.
        penalty_weight: Weight of `[limits]` in the loss.
    """

    rounds: int = 3
    evaluations: int = 60
    starts: int = 1
    spread: float = 3.0
    copies: int = 6
    iso: tuple[float, ...] = (100.0, 400.0, 1600.0)
    level: float = 0.25
    evenness: float = 2.0
    penalty_weight: float = 50.0

    def __post_init__(self) -> None:
        check_least(self, 1, "rounds", "evaluations", "starts", "copies")
        check_least(self, 0, "spread", "evenness")
        if not min(self.iso, default=0.0) > 0:
            raise ContractError(f"iso must be numbers > 0; got {list(self.iso)}")
        if not self.level > 0:
            raise ContractError(f"level must be > 0; got {self.level}")


class ExpectedError:
    """The merit of a lens: minus the expected error of the bank behind it, in dB."""

    def __init__(self, camera: Camera, descent: Descent, copies: list[Copy]) -> None:
        """Compute what does not depend on the lens."""
        model, level = camera.together, descent.level
        f2 = frequencies_squared((GRID_PX, GRID_PX), torch.zeros((), dtype=torch.float64))
        self.copies, self._own_power, self._mistrust = copies, model.own, model.mistrust
        prior = (f2 + CORNER_FREQUENCY**2) ** (-model.exponent / 2)
        self._prior = model.scale * level**2 * prior
        self._share = torch.full_like(f2, 2.0)  # a half spectrum, its ends apart
        self._share[:, [0, -1]] = 1
        self._share[0, 0] = 0
        numbers = zip(model.noise, model.noise_rise, strict=True)
        rise = torch.stack([(noise + 4 * slope * f2).exp() for noise, slope in numbers])
        self._noise = torch.stack(
            [camera.variance_at(iso, level)[:, None, None] * rise for iso in descent.iso]
        )
        to_rec709 = camera.to_rec709.double()
        self._weight = to_rec709.T @ to_rec709

    def __call__(self, lens: DesignLens) -> tuple[Tensor, Tensor]:
        """Return dB (iso, depth, field), and the penalty of the limits (a scalar).

        Light that falls outside the window is missing from the transfer, so a lens could hide its
        blur there. Beyond half a percent it counts as a limit.
        """
        kernels, penalty = lens()
        light_lost = (1 - LOST_SHARE - kernels.sum((-2, -1))).clamp(min=0)
        penalty = penalty + LOST_WEIGHT * light_lost.square().sum()
        transfer = _transfer(kernels)
        gaps = [(_transfer(lens.made_kernels(c)) - transfer).abs().square() for c in self.copies]
        spread = torch.stack(gaps).mean(0)
        power = transfer.real.square() + transfer.imag.square()
        every_iso = [self._error(power, spread, noise) for noise in self._noise]
        return -10 * torch.log10(torch.stack(every_iso)), penalty

    def _error(self, power: Tensor, spread: Tensor, noise: Tensor) -> Tensor:
        """Return the squared error (depth, field) of transfers (depth, field, 3, h, w)."""
        prior, own_prior = self._prior, self._own_power * self._prior
        doubt = (self._own_power * power + self._mistrust * spread) * prior + noise
        light = prior / (1 + prior * (power / doubt).sum(-3))
        g = 1 - own_prior * power / doubt
        shared = torch.einsum("...ihw,ij,...jhw->...hw", g, self._weight, g)
        of_colours = torch.einsum("i,...ihw->...hw", self._weight.diag(), g)
        return ((light * shared + own_prior * of_colours) * self._share).sum((-2, -1))


def _transfer(kernels: Tensor) -> Tensor:
    otf = to_otf(kernels.flatten(0, -4), (GRID_PX, GRID_PX))
    return otf.reshape(*kernels.shape[:-2], *otf.shape[-2:])


def even_mean(gains_db: Tensor, evenness: float) -> Tensor:
    """Return -log(mean exp(-evenness gain)) / evenness; the mean where evenness is 0."""
    if not evenness:
        return gains_db.mean()
    flat = -evenness * gains_db.flatten()
    return -(torch.logsumexp(flat, 0) - math.log(len(flat))) / evenness
