"""A lens frozen so that it can be photographed with, whatever its light does (needs torch).

small kernels -> if they lose light: peaks and haze -> if it has no peak: wide kernels
"""

import logging
from dataclasses import replace
from typing import Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.models_def.optics.diffraction.pinhole import Pinhole
from camkit.models_def.optics.freezable_optics import Optics
from camkit.models_def.optics.freezer import LEAST_WAVE_ENERGY
from camkit.models_def.optics.frozen import FreezeGrid, freeze
from camkit.models_def.optics.lens_optics import LensOptics
from camkit.models_def.optics.prescription import Lens
from camkit.models_def.optics.thin.hazy_freezing import freeze_hazy

SMALL: Final = FreezeGrid(fields=13, wavelengths=5, energy=0.995, max_side_px=151)
WIDE: Final = FreezeGrid(fields=7, wavelengths=3, energy=0.9, max_side_px=801)
HOLE: Final = FreezeGrid(fields=7, wavelengths=1, energy=0.97, max_side_px=301)

_log = logging.getLogger(__name__)


def freeze_lens(lens: Lens, sensor: ColorSensor) -> FrozenOptics:
    """Freeze a lens by the first way that holds its light.

    Raises:
        ContractError: If none does.
    """
    optics = LensOptics(lens=lens).by_rule(sensor)
    rings = LEAST_WAVE_ENERGY if optics.regime == "waves" else None
    try:
        return _plain(optics, sensor, replace(SMALL, least_energy=rings))
    except ContractError as error:
        _log.info("%s: %s", lens.name, error)
    try:
        frozen, _ = freeze_hazy(lens, sensor, tell=_tell)
    except ContractError as error:
        _log.info("%s: %s", lens.name, error)
        return _plain(optics, sensor, WIDE)
    return frozen


def freeze_hole(hole: Pinhole, sensor: ColorSensor) -> FrozenOptics:
    """Freeze a pinhole.

    Raises:
        ContractError: If its light is wider than the largest kernel.
    """
    return _plain(hole, sensor, HOLE)


def _plain(optics: Optics, sensor: ColorSensor, grid: FreezeGrid) -> FrozenOptics:
    return FrozenOptics(psf=freeze(optics, sensor, grid).psf)


def _tell(line: str) -> None:
    _log.info("%s", line)
