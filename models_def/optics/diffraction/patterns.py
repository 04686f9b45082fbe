"""Height maps that a few numbers describe: what stands in a plate's file in place of its heights.

    StarPattern    lines through the middle, a chirped grating for each (`gratings`)
    CrossPattern   two lines as a map of rank 1
    PeakPattern    a second, displaced peak, by a prism in the middle of the aperture
    FlatPattern    nothing: the bare lens

Lengths on the sensor hold at the design wavelength.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.geometry import Bench
from camkit.models_def.optics.diffraction.gratings import Streaks, chirp_along, chirped_gratings
from camkit.models_def.optics.diffraction.heights import GratingMap, RankMap
from camkit.units import UM_PER_MM

IndexAt = Callable[[float], float]
"""The index of a plate's glass at a wavelength in um."""
_SIGMOID_1: Final = 1 / (1 + math.exp(-1.0))


class Pattern(Protocol):
    """A function that returns heights for a bench."""

    def height_um(self, bench: Bench, index_at: IndexAt, cells: int) -> Tensor:
        """Return the heights (cells, cells) in um, float32."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class StarPattern:
    """Lines through the middle, evenly bright: the star filter of Rouf 2011 as a plate.

    Attributes:
        angles_deg: (line,), from +x (right) towards +y (down); every line has two arms.
        near_um: Where arms begin on the sensor, from the middle.
        far_um: Where they end.
        share: Of the light, in all arms together.
        wavelength_um: Of the design.
    """

    angles_deg: tuple[float, ...]
    near_um: float
    far_um: float
    share: float
    wavelength_um: float = 0.55

    def grating_map(self, bench: Bench, index_at: IndexAt, cells: int) -> GratingMap:
        """Return the map with its profiles; see `chirped_gratings` for what is refused."""
        streaks = Streaks(
            angles_rad=tuple(math.radians(angle) for angle in self.angles_deg),
            near_um=self.near_um,
            far_um=self.far_um,
            share=self.share,
            wavelength_um=self.wavelength_um,
            index=index_at(self.wavelength_um),
        )
        return chirped_gratings(streaks, bench, cells)

    def height_um(self, bench: Bench, index_at: IndexAt, cells: int) -> Tensor:
        """Return the heights (cells, cells) in um."""
        heights: Tensor = self.grating_map(bench, index_at, cells)()
        return heights.detach().float()


@dataclass(frozen=True, slots=True, kw_only=True)
class CrossPattern:
    """A horizontal and a vertical line as a map of rank 1: h_max sigmoid(v q^T), v = q = 1 + chirp.

    The chirp is so deep that the map's slope at 1 makes gratings of the wanted share of it.

    Attributes:
        near_um: Where arms begin on the sensor, from the middle.
        far_um: Where they end.
        share: Of the light, in all four arms together.
        most_um: h_max.
        wavelength_um: Of the design.

    References: Sun 2021, eq. (5.1).
    """

    near_um: float
    far_um: float
    share: float
    most_um: float = 1.125
    wavelength_um: float = 0.55

    def rank_map(self, bench: Bench, index_at: IndexAt, cells: int) -> RankMap:
        """Return the map with its v and q."""
        index = index_at(self.wavelength_um)
        streaks = Streaks(
            angles_rad=(0.0, math.pi / 2),
            near_um=self.near_um,
            far_um=self.far_um,
            share=self.share,
            wavelength_um=self.wavelength_um,
            index=index,
        )
        grating_um = streaks.phase_rad * self.wavelength_um / (2 * math.pi * (index - 1))
        depth = grating_um / (self.most_um * _SIGMOID_1 * (1 - _SIGMOID_1))
        height_map = RankMap(cells, rank=1, most_um=self.most_um, offset=1.0, start=0.0)
        fine = 8
        places = (torch.arange(cells * fine, dtype=torch.float64) + 0.5) / (cells * fine) - 0.5
        chirp = chirp_along(streaks, bench, 0.0, places * bench.diameter_mm)
        column = (1 + depth * chirp.reshape(cells, fine).mean(1)).float()[:, None]
        with torch.no_grad():
            height_map.v.copy_(column)
            height_map.q.copy_(column)
        return height_map

    def height_um(self, bench: Bench, index_at: IndexAt, cells: int) -> Tensor:
        """Return the heights (cells, cells) in um."""
        heights: Tensor = self.rank_map(bench, index_at, cells)()
        return heights.detach()


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakPattern:
    """A second peak beside the first: a round prism in the middle, wrapped at a cycle.

    A weak grating would write a peak to either side. A prism over a share of the aperture's area
    bends just that share of the light, in the colour of the design; its smaller aperture makes the
    second peak wider than the first. Metzler 2020 found such a PSF by design.

    Attributes:
        right_um: Where the second peak lies on the sensor, to the right of the first.
        down_um: The same, down the rows.
        share: Of the light, in the second peak.
        wavelength_um: Of the design.
    """

    right_um: float
    down_um: float
    share: float
    wavelength_um: float = 0.55

    def __post_init__(self) -> None:
        """Refuse what is no second peak.

        Raises:
            ContractError: If so.
        """
        if not 0 < self.share < 1 or not math.hypot(self.right_um, self.down_um) > 0:
            raise ContractError(
                "a second peak needs a share between 0 and 1 and a place beside the first; got "
                f"{self.share} at {self.right_um}, {self.down_um} um"
            )

    def height_um(self, bench: Bench, index_at: IndexAt, cells: int) -> Tensor:
        """Return the heights (cells, cells) in um.

        Raises:
            ContractError: If the cells are too wide for the prism's slope.
        """
        wave_mm = self.wavelength_um / UM_PER_MM
        cell_mm = bench.diameter_mm / cells
        aside_mm = math.hypot(self.right_um, self.down_um) / UM_PER_MM
        if aside_mm * cell_mm > wave_mm * bench.distance_mm / 4:
            raise ContractError(
                f"a peak {aside_mm * UM_PER_MM:.0f} um aside needs a prism of 4 cells a cycle: "
                f"cells of {cell_mm * UM_PER_MM:.1f} um are too wide, at most "
                f"{wave_mm * bench.distance_mm / 4 / aside_mm * UM_PER_MM:.1f} um"
            )
        places = ((torch.arange(cells, dtype=torch.float64) + 0.5) / cells - 0.5) * (
            bench.diameter_mm
        )
        x_mm, y_mm = places[None, :], places[:, None]
        along_mm2 = (self.right_um * x_mm + self.down_um * y_mm) / UM_PER_MM
        # more glass delays, and light turns to where it is delayed most
        cycles = torch.remainder(along_mm2 / (wave_mm * bench.distance_mm), 1.0)
        inside = x_mm**2 + y_mm**2 <= self.share * self._whole_mm2(bench) / math.pi
        height_um = cycles * self.wavelength_um / (index_at(self.wavelength_um) - 1)
        return torch.where(inside, height_um, torch.zeros_like(height_um)).float()

    def _whole_mm2(self, bench: Bench) -> float:
        square = bench.diameter_mm**2
        return square if bench.aperture == "square" else square * math.pi / 4


@dataclass(frozen=True, slots=True, kw_only=True)
class FlatPattern:
    """No relief: the Dirac of comparisons, which is the bare lens."""

    def height_um(self, bench: Bench, index_at: IndexAt, cells: int) -> Tensor:
        """Return zeros (cells, cells): heights in um."""
        del bench, index_at
        return torch.zeros(cells, cells)


PATTERNS: Final[dict[str, type[Pattern]]] = {
    "star": StarPattern,
    "cross": CrossPattern,
    "peak": PeakPattern,
    "flat": FlatPattern,
}
"""By the `kind` that a file names."""
