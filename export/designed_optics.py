"""The design of a bundle's optics, as the bundle records it: a lens, a plate, or nothing.

checkpoints, or a file of the user -> checked against the frozen PSF -> members of the bundle
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

import numpy as np
import torch

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.reader import PLATE, PRESCRIPTION
from camkit.calibration.psf_import.kernel_resampling import window
from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.export.parts import PSF_NAME, Parts
from camkit.models_def.optics.diffraction.plate import (
    Plate,
    plate_members,
    plate_of_members,
    read_plate,
)
from camkit.models_def.optics.diffraction.wave import PixelGrid
from camkit.models_def.optics.distortion import check_distortion
from camkit.models_def.optics.lens_file.lens_file import read_configured_lens, read_lens
from camkit.models_def.optics.lens_file.states import plain_lens
from camkit.models_def.optics.prescription import Lens, format_prescription, parse_prescription
from camkit.models_def.optics.thin.hazy_freezing import check_peaks
from camkit.models_def.training.checkpoint import Checkpoint
from camkit.psf import FrozenPsf

MEASURED_TOLERANCE: Final = 0.02
"""Of the peak: what windows, resampling and half floats change in a kernel."""
SAME_PLATE_SHARE: Final = 0.015
"""Of the light of the middle wavelength. Built-in plates frozen for one sensor differ by 0.029 and
more from each other, and by 0.008 at most from what was computed of them."""


def designed_members(
    parts: Parts, designed: Mapping[str, bytes], optics: FrozenOptics
) -> dict[str, bytes]:
    """Return the lens or the plate of a camera as members of its bundle: name -> content.

    None where the camera has neither, or a checkpoint does not carry it.

    Args:
        parts: What the caller names.
        designed: The optics of the checkpoints, or of the recipe; see `designed_of`.
        optics: Frozen.

    Raises:
        ContractError: If there are a lens and a plate, or the PSF was not frozen from them, or the
            lens lacks one of its configurations.
        CamkitError: If a lens is wrong, see `read_lens`.
    """
    lens, plate = _lens_of(parts, designed, optics), _plate_of(parts, designed)
    if lens is not None and plate is not None:
        raise ContractError(
            f"a bundle holds a lens or a plate; here are the lens {lens.name} and the plate "
            f"{plate.name}"
        )
    psf_file = parts.psf or Path(PSF_NAME)
    # written afresh: the bundle carries the user's glasses and is TOML, whatever came in
    if lens is not None:
        check = check_distortion if parts.haze is None else check_peaks
        for one, psf in _looked_at(lens, optics):
            check(one, psf, psf_file)
        return {PRESCRIPTION: format_prescription(lens).encode()}
    if plate is not None:
        _check_plate(plate, optics.psf, psf_file)
        return plate_members(plate)
    return {}


def designed_of(checkpoints: Iterable[Checkpoint]) -> Mapping[str, bytes]:
    """Return the optics that checkpoints carry; old checkpoints carry none.

    Raises:
        ContractError: If they are of different optics.
    """
    distinct: list[Mapping[str, bytes]] = []
    for checkpoint in checkpoints:
        if checkpoint.designed and checkpoint.designed not in distinct:
            distinct.append(checkpoint.designed)
    if len(distinct) > 1:
        raise ContractError(
            "the checkpoints were trained with different optics; train them for one lens or plate"
        )
    return distinct[0] if distinct else {}


def _looked_at(lens: Lens, optics: FrozenOptics) -> list[tuple[Lens, FrozenPsf]]:
    """Return the lens in every configuration of the optics, beside the kernels of each."""
    if not optics.states:
        return [(lens, optics.psf)]
    names = {state.name for state in lens.configurations}
    if missing := [state.name for state in optics.states if state.name not in names]:
        raise ContractError(
            f"the PSF holds the configurations {', '.join(missing)}, which the lens {lens.name} "
            f"lacks; name its file by {option_text('prescription')}"
        )
    return [(plain_lens(lens, state.name), state.psf) for state in optics.states]


def _lens_of(parts: Parts, designed: Mapping[str, bytes], optics: FrozenOptics) -> Lens | None:
    if parts.prescription is not None:
        if optics.states:
            return read_configured_lens(parts.prescription)[0]
        return read_lens(parts.prescription)
    return parse_prescription(designed[PRESCRIPTION].decode()) if PRESCRIPTION in designed else None


def _plate_of(parts: Parts, designed: Mapping[str, bytes]) -> Plate | None:
    if parts.plate is not None:
        return read_plate(parts.plate)
    if PLATE not in designed or parts.without_plate:
        return None
    return plate_of_members(designed, "the checkpoints")


def check_measured(measured: FrozenPsf, psf: FrozenPsf, path: Path) -> None:
    """Refuse a PSF that was frozen from other kernels than those that a recipe names.

    Args:
        measured: What the recipe names, at the pitch of its sensor.
        psf: Frozen, at that pitch.
        path: Its file.

    Raises:
        ContractError: If places, colours or kernels are others.
    """
    of_same = (
        psf.symmetry == measured.symmetry
        and psf.field_heights_mm.shape == measured.field_heights_mm.shape
        and psf.wavelengths_um.shape == measured.wavelengths_um.shape
        and np.allclose(psf.field_heights_mm, measured.field_heights_mm)
        and np.allclose(psf.wavelengths_um, measured.wavelengths_um)
    )
    if of_same:
        side_px = min(psf.kernels.shape[-1], measured.kernels.shape[-1])
        ours, theirs = (
            window(kernels[:, -1].astype(np.float64), side_px)
            for kernels in (psf.kernels, measured.kernels)
        )
        ours, theirs = (k / k.sum((-2, -1), keepdims=True) for k in (ours, theirs))
        of_same = bool(np.abs(ours - theirs).max() <= MEASURED_TOLERANCE * theirs.max())
    if not of_same:
        raise ContractError(
            f"{path} was not frozen from the PSF that the recipe names in lens.psf: remove it, or "
            f"freeze that PSF anew by {command_text('freeze')}"
        )


def _check_plate(plate: Plate, psf: FrozenPsf, path: Path) -> None:
    """Refuse a PSF that was frozen from another plate: no two send light to the same places."""
    middle = psf.wavelengths_um.size // 2
    frozen = psf.kernels[0, 0, middle].astype(np.float64)
    grid = PixelGrid(side_px=frozen.shape[-1], pitch_um=psf.pixel_pitch_um)
    with torch.no_grad():
        light = plate.psf(float(psf.wavelengths_um[middle]), grid, float(psf.depths_mm[0]))
    computed = light.to(torch.float64).numpy()
    elsewhere = float(np.abs(computed / computed.sum() - frozen / frozen.sum()).sum() / 2)
    if elsewhere > SAME_PLATE_SHARE:
        raise ContractError(
            f"{path} was not frozen from the plate {plate.name}: {elsewhere:.1%} of the light lies "
            "elsewhere; freeze, train and export the same plate. A PSF that was measured has none: "
            f"use {option_text('plate', 'none')}"
        )
