"""Height maps by few numbers: what a design turns, and how a plate follows from it.

    FullMap      every cell for itself
    RankMap      h_max sigmoid(v q^T), v and q with few columns (Sun 2021, eq. 5.1)
    GratingMap   a sum of profiles, each along a direction of its own
    ZernikeMap   Zernike polynomials
    RadialMap    a profile over the distance from the middle

All are modules that give heights in um, (cells, cells), rows downwards, x to the right. Heights may
be negative or large: wrapping and levels are matters of `fabrication`.
"""

import math
from collections.abc import Sequence

import torch
from torch import Tensor, nn

from camkit.errors import ContractError


class FullMap(nn.Module):
    """Every cell for itself."""

    def __init__(self, height_um: Tensor) -> None:
        """Start at a map (cells, cells)."""
        super().__init__()
        self.height_um = nn.Parameter(height_um.clone())

    def forward(self) -> Tensor:
        """Return the heights."""
        return self.height_um


class RankMap(nn.Module):
    """The thesis's height map of low rank.

    Around zero lies a saddle, as v and q stand for each other's slope: with `start` 1e-3 and no
    offset nothing moves for a hundred steps. One column needs an offset to be a sum of two lines:
    (1 + a)(1 + b) is 1 + a + b but for a product of small numbers.

    References: Sun 2021, eq. (5.1), rank 3, 1.125 um.
    """

    def __init__(
        self,
        cells: int,
        *,
        rank: int = 1,
        most_um: float = 1.125,
        offset: float = 1.0,
        start: float = 0.1,
        seed: int = 0,
    ) -> None:
        """Start at random numbers.

        Args:
            cells: Along a side.
            rank: Columns of v and q.
            most_um: h_max.
            offset: Added to the first column of both.
            start: Standard deviation of the rest.
            seed: Of the random numbers.
        """
        super().__init__()
        if rank < 1 or not most_um > 0:
            raise ContractError(f"rank must be >= 1 and most_um > 0; got {rank}, {most_um}")
        generator = torch.Generator().manual_seed(seed)
        both = start * torch.randn(2, cells, rank, generator=generator)
        both[..., 0] += offset
        self.v, self.q = nn.Parameter(both[0].clone()), nn.Parameter(both[1].clone())
        self.most_um, self.cells = most_um, cells

    def forward(self) -> Tensor:
        """Return the heights."""
        return self.most_um * torch.sigmoid(self.v @ self.q.T)


class GratingMap(nn.Module):
    """A sum of profiles, each of which changes along one direction alone: it makes one streak."""

    def __init__(self, cells: int, angles_rad: Sequence[float], profiles_um: Tensor) -> None:
        """Start at profiles.

        Args:
            cells: Along a side.
            angles_rad: (line,), of the direction in which a profile changes and its streak points:
                from +x (right) towards +y (down).
            profiles_um: (line, sample), over the diagonal of the plate from one corner's distance
                to the other's, evenly.
        """
        super().__init__()
        if profiles_um.ndim != 2 or profiles_um.shape[0] != len(angles_rad) or not angles_rad:
            raise ContractError(f"one profile a line; got {tuple(profiles_um.shape)}")
        if profiles_um.shape[1] < 2:
            raise ContractError("a profile has two samples at least")
        self.profiles_um = nn.Parameter(profiles_um.clone())
        self.angles_rad = tuple(float(angle) for angle in angles_rad)
        self.cells = cells

    def forward(self) -> Tensor:
        """Return the heights."""
        samples = self.profiles_um.shape[1]
        place = (torch.arange(self.cells, dtype=torch.float64) + 0.5) / self.cells - 0.5
        total = torch.zeros(self.cells, self.cells, dtype=self.profiles_um.dtype)
        for angle, profile in zip(self.angles_rad, self.profiles_um, strict=True):
            projection = math.cos(angle) * place[None, :] + math.sin(angle) * place[:, None]
            at = ((projection / math.sqrt(2) + 0.5) * (samples - 1)).clamp(0, samples - 1)
            low = at.floor().clamp(max=samples - 2)
            share = (at - low).to(profile.dtype)
            index = low.long()
            total = total + profile[index] * (1 - share) + profile[index + 1] * share
        return total


