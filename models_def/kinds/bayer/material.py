"""The material for samples of a camera behind a mosaic: the kernels of its lens."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from camkit.bundle.optics import PSF
from camkit.bundle.psf_file import psf_to_bytes
from camkit.bundle.reader import PRESCRIPTION
from camkit.calibration.psf_import.kernel_resampling import for_sensor
from camkit.caller import command_text, option_text
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.frames.tiles import Frames, frames_folder, read_frames
from camkit.models_def.kinds.bayer.lens_bank import build_lens_bank
from camkit.models_def.kinds.bayer.measured_bank import build_measured_bank
from camkit.models_def.kinds.bayer.psf_bank import PsfBank, read_bank, write_bank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.measured import find_measured
from camkit.models_def.optics.prescription import format_prescription

BANK: Final = "bank.npz"
PLACE: Final = "frames.txt"


@dataclass(frozen=True, slots=True, kw_only=True)
class BayerMaterial:
    """Kernels, and the lens that they were traced from.

    Attributes:
        bank: Of fabricated copies, the frozen PSF beside them.
        designed: The lens, or the measured PSF, as a bundle holds it; empty for kernels that are
            of none.
        frames: What samples are cut from, of a lens with a haze; None for one without.
    """

    bank: PsfBank
    designed: Mapping[str, bytes] = field(default_factory=dict)
    frames: Frames | None = None

    def digest(self) -> str:
        """Return the sha256 of the kernels, and of the frames."""
        return self.bank.digest() if self.frames is None else self.frames.digest()

    def write(self, folder: Path) -> None:
        """Write the kernels for another process, or the path of the frames."""
        if self.frames is None:
            write_bank(folder / BANK, self.bank)
        else:
            place = str(self.frames.folder.resolve())
            (folder / PLACE).write_text(place, encoding="utf-8")


def read_material(folder: Path) -> BayerMaterial:
    """Read a file of `BayerMaterial.write`."""
    place = folder / PLACE
    if not place.is_file():
        return BayerMaterial(bank=read_bank(folder / BANK))
    return _of_frames(Path(place.read_text(encoding="utf-8")))


def _of_frames(folder: Path, recipe: BayerRecipe | None = None) -> BayerMaterial:
    frames = read_frames(folder, recipe)
    return BayerMaterial(bank=frames.bank, designed=frames.designed, frames=frames)


def trace_material(recipe: BayerRecipe, recipe_folder: Path, cache_folder: Path) -> BayerMaterial:
    """Trace the lens that a recipe names (about a minute), read an earlier trace, or its PSF.

    Of a lens with a haze the frames are read, which `camkit prepare` photographed.

    Raises:
        ContractError: If there is no such lens, its light does not fit the kernels, or there are
            no frames of it.
    """
    if len(recipe.sensor.channels) == 1:
        raise ContractError(
            "networks and banks of colours together are trained on three colours, and the camera "
            f"{recipe.name} is grey; its filter comes by {command_text('export')} with "
            f"{option_text('network', value=False)} or {command_text('make')} for "
            "0 minutes"
        )
    if recipe.haze is not None:
        return _of_frames(frames_folder(cache_folder, recipe), recipe)
    designed = designed_optics(recipe, recipe_folder)
    if recipe.lens.psf:
        optics = find_measured(recipe.lens.psf, recipe_folder)
        return BayerMaterial(bank=build_measured_bank(recipe, optics), designed=designed)
    lens = find_lens(recipe.lens.prescription, recipe_folder)
    return BayerMaterial(bank=build_lens_bank(recipe, lens, cache_folder), designed=designed)


def designed_optics(recipe: BayerRecipe, recipe_folder: Path) -> dict[str, bytes]:
    """Return the lens that a recipe names as a bundle holds it, or its measured PSF.

    Raises:
        ContractError: If there is none.
    """
    if recipe.lens.psf:
        psf = find_measured(recipe.lens.psf, recipe_folder).psf
        sensor = recipe.sensor
        return {PSF: psf_to_bytes(for_sensor(psf, sensor.pixel_pitch_um, len(sensor.channels)))}
    lens = find_lens(recipe.lens.prescription, recipe_folder)
    return {PRESCRIPTION: format_prescription(lens).encode()}


DESIGNED: Final = designed_optics
