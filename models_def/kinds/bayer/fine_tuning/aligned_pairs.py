"""The pairs of a folder, aligned, with what of each counts.

    FOLDER/pairs.toml           see `pair_settings`
    FOLDER/capture/NAME.tiff    in sensor geometry, see `pair_photographs`
    FOLDER/reference/NAME.png   what a display showed, or a sharper photograph from the same place

A folder without `pairs.toml` may hold several such folders. Where a reference does not reach, is
clipped, or lies outside the parts that count, nothing is judged.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import CamkitError, ContractError
from camkit.models_def.kinds.bayer.fine_tuning.alignment import AlignedPair, Aligner
from camkit.models_def.kinds.bayer.fine_tuning.pair_photographs import (
    PhotographReader,
    capture_files,
    names_of,
    photograph_reader,
    reference_reader,
)
from camkit.models_def.kinds.bayer.fine_tuning.pair_settings import (
    SETTINGS,
    PairSettings,
    read_settings,
)
from camkit.models_def.kinds.bayer.fine_tuning.photographed import align_photographs
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.pictures import list_pictures


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedPair:
    """A pair of a folder.

    Attributes:
        name: Of its capture, with that of its folder where there are several.
        file: Its capture, of two halves the left one.
        pair: Capture and reference.
        settings: Of its folder.
    """

    name: str
    file: Path
    pair: AlignedPair
    settings: PairSettings

    def judged(self, first_px: tuple[int, int], size_px: tuple[int, int]) -> NDArray[np.bool_]:
        """Return which pixels of a rectangle of the capture lie in the parts that count."""
        (x, y), (width, height) = first_px, size_px
        if not self.settings.parts:
            return np.ones((height, width), dtype=bool)
        counts = np.zeros((height, width), dtype=bool)
        for x0, y0, x1, y1 in self.settings.parts:
            counts[max(y0 - y, 0) : max(y1 - y, 0), max(x0 - x, 0) : max(x1 - x, 0)] = True
        return counts

    def target(
        self, first_px: tuple[int, int], size_px: tuple[int, int]
    ) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Return the reference in a rectangle of the capture, and where it counts."""
        light, inside = self.pair.warped(first_px, size_px)
        return light, inside & self.judged(first_px, size_px)


def align_pairs(folder: Path, recipe: BayerRecipe, aligner: Aligner | None) -> Iterator[NamedPair]:
    """Yield the aligned pairs of a folder, or of the folders in it.

    Args:
        folder: See the head of the module.
        recipe: Camera.
        aligner: Of this camera; None where all references are photographs from the same place.

    Raises:
        ContractError: As of `read_pairs`.
    """
    homes = [folder]
    if not (folder / SETTINGS).is_file() and folder.is_dir():
        inner = sorted(path.parent for path in folder.glob(f"*/{SETTINGS}"))
        homes = inner or homes
    for home in homes:
        settings = read_settings(home, recipe)
        settings.depth_in(recipe)
        captures = photograph_reader(settings, recipe, home)
        readers = captures, reference_reader(settings, captures)
        for path in capture_files(list_pictures(home / "capture"), settings):
            name = path.stem if len(homes) == 1 else f"{home.name}/{path.stem}"
            try:
                pair = _align(path, settings, readers, aligner)
                yield NamedPair(name=name, file=path, pair=pair, settings=settings)
            except CamkitError as error:
                raise ContractError(f"pair {name}: {error}") from error


def _align(
    path: Path,
    settings: PairSettings,
    readers: tuple[PhotographReader, PhotographReader],
    aligner: Aligner | None,
) -> AlignedPair:
    capture, reference = readers[0](path), readers[1](_partner(path, settings))
    if aligner is not None:
        aligner.check_size(capture.light)
    if settings.reference == "photographed":
        return align_photographs(capture, reference)
    if aligner is None:
        raise ContractError('its reference must be photographed from the same place, not "shown"')
    return aligner.align(capture, reference)


def _partner(capture: Path, settings: PairSettings) -> Path:
    """Return the reference of a capture: the file of its name, of halves the left one."""
    folder, names = capture.parent.parent / "reference", names_of(capture, settings)
    if settings.reference == "shown":
        names = names[:1]
    pictures = list_pictures(folder)
    partners = [[p for p in pictures if p.stem == name] for name in names]
    for name, some in zip(names, partners, strict=True):
        if len(some) != 1:
            raise ContractError(f"{folder} must hold one picture {name}.*; got {len(some)}")
    return partners[0][0]
