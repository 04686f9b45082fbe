"""The blur between two stops of one lens: transfer functions block by block of a picture.

    rays of a block at either stop -> light in fine cells -> transfer of each, wide over sharp

The pixel's own area is in both pictures and cancels. Rays are straight behind the lens: a sensor
that moves needs no other ones. Geometric, as `psf.py`.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.optics.kernel_bank import ChannelResponse, gaussian_response, wavelength_grid
from camkit.models_def.optics.prescription import Lens, require_round, with_focus_shift
from camkit.models_def.optics.psf import spread_tents
from camkit.models_def.optics.pupil import half_disc, pupil_rays
from camkit.models_def.optics.spot import chief_heights, tangents_for_heights
from camkit.models_def.optics.trace import surface_tensors, trace
from camkit.units import UM_PER_MM

FloatGrid = NDArray[np.float64]
ComplexGrid = NDArray[np.complex128]

RAYS: Final = 1024
WAVELENGTHS: Final = 7
MOST_CELLS: Final = 257
"""Along a window of light."""
MOST_FINE: Final = 4
"""Cells along a pixel."""
REGULAR: Final = 1e-3
"""Power of the sharp transfer below which it is not divided by."""
_HEIGHT_DIGITS: Final = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockPlaces:
    """The middles of the blocks of a picture, and the frequencies of their transfer functions.

    Attributes:
        y_px: (block,) from the middle of the picture, down.
        x_px: Likewise, right.
        pitch_um: Of the pixels.
        down: (n, 1) cycles per pixel.
        across: (1, m) likewise.
    """

    y_px: FloatGrid
    x_px: FloatGrid
    pitch_um: float
    down: FloatGrid
    across: FloatGrid

    def heights_mm(self) -> FloatGrid:
        """Return the distances (block,) from the axis on the sensor."""
        heights = np.hypot(self.y_px, self.x_px) * self.pitch_um / UM_PER_MM
        return np.asarray(np.round(heights, _HEIGHT_DIGITS))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Fans:
    """Rays of half the pupil at every height, and how they go on behind the sensor.

    Attributes:
        x_mm: (height, wavelength, ray) beside the meridional plane.
        y_mm: Likewise, from the chief ray, away from the axis.
        x_slope: Change of `x_mm` by mm behind the sensor.
        y_slope: Likewise, of `y_mm`.
        weight: (height, wavelength, ray), 0 for rays that were lost.
    """

    x_mm: Tensor
    y_mm: Tensor
    x_slope: Tensor
    y_slope: Tensor
    weight: Tensor

    @classmethod
    def of(cls, lens: Lens, heights_mm: FloatGrid, wavelengths_um: FloatGrid) -> "_Fans":
        """Trace a lens at heights on its sensor.

        Raises:
            ContractError: If a height cannot be reached.
        """
        require_round(lens, "a transfer from half the pupil")
        slopes = tangents_for_heights(lens, torch.from_numpy(heights_mm), "a traced picture")
        chief = chief_heights(lens, slopes)
        chief_slope = chief_heights(with_focus_shift(lens, 1.0), slopes) - chief
        tensors = surface_tensors(lens, torch.from_numpy(wavelengths_um)[:, None])
        slope = slopes[:, None, None].expand(-1, len(wavelengths_um), 1)
        rays, weight = pupil_rays(lens, tensors, half_disc(RAYS), slope, definition="stop")
        landings = trace(tensors, rays)
        return cls(
            x_mm=landings.x,
            y_mm=landings.y - chief[:, None, None],
            x_slope=landings.l / landings.n,
            y_slope=landings.m / landings.n - chief_slope[:, None, None],
            weight=torch.where(landings.valid, weight, 0.0),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairRays:
    """The rays of both stops, for a sensor anywhere near its place."""

    places: BlockPlaces
    colours: ChannelResponse
    fans: tuple[_Fans, _Fans]

    def transfers(self, defocus_mm: float = 0.0) -> list[ComplexGrid]:
        """Return what blurs the sharp picture into the wide one, block by block.

        Args:
            defocus_mm: By which the sensor lies behind its place.

        Returns:
            (3, n, m) for every block.

        Raises:
            ContractError: If no light reaches a block.
        """
        _, which = np.unique(self.places.heights_mm(), return_inverse=True)
        transfers = []
        for block, height in enumerate(which):
            turn = float(self.places.y_px[block]), float(self.places.x_px[block])
            wide, sharp = (self._transfer(f, int(height), turn, defocus_mm) for f in self.fans)
            power = np.square(np.abs(sharp)) + REGULAR
            transfers.append(wide * sharp.conj() / power * (1 + REGULAR))
        return transfers

    def _transfer(
        self, fans: _Fans, height: int, turn: tuple[float, float], defocus_mm: float
    ) -> ComplexGrid:
        """Return the transfer (3, n, m) of the light at a height, turned to its azimuth."""
        places = self.places
        scale = UM_PER_MM / places.pitch_um
        outward = (fans.y_mm[height] + defocus_mm * fans.y_slope[height]) * scale
        aside = (fans.x_mm[height] + defocus_mm * fans.x_slope[height]) * scale
        weight = fans.weight[height]
        lit = weight > 0
        if not bool(lit.any()):
            raise ContractError("no light reaches a part of the picture; check stop and sensor")
        outward, aside = (torch.where(lit, one, 0.0) for one in (outward, aside))
        reach_px = float(torch.hypot(outward, aside).max()) + 1
        fine = max(1, min(MOST_FINE, int(MOST_CELLS / (2 * reach_px))))
        half = int(np.ceil(reach_px * fine)) + 1
        length = float(np.hypot(*turn))
        y, x = (turn[0] / length, turn[1] / length) if length else (1.0, 0.0)
        # the pupil's other half is the mirror image
        down = torch.cat([outward * y + aside * x, outward * y - aside * x], dim=-1)
        across = torch.cat([outward * x - aside * y, outward * x + aside * y], dim=-1)
        light = spread_tents(
            down * fine + half,
            across * fine + half,
            torch.cat([weight, weight], dim=-1),
            2 * half + 1,
        ).numpy()
        kernels = np.einsum("cw,wij->cij", self.colours.response, light)
        kernels /= kernels.sum((1, 2), keepdims=True)
        cells = (np.arange(2 * half + 1) - half) / fine
        rows = np.exp(-2j * np.pi * places.down * cells)
        columns = np.exp(-2j * np.pi * places.across.T * cells)
        return np.asarray(rows @ kernels @ columns.T)


def trace_pair(
    wide: Lens, sharp: Lens, places: BlockPlaces, response: ChannelResponse | None = None
) -> PairRays:
    """Trace a lens at both stops.

    Args:
        wide: The lens as it is used for the blurred picture, its object distance the plane's.
        sharp: The same stopped down, the sensor unmoved.
        places: Blocks.
        response: Of the colours; None for camkit's model camera.

    Raises:
        ContractError: If a block lies where no ray arrives.
    """
    colours = response or gaussian_response(wavelength_grid(WAVELENGTHS))
    heights = np.unique(places.heights_mm())
    with torch.no_grad():
        fans = [_Fans.of(lens, heights, colours.wavelengths_um) for lens in (wide, sharp)]
    return PairRays(places=places, colours=colours, fans=(fans[0], fans[1]))
