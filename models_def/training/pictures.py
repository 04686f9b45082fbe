"""Sources of sharp training crops: a folder of pictures, and procedural scenes.

Pictures are decoded once, brought to sRGB by their profiles and held with 8 bits, scenes as
float16; a crop is decoded to linear Rec.709 when it is cut.
"""

import io
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageCms

from camkit.arrays import FloatArray
from camkit.colorimetry import decode_srgb
from camkit.errors import ContractError, DecodeError
from camkit.models_def.training.recipe import SceneRecipe
from camkit.scenes import procedural_scene
from camkit.scenes.clean import edges, night, patches, with_lamps

PICTURE_ENDINGS: Final = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
SCENE_SEED: Final = 7_000_000
CANDIDATES: Final = 2
SRGB_TABLE: Final[FloatArray] = decode_srgb((np.arange(256) / 255).astype(np.float32))

Generator = np.random.Generator


def list_pictures(folder: Path | None) -> tuple[Path, ...]:
    """Return the pictures of a folder by name; none without a folder.

    Raises:
        ContractError: If a folder is named that is not there or holds no picture.
    """
    if folder is None:
        return ()
    if not folder.is_dir():
        raise ContractError(f"the picture folder {folder} is not there")
    pictures = sorted(p for p in folder.iterdir() if p.suffix.lower() in PICTURE_ENDINGS)
    if not pictures:
        raise ContractError(
            f"{folder} holds no picture with an ending of {', '.join(PICTURE_ENDINGS)}"
        )
    return tuple(pictures)


def read_picture(path: Path) -> NDArray[np.uint8]:
    """Read a picture as (h, w, 3) 8-bit sRGB, R first; the colour profile in it is applied.

    Raises:
        DecodeError: If it cannot be decoded, or its profile is none of RGB or grey.
    """
    data = np.fromfile(path, dtype=np.uint8)
    decoded = cv2.imdecode(data, cv2.IMREAD_COLOR) if data.size else None
    if decoded is None:
        raise DecodeError(f"{path.name} cannot be decoded as a picture")
    picture = np.ascontiguousarray(decoded[..., ::-1], dtype=np.uint8)
    profile = _profile(path)
    return picture if profile is None else _to_srgb(picture, profile, path.name)


def _profile(path: Path) -> bytes | None:
    """Return the colour profile (ICC) of a picture; None without one."""
    try:
        with warnings.catch_warnings():
            # pixels are not decoded here, so their number does not matter
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with Image.open(path) as opened:
                profile = opened.info.get("icc_profile")
    except (OSError, ValueError, Image.DecompressionBombError):
        return None  # what OpenCV alone reads has none that is known
    return profile or None


def _to_srgb(picture: NDArray[np.uint8], profile: bytes, name: str) -> NDArray[np.uint8]:
    """Return a picture in sRGB by LittleCMS; one that says it is sRGB is left as it is."""
    try:
        embedded = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        space = embedded.profile.xcolor_space.strip()
        described = ImageCms.getProfileDescription(embedded)
        if described.lower().startswith("srgb"):
            return picture
        if space not in ("RGB", "GRAY"):
            raise DecodeError(f"{name} has a colour profile of {space}; convert it to RGB")
        source = Image.fromarray(picture if space == "RGB" else picture[..., 0])
        srgb = ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(source, embedded, srgb, outputMode="RGB")
    except (OSError, ImageCms.PyCMSError) as error:
        raise DecodeError(f"{name} has a colour profile that cannot be applied: {error}") from error
    return np.array(converted, dtype=np.uint8)


