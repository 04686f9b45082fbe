"""The PSF of a plate, frozen whole: as few wavelengths as keep the light of a colour in its place.

Its kernels are hundreds of pixels wide and meet no Wiener bank, so they are not judged by one, as
those of a lens are (`freeze_optics`). What is stated is light: how much of it the window holds, and
how much lies in another place than in the kernels of the camera's colours.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import torch

from camkit.bundle.psf_file import write_psf
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.streak_file import write_streaks
from camkit.contracts import FrozenPsf
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.diffraction.plate_streaks import plate_streaks
from camkit.models_def.optics.diffraction.streak_fit import NoStreaksError
from camkit.models_def.optics.frozen import FINE_WAVELENGTHS, FreezeGrid, Frozen, freeze
from camkit.models_def.sensors.psf import wavelength_weights

WAVELENGTH_COUNTS: Final = (3, 4, 5, 7, 9, 13)
MISPLACED_LIMIT: Final = 0.002
WINDOW: Final = FreezeGrid(energy=0.999, max_side_px=401, least_energy=0.9)
"""The window of a plate, unless another is asked for: streaks end long before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateReport:
    """What freezing a plate kept.

    Attributes:
        wavelengths: Kept.
        side_px: Of the kernels.
        energy_kept: Least share of the light of a colour inside the kernels.
        misplaced: Largest share of the light of a colour that lies elsewhere than in the kernel
            of that colour computed from 49 wavelengths.
        depths_mm: Depths kept.
        of_optics: What else the optics say of themselves.
    """

    wavelengths: int
    side_px: int
    energy_kept: float
    misplaced: float
    depths_mm: tuple[float, ...]
    of_optics: Mapping[str, float]

    def to_json(self) -> dict[str, int | float | str]:
        """Give the report as a flat mapping."""
        return {
            "fields": 1,
            "wavelengths": self.wavelengths,
            "side_px": self.side_px,
            "energy_kept": round(self.energy_kept, 5),
            "misplaced": round(self.misplaced, 5),
            "depths_mm": ", ".join(f"{depth_mm:g}" for depth_mm in self.depths_mm),
            **{name: round(value, 5) for name, value in self.of_optics.items()},
        }


def freeze_plate(
    optics: PlateOptics,
    out_path: Path,
    *,
    sensor: ColorSensor,
    grid: FreezeGrid = WINDOW,
    tell: Callable[[str], None] = lambda _: None,
) -> PlateReport:
    """Freeze the PSF of a plate and write it.

    Args:
        optics: The plate, or its bare lens.
        out_path: Receives the frozen PSF (safetensors).
        sensor: Pitch and response.
        grid: Energy, largest side, depths; wavelengths are chosen here.
        tell: Takes a line for everything that was tried.

    Raises:
        ContractError: If the window does not hold the wanted light, or no number of wavelengths
            keeps it in its place.
    """
    for count in WAVELENGTH_COUNTS:
        frozen = freeze(optics, sensor, replace(grid, wavelengths=count))
        misplaced = misplaced_light(optics, sensor, frozen)
        tell(f"{count} wavelengths: {misplaced:.4f} of the light of a colour is misplaced")
        if misplaced <= MISPLACED_LIMIT:
            break
    else:
        raise ContractError(
            f"{count} wavelengths misplace {misplaced:.4f} of the light of a colour, more than "
            f"{MISPLACED_LIMIT}; freeze for a sensor with smoother responses"
        )
    _write(optics, out_path, frozen.psf, sensor)
    return PlateReport(
        wavelengths=count,
        side_px=frozen.psf.kernels.shape[-1],
        energy_kept=frozen.energy_kept,
        misplaced=misplaced,
        depths_mm=tuple(frozen.psf.depths_mm.tolist()),
        of_optics=optics.facts,
    )


def _write(optics: PlateOptics, path: Path, psf: FrozenPsf, sensor: ColorSensor) -> None:
    """Write what was frozen: by its arms where it has any, else by its kernels."""
    try:
        streaks = plate_streaks(
            optics.plate,
            sensor,
            depths_mm=tuple(psf.depths_mm.tolist()),
            wavelengths_um=psf.wavelengths_um,
            side_px=psf.kernels.shape[-1],
        )
    except NoStreaksError:
        write_psf(path, psf)
    else:
        write_streaks(path, streaks)


def misplaced_light(optics: PlateOptics, sensor: ColorSensor, frozen: Frozen) -> float:
    """Give the share of a colour's light that a frozen PSF has elsewhere than the plate, at worst.

    Half the sum of the absolute differences of the two kernels, each of sum 1.
    """
    psf = frozen.psf
    response_um, response = sensor.response_arrays()
    fine_um = np.linspace(response_um[0], response_um[-1], 2 * FINE_WAVELENGTHS - 1)
    many = torch.from_numpy(wavelength_weights(fine_um, response_um, response))
    few = torch.from_numpy(wavelength_weights(psf.wavelengths_um, response_um, response))
    side_px, worst = psf.kernels.shape[-1], 0.0
    for i, depth_mm in enumerate(psf.depths_mm):
        traced = optics.kernels(
            optics.layout(0.0, 1),
            fine_um,
            depth_mm=float(depth_mm),
            side_px=side_px,
            pitch_um=psf.pixel_pitch_um,
        )
        light = traced.kernels[0] * traced.energy_kept[0, :, None, None]
        true = torch.einsum("cw,wyx->cyx", many, light)
        true = true / true.sum((-2, -1), keepdim=True)
        kept = torch.from_numpy(psf.kernels[0, i].astype(np.float64))
        found = torch.einsum("cw,wyx->cyx", few, kept)
        worst = max(worst, float((found - true).abs().sum((-2, -1)).max()) / 2)
    return worst
