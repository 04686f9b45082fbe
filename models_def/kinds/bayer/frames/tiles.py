"""Tiles: parts of whole frames on disk, their haze undone, not yet through the bank.

    FOLDER/tiles.json          what they were photographed with, written last
    FOLDER/bank.npz            core kernels of the lens and of its copies
    FOLDER/PART.planes.npy     (n, 3, S, S) float16, S = sample_px + 2 margin_px
    FOLDER/PART.clipped.npy    (n, S, S) bool
    FOLDER/PART.sharp.npy      (n, 3, s, s) float16, s = sample_px
    FOLDER/PART.facts.npy      (n, 7) float64, see `FACTS`

PART is `train` or `valid`. A tile is linear and white balanced, its light that of the cores; beyond
the border of the frame it is mirrored.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import PsfBank, read_bank, write_bank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.toml_table import table_digest
from camkit.models_def.training.pictures import list_pictures

HEADER: Final = "tiles.json"
BANK: Final = "bank.npz"
PARTS: Final = ("train", "valid")
FACTS: Final = ("x_mm", "y_mm", "iso", "rise_red", "rise_green", "rise_blue", "copy")
"""Of a tile: its middle from the axis, the ISO, what the variance of the noise of every colour was
multiplied by, and the copy of the lens."""
_OF_THE_POOL: Final = ("pool_samples", "first_samples", "steps_per_sample", "block_jitter_px")
"""What tiles do not depend on."""
_HEADER_KEYS: Final = {"camera", "pictures", "designed"}
"""What is read again of a header."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Tile:
    """A part of a frame.

    Attributes:
        planes: (3, S, S) float32 linear, white balanced, haze undone, with surroundings.
        clipped: (S, S) bool, where the sensor clipped.
        sharp: (3, s, s) float32 sharp light of the middle, illumination contained.
        x_mm: Of the middle from the axis, to the right.
        y_mm: Likewise, down the rows.
        iso: Sensitivity.
        noise_rise: What the variance of the noise of every colour was multiplied by.
        copy: Number of the copy of the lens.
    """

    planes: FloatArray
    clipped: NDArray[np.bool_]
    sharp: FloatArray
    x_mm: float
    y_mm: float
    iso: float
    noise_rise: tuple[float, float, float]
    copy: int


class Tiles:
    """The tiles of one part; files are mapped, not read."""

    def __init__(self, folder: Path, part: str, *, mode: Any = "r") -> None:
        """Open the files of a part, to read or (`r+`) to fill.

        Raises:
            ContractError: If one is missing or damaged.
        """
        try:
            opened = [
                np.load(folder / f"{part}.{name}.npy", mmap_mode=mode)
                for name in ("planes", "clipped", "sharp", "facts")
            ]
        except (OSError, ValueError, EOFError) as error:
            raise ContractError(
                f"the tiles ({part}) in {folder} are damaged; run `camkit prepare` again"
            ) from error
        self._planes, self._clipped, self._sharp, self._facts = opened

    def __len__(self) -> int:
        return len(self._facts)

    def read(self, index: int) -> Tile:
        """Return one tile."""
        x_mm, y_mm, iso, red, green, blue, copy = (float(v) for v in self._facts[index])
        return Tile(
            planes=self._planes[index].astype(np.float32),
            clipped=np.array(self._clipped[index]),
            sharp=self._sharp[index].astype(np.float32),
            x_mm=x_mm,
            y_mm=y_mm,
            iso=iso,
            noise_rise=(red, green, blue),
            copy=int(copy),
        )

    def store(self, index: int, tile: Tile) -> None:
        """Write one tile."""
        self._planes[index] = tile.planes.astype(np.float16)
        self._clipped[index] = tile.clipped
        self._sharp[index] = tile.sharp.astype(np.float16)
        self._facts[index] = (tile.x_mm, tile.y_mm, tile.iso, *tile.noise_rise, tile.copy)

    def facts(self, name: str) -> NDArray[np.float64]:
        """Return one of `FACTS` of all tiles."""
        return np.array(self._facts[:, FACTS.index(name)])


def create_tiles(folder: Path, part: str, count: int, recipe: BayerRecipe) -> Tiles:
    """Create the files of a part, to be filled; an existing header is deleted."""
    (folder / HEADER).unlink(missing_ok=True)
    side, inner = tile_side_px(recipe), recipe.data.sample_px
    shapes: dict[str, tuple[tuple[int, ...], Any]] = {
        "planes": ((count, 3, side, side), np.float16),
        "clipped": ((count, side, side), np.bool_),
        "sharp": ((count, 3, inner, inner), np.float16),
        "facts": ((count, len(FACTS)), np.float64),
    }
    for name, (shape, kind) in shapes.items():
        path = folder / f"{part}.{name}.npy"
        np.lib.format.open_memmap(path, mode="w+", dtype=kind, shape=shape).flush()
    return Tiles(folder, part, mode="r+")


