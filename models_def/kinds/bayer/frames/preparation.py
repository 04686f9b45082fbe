"""Frames of a camera whose lens has a haze, as `camkit prepare` asks for them."""

from pathlib import Path
from typing import Any, Final

from camkit.bundle.frozen_optics import FrozenOptics
from camkit.bundle.haze_file import read_haze
from camkit.bundle.psf_file import read_psf
from camkit.models_def.kinds.bayer.frames.photographs import (
    FrameSources,
    check_frames,
    designed_lens,
    freeze_copies,
    prepare_frames,
)
from camkit.models_def.kinds.bayer.frames.tiles import HEADER, PARTS, frames_folder
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.thin.hazy_freezing import check_peaks
from camkit.models_def.training.preparing import PrepareOptions, Tell


class BayerPreparing:
    """Fulfils `camkit.models_def.training.preparing.PreparingKind`."""

    def written_last(self, recipe: BayerRecipe, runs: Path) -> Path:
        """Return the header of the frames."""
        check_frames(recipe)
        return frames_folder(runs, recipe) / HEADER

    def prepare(self, recipe: BayerRecipe, options: PrepareOptions, tell: Tell) -> dict[str, Any]:
        """Freeze copies of the lens and photograph frames with them."""
        pictures = dict(zip(PARTS, (options.pictures, options.valid), strict=True))
        check_frames(recipe, pictures)
        optics = FrozenOptics(psf=read_psf(options.psf), haze=read_haze(options.haze))
        lens = find_lens(recipe.lens.prescription, options.recipe_folder)
        check_peaks(lens, optics.psf, options.psf)
        sources = FrameSources(
            pictures=pictures,
            optics=optics,
            copies=freeze_copies(recipe, lens, tell),
            designed=designed_lens(lens),
            seed=options.seed,
        )
        return prepare_frames(recipe, sources, options.runs, tell)


PREPARING: Final = BayerPreparing()
