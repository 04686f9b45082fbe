"""What the samples of a camera behind a mosaic are made with: the kernels of its lens."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from camkit.bundle.reader import PRESCRIPTION
from camkit.models_def.kinds.bayer.lens_bank import build_lens_bank
from camkit.models_def.kinds.bayer.psf_bank import PsfBank, read_bank, write_bank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.optics.lens_file.lens_file import find_lens
from camkit.models_def.optics.prescription import format_prescription

BANK: Final = "bank.npz"


@dataclass(frozen=True, slots=True, kw_only=True)
class BayerMaterial:
    """Kernels, and the lens that they were traced from.

    Attributes:
        bank: Of fabricated copies, the frozen PSF beside them.
        designed: The lens as a bundle holds it; empty for kernels that are of none.
    """

    bank: PsfBank
    designed: Mapping[str, bytes] = field(default_factory=dict)

    def digest(self) -> str:
        """Give the sha256 of the kernels."""
        return self.bank.digest()

    def write(self, folder: Path) -> None:
        """Write the kernels for another process."""
        write_bank(folder / BANK, self.bank)


def read_material(folder: Path) -> BayerMaterial:
    """Read what `BayerMaterial.write` wrote: samples need no more than the kernels."""
    return BayerMaterial(bank=read_bank(folder / BANK))


def trace_material(recipe: BayerRecipe, recipe_folder: Path, cache_folder: Path) -> BayerMaterial:
    """Trace the lens that a recipe names (about a minute), or read what was traced before.

    Raises:
        ContractError: If there is no such lens, or its light does not fit the kernels.
    """
    lens = find_lens(recipe.lens.prescription, recipe_folder)
    bank = build_lens_bank(recipe, lens, cache_folder)
    return BayerMaterial(bank=bank, designed={PRESCRIPTION: format_prescription(lens).encode()})