class ZernikeMap(nn.Module):
    """Zernike polynomials over the circle, in Noll's order and normalisation (rms of 1)."""

    def __init__(self, cells: int, coefficients_um: Tensor) -> None:
        """Start at coefficients (term,); the first term is piston."""
        super().__init__()
        if coefficients_um.ndim != 1 or coefficients_um.numel() < 1:
            raise ContractError("coefficients are a list")
        self.coefficients_um = nn.Parameter(coefficients_um.clone())
        self.cells = cells
        self.register_buffer("basis", zernike_basis(cells, coefficients_um.numel()))

    def forward(self) -> Tensor:
        """Return the heights; 0 outside the circle."""
        basis = self.basis.to(self.coefficients_um.dtype)
        return torch.einsum("t,thw->hw", self.coefficients_um, basis)


class RadialMap(nn.Module):
    """A profile over the distance from the middle."""

    def __init__(self, cells: int, profile_um: Tensor) -> None:
        """Start at a profile (sample,), from the middle to the corner's distance, evenly."""
        super().__init__()
        if profile_um.ndim != 1 or profile_um.numel() < 2:
            raise ContractError("a profile has two samples at least")
        self.profile_um = nn.Parameter(profile_um.clone())
        self.cells = cells
        place = (torch.arange(cells, dtype=torch.float64) + 0.5) / cells - 0.5
        radius = (place[:, None] ** 2 + place[None, :] ** 2).sqrt() * math.sqrt(2)
        at = (radius * (profile_um.numel() - 1)).clamp(0, profile_um.numel() - 1)
        self._low = at.floor().clamp(max=profile_um.numel() - 2).long()
        self._share = at - self._low

    def forward(self) -> Tensor:
        """Return the heights."""
        share = self._share.to(self.profile_um.dtype)
        return self.profile_um[self._low] * (1 - share) + self.profile_um[self._low + 1] * share


def noll_order(term: int) -> tuple[int, int]:
    """Return (n, m) of a term in Noll's order, which begins at 1; m < 0 is a sine.

    References: Noll 1976, table I.
    """
    if term < 1:
        raise ContractError(f"terms are counted from 1; got {term}")
    n = 0
    while (n + 1) * (n + 2) // 2 < term:
        n += 1
    rest = term - n * (n + 1) // 2 - 1
    m = rest // 2 * 2 + 1 if n % 2 else (rest + 1) // 2 * 2
    return n, m if term % 2 == 0 else -m


def zernike_basis(cells: int, terms: int) -> Tensor:
    """Return the first terms (term, cells, cells) over the circle that fits; 0 outside."""
    place = (torch.arange(cells, dtype=torch.float64) + 0.5) / cells * 2 - 1
    radius = (place[:, None] ** 2 + place[None, :] ** 2).sqrt()
    angle = torch.atan2(place[:, None].expand(cells, cells), place[None, :].expand(cells, cells))
    modes = []
    for term in range(1, terms + 1):
        n, m = noll_order(term)
        radial = torch.zeros_like(radius)
        for k in range((n - abs(m)) // 2 + 1):
            weight = (
                (-1) ** k
                * math.factorial(n - k)
                / math.factorial(k)
                / math.factorial((n + abs(m)) // 2 - k)
                / math.factorial((n - abs(m)) // 2 - k)
            )
            radial += weight * radius ** (n - 2 * k)
        turn = torch.cos(m * angle) if m >= 0 else torch.sin(-m * angle)
        scale = math.sqrt(n + 1) * (math.sqrt(2) if m else 1)
        modes.append(torch.where(radius <= 1, scale * radial * turn, torch.zeros_like(radius)))
    return torch.stack(modes)
