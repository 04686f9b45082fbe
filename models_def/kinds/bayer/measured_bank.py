"""The kernels of a recipe's measured PSF, and copies drawn within its uncertainty."""

from dataclasses import replace

import numpy as np

from camkit.calibration.psf_import.kernel_resampling import with_pitch
from camkit.calibration.psf_import.own_colours import is_of_own_colours
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import MEASURED_COLOURS, BayerRecipe
from camkit.models_def.optics.measured import MeasuredOptics
from camkit.psf import FrozenPsf, PsfUncertainty
from camkit.runtime.bank.psf import FieldKernels, color_kernels


def build_measured_bank(recipe: BayerRecipe, optics: MeasuredOptics) -> PsfBank:
    """Return the kernels of a measured PSF at the pitch of the sensor, copies beside them.

    Raises:
        ContractError: If its colours do not fit the sensor, or it does not know a depth.
    """
    choices, pitch_um = recipe.lens, recipe.sensor.pixel_pitch_um
    uncertainty = optics.uncertainty or PsfUncertainty()
    if choices.uncertainty:
        noise, shift_px, width = choices.uncertainty
        uncertainty = PsfUncertainty(noise=noise, shift_px=shift_px, width=width)
    _check_colours(recipe, optics.psf)
    count = 1 + choices.copies + choices.validation_copies
    copies = replace(optics, uncertainty=uncertainty).copies(count, choices.seed)
    psfs = [with_pitch(copy.psf, pitch_um) for copy in copies]
    depths_mm = choices.depths_mm or (None,)
    kernels = np.stack(
        [_colour_kernels(recipe, psf, depth_mm) for psf in psfs for depth_mm in depths_mm]
    )
    depths = len(depths_mm)
    nominal = psfs[0]
    return PsfBank(
        copies=kernels[depths:],
        copy_heights_mm=nominal.field_heights_mm,
        frozen=kernels[0] if depths == 1 else np.mean(kernels[:depths], axis=0),
        frozen_heights_mm=nominal.field_heights_mm,
        relative_illumination=nominal.relative_illumination,
        depths=depths,
        frozen_depths=kernels[:depths] if recipe.tells_depth else None,
        validation_copies=choices.validation_copies,
        grid_x_mm=nominal.grid_x_mm,
        grid_y_mm=nominal.grid_y_mm,
    )


def _colour_kernels(
    recipe: BayerRecipe, psf: FrozenPsf, depth_mm: float | None
) -> "np.ndarray[tuple[int, ...], np.dtype[np.float32]]":
    lookup: FieldKernels = color_kernels(psf, *recipe.sensor.response_arrays(), depth_mm=depth_mm)
    return lookup.kernels


def _check_colours(recipe: BayerRecipe, psf: FrozenPsf) -> None:
    """Refuse kernels of the sensor's own colours with another response, and the other way round."""
    assert recipe.sensor.channel_response is not None
    is_filled_in = recipe.sensor.channel_response.source == MEASURED_COLOURS
    is_own = is_of_own_colours(psf.wavelengths_um)
    if is_filled_in and not is_own and psf.wavelengths_um.size > 1:
        raise ContractError(
            f"lens.psf has kernels of the wavelengths {psf.wavelengths_um.tolist()} um; state "
            "sensor.channel_response, which weights them"
        )
    if is_own and not is_filled_in:
        raise ContractError(
            "lens.psf has one kernel for each colour of the sensor; leave sensor.channel_response "
            "out, which would mix them"
        )
