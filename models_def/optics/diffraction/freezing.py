"""The PSF of a plate, frozen: by core, arms and haze where it writes streaks, else by its kernels.

Its kernels are hundreds of pixels wide and meet no Wiener bank, so they are not judged by one, as
those of a lens are (`freeze_optics`). What is stated is light: how much of it the window holds, and
how much lies in another place than in the kernels of the camera's colours.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import numpy as np
import torch

from camkit.bundle.psf_file import write_psf
from camkit.bundle.sensor import ColorSensor
from camkit.bundle.streak_file import write_streaks
from camkit.caller import option_text
from camkit.contracts import FloatArray
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.diffraction.plate_streaks import plate_streaks
from camkit.models_def.optics.diffraction.streak_fit import NoStreaksError
from camkit.models_def.optics.frozen import FINE_WAVELENGTHS, FreezeGrid, freeze
from camkit.models_def.optics.optics import FloatGrid
from camkit.models_def.sensors.psf import wavelength_weights

Tell = Callable[[str], None]
WAVELENGTH_COUNTS: Final = (3, 4, 5, 7, 9, 13)
MISPLACED_LIMIT: Final = 0.002
STREAKS_LIMIT: Final = 0.015
"""Of what core, arms and haze may misplace; a second peak, say, is no arm."""
WINDOW: Final = FreezeGrid(energy=0.999, max_side_px=401, least_energy=0.9)
"""The window of a plate, unless another is asked for: streaks end long before."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlateReport:
    """The result of freezing a plate.

    Attributes:
        plate: Name of the plate.
        form: streaks (core, arms and haze) or kernels.
        wavelengths: Kept.
        side_px: Of the kernels.
        energy_kept: Least share of the light of a colour inside the kernels.
        misplaced: Largest share of the light of a colour that lies elsewhere than in the kernel
            of that colour computed from 49 wavelengths.
        depths_mm: Depths kept.
        of_optics: What else the optics say of themselves.
    """

    plate: str
    form: Literal["streaks", "kernels"]
    wavelengths: int
    side_px: int
    energy_kept: float
    misplaced: float
    depths_mm: tuple[float, ...]
    of_optics: Mapping[str, float]

    def to_json(self) -> dict[str, int | float | str]:
        """Return the report as a flat mapping."""
        return {
            "plate": self.plate,
            "form": self.form,
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
    tell: Tell = lambda _: None,
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
    try:
        found = _freeze_streaks(optics, out_path, sensor, grid, tell)
    except NoStreaksError as error:
        tell(f"{error}; frozen as kernels")
        found = None
    return found or _freeze_kernels(optics, out_path, sensor, grid, tell)


def _freeze_streaks(
    optics: PlateOptics, path: Path, sensor: ColorSensor, grid: FreezeGrid, tell: Tell
) -> PlateReport | None:
    """Write a plate by its core, arms and haze, with the wavelengths that training sees.

    None, and nothing is written, where these do not hold its light: it writes something else.
    """
    streaks = plate_streaks(
        optics.plate,
        sensor,
        depths_mm=grid.depths_mm or optics.depths_mm,
        side_px=grid.max_side_px,
    )
    light = streaks.dense()
    misplaced, kept = compared(optics, sensor, light, streaks.wavelengths_um, streaks.depths_mm)
    tell(f"{len(streaks.angles_rad)} arms: {misplaced:.4f} of the light of a colour is misplaced")
    if misplaced > STREAKS_LIMIT:
        tell(f"more than {STREAKS_LIMIT}: frozen as kernels")
        return None
    least = grid.energy if grid.least_energy is None else grid.least_energy
    if kept < least:
        raise ContractError(
            f"core, arms and haze hold {kept:.4f} of the light, wanted {least}; raise "
            f"{option_text('max_side_px')} or lower the energy"
        )
    write_streaks(path, streaks)
    return PlateReport(
        plate=optics.name,
        form="streaks",
        wavelengths=streaks.wavelengths_um.size,
        side_px=light.shape[-1],
        energy_kept=kept,
        misplaced=misplaced,
        depths_mm=tuple(streaks.depths_mm.tolist()),
        of_optics=optics.facts,
    )


def _freeze_kernels(
    optics: PlateOptics, path: Path, sensor: ColorSensor, grid: FreezeGrid, tell: Tell
) -> PlateReport:
    """Write a plate by its kernels, with as few wavelengths as keep colours in their place."""
    for count in WAVELENGTH_COUNTS:
        frozen = freeze(optics, sensor, replace(grid, wavelengths=count))
        psf = frozen.psf
        misplaced, _ = compared(optics, sensor, psf.kernels[0], psf.wavelengths_um, psf.depths_mm)
        tell(f"{count} wavelengths: {misplaced:.4f} of the light of a colour is misplaced")
        if misplaced <= MISPLACED_LIMIT:
            break
    else:
        raise ContractError(
            f"{count} wavelengths misplace {misplaced:.4f} of the light of a colour, more than "
            f"{MISPLACED_LIMIT}; freeze for a sensor with smoother responses"
        )
    write_psf(path, psf)
    return PlateReport(
        plate=optics.name,
        form="kernels",
        wavelengths=count,
        side_px=psf.kernels.shape[-1],
        energy_kept=frozen.energy_kept,
        misplaced=misplaced,
        depths_mm=tuple(psf.depths_mm.tolist()),
        of_optics=optics.facts,
    )


def compared(
    optics: PlateOptics,
    sensor: ColorSensor,
    kernels: FloatArray,
    wavelengths_um: FloatGrid,
    depths_mm: FloatGrid,
) -> tuple[float, float]:
    """Compare the colours of frozen kernels with those of the plate at many wavelengths.

    Args:
        optics: The plate.
        sensor: Its colours.
        kernels: (depth, wavelength, side, side), of any sum.
        wavelengths_um: Of the kernels.
        depths_mm: Of the kernels.

    Returns:
        The share of a colour's light that lies elsewhere than the plate has it, at worst: half the
        sum of the absolute differences of two kernels of sum 1. And the least sum of the kernel of
        a colour.
    """
    response_um, response = sensor.response_arrays()
    fine_um = np.linspace(response_um[0], response_um[-1], 2 * FINE_WAVELENGTHS - 1)
    many = torch.from_numpy(wavelength_weights(fine_um, response_um, response))
    few = torch.from_numpy(wavelength_weights(wavelengths_um, response_um, response))
    worst, least = 0.0, math.inf
    for depth_mm, frozen in zip(depths_mm.tolist(), kernels, strict=True):
        traced = optics.kernels(
            optics.layout(0.0, 1),
            fine_um,
            depth_mm=depth_mm,
            side_px=kernels.shape[-1],
            pitch_um=sensor.pixel_pitch_um,
        )
        light = traced.kernels[0] * traced.energy_kept[0, :, None, None]
        true = torch.einsum("cw,wyx->cyx", many, light)
        found = torch.einsum("cw,wyx->cyx", few, torch.from_numpy(frozen.astype(np.float64)))
        sums = found.sum((-2, -1), keepdim=True)
        apart = (found / sums - true / true.sum((-2, -1), keepdim=True)).abs().sum((-2, -1))
        worst, least = max(worst, float(apart.max()) / 2), min(least, float(sums.min()))
    return worst, least
