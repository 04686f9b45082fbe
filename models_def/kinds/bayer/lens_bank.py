"""The kernels of a recipe's lens: fabricated copies traced densely, the design beside them."""

import hashlib
import json
from itertools import product
from pathlib import Path
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import PsfBank, read_bank, write_bank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import corner_height_mm
from camkit.models_def.optics.analysis.psf_model import PsfRegime, checked_regime, sensor_model
from camkit.models_def.optics.kernel_bank import (
    ChannelResponse,
    colour_kernels,
    focused_copies,
)
from camkit.models_def.optics.prescription import Lens, format_prescription
from camkit.models_def.optics.psf import with_object_distance
from camkit.models_def.optics.render.illumination import relative_illumination_at
from camkit.models_def.time_limit import check_time
from camkit.progress import working
from camkit.runtime.output.part_file import atomic_output

LEAST_ENERGY: Final = 0.97
TRACING: Final = 2
"""Counts how kernels and light have been traced so far: what was kept before is traced again."""


def build_lens_bank(recipe: BayerRecipe, lens: Lens, cache_folder: Path | None = None) -> PsfBank:
    """Trace the lens of a recipe, or read what an earlier call traced.

    Args:
        recipe: Its `lens` says how many copies and fields.
        lens: The lens that it names (`find_lens`).
        cache_folder: Where traced banks are kept; None keeps none.

    Raises:
        ContractError: If the light of the lens does not fit the kernels.
    """
    if cache_folder is None:
        return _trace(recipe, lens, _regime(recipe, lens), None)
    content = [format_prescription(lens), json.dumps(recipe.lens.to_json())]
    content += [recipe.sensor.model_dump_json(), str(TRACING)]
    content += ["depths apart"] if recipe.tells_depth else []
    regime = _regime(recipe, lens)
    # files of rays keep their names
    content += [regime] if regime == "waves" else []
    name = hashlib.sha256("".join(content).encode()).hexdigest()[:16]
    cached = cache_folder / f"bank-{name}.npz"
    if not cached.exists():
        cache_folder.mkdir(parents=True, exist_ok=True)
        write_bank(cached, _trace(recipe, lens, regime, cached))
        for part in cache_folder.glob(f"{cached.stem}.*.npy"):
            part.unlink(missing_ok=True)
    return read_bank(cached)


def _regime(recipe: BayerRecipe, lens: Lens) -> PsfRegime:
    """Return the PSF model of a recipe's lens, the same as `freeze` takes."""
    regime = checked_regime(recipe.lens.psf_model, "lens.psf_model")
    response = recipe.sensor.response_arrays()
    return regime or sensor_model(lens, corner_height_mm(recipe), *response).regime


def _trace(recipe: BayerRecipe, lens: Lens, regime: PsfRegime, cached: Path | None) -> PsfBank:
    choices = recipe.lens
    heights = _heights_mm(recipe)
    depths_mm = choices.depths_mm or (lens.object_distance_mm,)
    copies = focused_copies(lens, 1 + choices.copies + choices.validation_copies, choices.seed)
    places = list(product(copies, depths_mm))
    if choices.bank_in_focus:
        places.append((copies[0], lens.object_distance_mm))
    kernels: list[FloatArray] = []
    reused = 0
    with working("tracing the lens and its copies", len(places), unit="copies") as task:
        for number, (copy, depth_mm) in enumerate(places):
            # a run that its limit or its user ended goes on from here
            part = None if cached is None else cached.with_suffix(f".{number}.npy")
            if part is not None and part.exists():
                kernels.append(np.load(part, allow_pickle=False))
                reused += 1
                task.begin(reused)
                continue
            check_time("copies of the lens", number, len(places), reused=reused)
            task.count(number)
            kernels.append(_kernels(recipe, with_object_distance(copy, depth_mm), regime))
            if part is not None:
                with atomic_output(part) as draft, draft.open("wb") as file:
                    np.save(file, kernels[-1])
    depths = len(depths_mm)
    nominal = kernels[0] if depths == 1 else np.mean(kernels[:depths], axis=0)
    if choices.bank_in_focus:
        nominal = kernels.pop()
    return PsfBank(
        copies=np.stack(kernels[depths:]),
        copy_heights_mm=heights,
        frozen=nominal,
        frozen_heights_mm=heights,
        relative_illumination=relative_illumination_at(lens, torch.from_numpy(heights)).numpy(),
        depths=depths,
        frozen_depths=np.stack(kernels[:depths]) if recipe.tells_depth else None,
        validation_copies=choices.validation_copies,
    )


def _kernels(recipe: BayerRecipe, lens: Lens, regime: PsfRegime) -> FloatArray:
    """Trace the (field, c, h, w) kernels of one copy at one distance."""
    choices = recipe.lens
    traced, energy = colour_kernels(
        lens,
        _response(recipe),
        _heights_mm(recipe),
        size_px=choices.kernel_px,
        pitch_um=recipe.sensor.pixel_pitch_um,
        rays=choices.rays,
        regime=regime,
    )
    if energy < LEAST_ENERGY:
        raise ContractError(
            f"kernels of {choices.kernel_px} px hold {energy:.3f} of the light, less than "
            f"{LEAST_ENERGY}; raise lens.kernel_px"
        )
    return traced


def _heights_mm(recipe: BayerRecipe) -> NDArray[np.float64]:
    return np.linspace(0.0, corner_height_mm(recipe), recipe.lens.fields)


def _response(recipe: BayerRecipe) -> ChannelResponse:
    """Resample the sensor's response so finely that lateral colour leaves no steps."""
    wavelengths_um, response = recipe.sensor.response_arrays()
    dense = np.linspace(wavelengths_um[0], wavelengths_um[-1], recipe.lens.wavelengths)
    sampled = np.stack([np.interp(dense, wavelengths_um, row) for row in response])
    return ChannelResponse(
        wavelengths_um=dense,
        response=sampled / sampled.sum(axis=1, keepdims=True),
        source="the sensor of the recipe",
    )