def tile_side_px(recipe: BayerRecipe) -> int:
    """Return the side of a tile: a sample and its surroundings."""
    return recipe.data.sample_px + 2 * recipe.data.margin_px


def frames_folder(folder: Path, recipe: BayerRecipe) -> Path:
    """Return the folder of a recipe's frames below the folder of its runs."""
    return folder / f"{recipe.name}_frames"


def write_header(
    folder: Path,
    recipe: BayerRecipe,
    bank: PsfBank,
    pictures: Mapping[str, Path | None],
    designed: Mapping[str, bytes],
) -> None:
    """Write the kernels, and last of all the description of the tiles.

    Args:
        folder: Of the tiles.
        recipe: Of the camera.
        bank: Its core kernels and those of its copies.
        pictures: Part -> folder of pictures; None for procedural scenes alone.
        designed: The lens as a bundle holds it.
    """
    write_bank(folder / BANK, bank)
    header = {
        "recipe": recipe.name,
        "camera": camera_digest(recipe),
        "bank": bank.digest(),
        "facts": {part: _facts_digest(folder, part) for part in PARTS},
        "pictures": {part: names_digest(at) for part, at in pictures.items()},
        "designed": {name: data.decode() for name, data in designed.items()},
    }
    (folder / HEADER).write_text(json.dumps(header, indent=2) + "\n", encoding="utf-8")


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """The tiles of a camera, and the distances and kernels of its lens.

    Attributes:
        folder: Of the tiles.
        bank: Core kernels.
        pictures: Part -> digest of the names of its pictures.
        designed: The lens as a bundle holds it.
    """

    folder: Path
    bank: PsfBank
    pictures: Mapping[str, str]
    designed: Mapping[str, bytes]

    def digest(self) -> str:
        """Return the sha256 of the camera that photographed them."""
        return hashlib.sha256((self.folder / HEADER).read_bytes()).hexdigest()

    def tiles(self, part: str, pictures: Path | None) -> Tiles:
        """Open a part.

        Args:
            part: One of `PARTS`.
            pictures: What it should have been photographed of.

        Raises:
            ContractError: If it was photographed of other pictures.
        """
        if self.pictures[part] != names_digest(pictures):
            raise ContractError(
                f"the frames ({part}) in {self.folder} show other pictures than "
                f"{pictures or 'procedural scenes'}; name the same folders to prepare and to train"
            )
        return Tiles(self.folder, part)


def read_frames(folder: Path, recipe: BayerRecipe | None = None) -> Frames:
    """Read the frames that `camkit prepare` made for a recipe.

    Args:
        folder: Of the tiles.
        recipe: Of the camera; None where it was held against the frames before.

    Raises:
        ContractError: If there is nothing, or it was made for another camera.
    """
    try:
        header = json.loads((folder / HEADER).read_text(encoding="utf-8"))
    except OSError:
        raise ContractError(
            "samples of a lens with a haze are cut from whole frames, and there are none in "
            f"{folder}: make them with `camkit prepare`"
        ) from None
    except ValueError as error:
        raise ContractError(f"{folder / HEADER} is damaged; run `camkit prepare` again") from error
    if not isinstance(header, dict) or not header.keys() >= _HEADER_KEYS:
        raise ContractError(f"{folder / HEADER} is damaged; run `camkit prepare` again")
    if recipe is not None and header["camera"] != camera_digest(recipe):
        raise ContractError(
            f"the frames in {folder} were photographed for another recipe; run `camkit prepare` "
            "again"
        )
    return Frames(
        folder=folder,
        bank=read_bank(folder / BANK),
        pictures=header["pictures"],
        designed={name: text.encode() for name, text in header["designed"].items()},
    )


def camera_digest(recipe: BayerRecipe) -> str:
    """Return a hash of all in a recipe that decides its tiles; the bank behind them does not."""
    content = {
        "sensor": recipe.sensor.model_dump(mode="json"),
        "haze": None if recipe.haze is None else recipe.haze.model_dump(mode="json"),
        "lens": recipe.lens.to_json(),
        "frames": asdict(recipe.frames),
        "data": {k: v for k, v in recipe.data.to_json().items() if k not in _OF_THE_POOL},
    }
    return table_digest(content)


def names_digest(pictures: Path | None) -> str:
    """Return a hash of the names of the pictures of a folder; empty without one."""
    if pictures is None:
        return ""
    names = ",".join(path.name for path in list_pictures(pictures))
    return hashlib.sha256(names.encode()).hexdigest()


def _facts_digest(folder: Path, part: str) -> str:
    return hashlib.sha256((folder / f"{part}.facts.npy").read_bytes()).hexdigest()
