"""The PSF of a plate, frozen: by core, arms and haze where it writes streaks, else by its kernels.

Its kernels are hundreds of pixels wide and meet no Wiener bank, so they are not judged by one, as
those of a lens are (`freeze_samples`). What is stated is light: how much of it the window holds,
and how much lies in another place than in the kernels of the camera's colours.
"""

import math
from dataclasses import replace
from typing import Final

import numpy as np
import torch

from camkit.arrays import FloatArray
from camkit.bundle.frozen_optics import FrozenOptics, psf_of_streaks
from camkit.bundle.sensor import ColorSensor
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.plate_optics import PlateOptics
from camkit.models_def.optics.diffraction.plate_streaks import plate_streaks
from camkit.models_def.optics.diffraction.streak_fit import NoStreaksError
from camkit.models_def.optics.freezable_optics import FloatGrid
from camkit.models_def.optics.freeze import Facts, Tell, depths_text, rounded_facts
from camkit.models_def.optics.frozen import FINE_WAVELENGTHS, FreezeGrid, freeze
from camkit.runtime.bank.psf import wavelength_weights

WAVELENGTH_COUNTS: Final = (3, 4, 5, 7, 9, 13)
MISPLACED_LIMIT: Final = 0.002
STREAKS_LIMIT: Final = 0.015
"""Of what core, arms and haze may misplace; a second peak, say, is no arm."""
WINDOW: Final = FreezeGrid(energy=0.999, max_side_px=401, least_energy=0.9)
"""The window of a plate, unless another is asked for: streaks end long before."""


def freeze_plate(
    optics: PlateOptics,
    *,
    sensor: ColorSensor,
    grid: FreezeGrid = WINDOW,
    tell: Tell = lambda _: None,
) -> tuple[FrozenOptics, Facts]:
    """Freeze the PSF of a plate.

    Args:
        optics: The plate, or its bare lens.
        sensor: Pitch and response.
        grid: Energy, largest side, depths; wavelengths are chosen here.
        tell: Takes a line for everything that was tried.

    Returns:
        Streaks, or kernels where they do not hold its light, and what was kept: `energy_kept` is
        the least share of the light of a colour inside the window, `misplaced` the largest share
        that lies elsewhere than in the kernel of that colour computed from 49 wavelengths.

    Raises:
        ContractError: If the window does not hold the wanted light, or no number of wavelengths
            keeps it in its place.
    """
    try:
        frozen = _freeze_streaks(optics, sensor, grid, tell)
    except NoStreaksError as error:
        tell(f"{error}; frozen as kernels")
        frozen = None
    return frozen or _freeze_kernels(optics, sensor, grid, tell)


def _freeze_streaks(
    optics: PlateOptics, sensor: ColorSensor, grid: FreezeGrid, tell: Tell
) -> tuple[FrozenOptics, Facts] | None:
    """Return a plate by its core, arms and haze, with the wavelengths that training sees.

    None where these do not hold its light: it writes something else.
    """
    streaks = plate_streaks(
        optics.plate,
        sensor,
        depths_mm=grid.depths_mm or optics.depths_mm,
        side_px=grid.max_side_px,
    )
    light = streaks.dense()
    misplaced, energy = compared(optics, sensor, light, streaks.wavelengths_um, streaks.depths_mm)
    tell(f"{len(streaks.angles_rad)} arms: {misplaced:.4f} of the light of a colour is misplaced")
    if misplaced > STREAKS_LIMIT:
        tell(f"more than {STREAKS_LIMIT}: frozen as kernels")
        return None
    least = grid.energy if grid.least_energy is None else grid.least_energy
    if energy < least:
        raise ContractError(
            f"core, arms and haze hold {energy:.4f} of the light, wanted {least}; raise "
            f"{option_text('max_side_px')} or lower the energy"
        )
    psf = psf_of_streaks(streaks, len(sensor.channels))
    frozen = FrozenOptics(psf=psf, streaks=streaks)
    return frozen, _facts(optics, frozen, energy, misplaced)


def _freeze_kernels(
    optics: PlateOptics, sensor: ColorSensor, grid: FreezeGrid, tell: Tell
) -> tuple[FrozenOptics, Facts]:
    """Return a plate by its kernels, with as few wavelengths as keep colours in their place."""
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
    frozen_optics = FrozenOptics(psf=psf)
    return frozen_optics, _facts(optics, frozen_optics, frozen.energy_kept, misplaced)


def _facts(optics: PlateOptics, frozen: FrozenOptics, energy: float, misplaced: float) -> Facts:
    psf = frozen.psf
    facts: Facts = {
        "plate": optics.name,
        "form": "kernels" if frozen.streaks is None else "streaks",
        "fields": 1,
        "wavelengths": psf.wavelengths_um.size,
        "side_px": psf.kernels.shape[-1],
        "energy_kept": energy,
        "misplaced": misplaced,
        "depths_mm": depths_text(psf),
    }
    return rounded_facts(facts | dict(optics.facts))


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
        color_psf = torch.einsum("cw,wyx->cyx", few, torch.from_numpy(frozen.astype(np.float64)))
        sums = color_psf.sum((-2, -1), keepdim=True)
        difference = (
            (color_psf / sums - true / true.sum((-2, -1), keepdim=True)).abs().sum((-2, -1))
        )
        worst, least = max(worst, float(difference.max()) / 2), min(least, float(sums.min()))
    return worst, least