def to_linear(picture: NDArray[np.uint8]) -> FloatArray:
    """Return (3, h, w) float32 linear Rec.709 from (h, w, 3) 8-bit sRGB."""
    return np.ascontiguousarray(SRGB_TABLE[picture].transpose(2, 0, 1))


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawnShares:
    """Shares of drawn scenes whose truth is known to the last pixel.

    Attributes:
        edge: Probability of clean edges instead of a picture or scene.
        night: Probability of stars and discs on black.
        patch: Probability of a chart of patches in any colour.
        lamp: Probability of lamps in whatever else is drawn.
    """

    edge: float = 0.0
    night: float = 0.0
    patch: float = 0.0
    lamp: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SceneSource:
    """Draws sharp crops.

    Attributes:
        pictures: Files to cut from; may be empty.
        picture_share: Probability of a picture rather than a procedural scene.
        scenes: Number of different procedural scenes.
        scene_px: Their side.
        drawn_shares: How often something else is drawn.
        first_scene: Number of the first procedural scene; others draw other scenes.
    """

    pictures: Sequence[Path]
    picture_share: float
    scenes: int
    scene_px: int
    _cache: dict[int, NDArray[Any]]
    drawn_shares: DrawnShares = DrawnShares()
    first_scene: int = 0

    def draw_crop(self, rng: Generator, side_px: int) -> FloatArray:
        """Cut a random crop, the livelier of two candidates of one picture.

        Returns:
            (3, side_px, side_px) float32 linear Rec.709; a smaller picture is mirrored outwards.
        """
        lit = self.drawn_shares.lamp > 0 and rng.random() < self.drawn_shares.lamp
        crop = self._draw_unlit(rng, side_px)
        return with_lamps(rng, crop) if lit else crop

    def _draw_unlit(self, rng: Generator, side_px: int) -> FloatArray:
        odds = self.drawn_shares
        shares = (odds.edge, edges), (odds.night, night), (odds.patch, patches)
        if sum(share for share, _ in shares):
            chance = rng.random()  # only where asked for: other recipes keep their samples
            for share, draw in shares:
                if chance < share:
                    return draw(rng, side_px)
                chance -= share
        picture = self._draw_picture(rng)
        crops = [_cut(rng, picture, side_px) for _ in range(CANDIDATES)]
        best = max(crops, key=_liveliness)
        if best.dtype == np.uint8:
            return to_linear(best)
        return np.ascontiguousarray(best.transpose(2, 0, 1), dtype=np.float32)

    def _draw_picture(self, rng: Generator) -> NDArray[Any]:
        """Return (h, w, 3) uint8 sRGB of a picture or float16 linear of a scene."""
        from_file = bool(self.pictures) and rng.random() < self.picture_share
        if from_file:
            key = int(rng.integers(len(self.pictures)))
            if key not in self._cache:
                self._cache[key] = read_picture(self.pictures[key])
            return self._cache[key]
        number = int(rng.integers(self.scenes))
        key = -1 - number
        if key not in self._cache:
            seed = SCENE_SEED + self.first_scene + number
            scene = procedural_scene(seed, self.scene_px, self.scene_px)
            self._cache[key] = scene.transpose(1, 2, 0).astype(np.float16)
        return self._cache[key]


def open_source(
    folder: Path | None,
    *,
    picture_share: float,
    scenes: int,
    scene_px: int,
    drawn_shares: DrawnShares = DrawnShares(),
    first_scene: int = 0,
) -> SceneSource:
    """Open a source of crops; without a folder it is procedural only."""
    return SceneSource(
        pictures=list_pictures(folder),
        picture_share=picture_share,
        scenes=scenes,
        scene_px=scene_px,
        _cache={},
        drawn_shares=drawn_shares,
        first_scene=first_scene,
    )


def open_scenes(
    data: SceneRecipe,
    folder: Path | None,
    *,
    picture_share: float | None = None,
    drawn_shares: DrawnShares = DrawnShares(),
    first_scene: int = 0,
) -> SceneSource:
    """Open the scenes of a recipe, see `open_source`; None takes the recipe's share of pictures."""
    return open_source(
        folder,
        picture_share=data.picture_share if picture_share is None else picture_share,
        scenes=data.procedural_scenes,
        scene_px=data.scene_px,
        drawn_shares=drawn_shares,
        first_scene=first_scene,
    )


def _cut(rng: Generator, picture: NDArray[Any], side_px: int) -> NDArray[Any]:
    height, width, _ = picture.shape
    missing = (max(0, side_px - height), max(0, side_px - width), 0)
    if any(missing):
        margins = [(m // 2, m - m // 2) for m in missing]
        picture = np.pad(picture, margins, mode="symmetric")
        height, width, _ = picture.shape
    y = int(rng.integers(height - side_px + 1))
    x = int(rng.integers(width - side_px + 1))
    return picture[y : y + side_px, x : x + side_px]


def _liveliness(crop: NDArray[Any]) -> float:
    """Rate a crop by the mean step between neighbours of its centre, in its own encoding."""
    quarter = crop.shape[0] // 4
    green = crop[quarter : -quarter or None : 2, quarter : -quarter or None, 1].astype(np.float32)
    return float(np.abs(np.diff(np.sqrt(green), axis=1)).mean())
