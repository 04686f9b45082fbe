"""The scenes on which skipping is proved: night, bokeh, texture, sky, text; none ever trained on.

Procedural ones have seeds from SEED on, which neither training (7,000,000 on) nor calibration
(8,000,000 on) uses; pictures come from folders that are held apart from training.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from camkit.arrays import FloatArray
from camkit.errors import ContractError
from camkit.report.quality import read_picture
from camkit.scenes import procedural_scene

SEED: Final = 9_000_000
PER_SUBJECT: Final = 5
WORDS: Final = (
    "lens",
    "aperture",
    "field",
    "Brennweite",
    "photon",
    "12.7",
    "f/2.8",
    "MTF",
    "lumen",
)
PICTURES: Final = {
    "night": ("valid_open/night_02_", "hdr/dikhololo_night_1k.hdr"),
    "bokeh": ("valid_open/macro_01_", "valid_open/text_04_"),
    "texture": ("valid_open/texture_19_", "valid_open/plants_03_"),
    "sky": ("valid_open/coast_07_", "valid_open/city_09_", "valid_open/landscape_03_"),
    "text": ("valid_open/text_09_",),
}
"""Subject -> pictures below the data folder; a name that ends with "_" is a beginning."""

PAPER: Final = 200
INK: Final = 10
"""Linear signal of paper and ink, 255 = white."""
_NIGHT_LIGHT: Final = 0.004
_BACKGROUND_SIGMA_PX: Final = 28.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProofScene:
    """One scene of the proof.

    Attributes:
        subject: night, bokeh, texture, sky or text.
        name: Generator and seed, or the file.
        make: Gives (3, h, w) linear Rec.709 with even sides.
    """

    subject: str
    name: str
    make: Callable[[], FloatArray]


def proof_scenes(
    height: int, width: int, data: Path | None = None, subjects: tuple[str, ...] = ()
) -> Iterator[ProofScene]:
    """Return the scenes, subject by subject.

    Args:
        height: Rows of the procedural ones.
        width: Their columns.
        data: Folder with the pictures; None for procedural scenes only.
        subjects: Only these; all when empty.

    Raises:
        ContractError: If a picture is not there.
    """
    for number, (subject, generator) in enumerate(GENERATORS.items()):
        if subjects and subject not in subjects:
            continue
        for index in range(PER_SUBJECT):
            seed = SEED + 100 * number + index
            yield ProofScene(
                subject=subject,
                name=f"{subject}:{seed}",
                make=partial(generator, seed, height, width),
            )
        for path in _pictures(subject, data):
            yield ProofScene(
                subject=subject,
                name=path.name,
                make=partial(_even_picture, path, max(height, width)),
            )


def _pictures(subject: str, data: Path | None) -> list[Path]:
    if data is None:
        return []
    return [_picture(data / name) for name in PICTURES[subject]]


def _picture(start: Path) -> Path:
    paths = sorted(start.parent.glob(f"{start.name}*"))
    if not paths:
        raise ContractError(f"no picture {start}*: give the folder that holds valid_open and hdr")
    return paths[0]


def _even_picture(path: Path, most_px: int) -> FloatArray:
    scene = read_picture(path, most_px)
    height, width = (side // 2 * 2 for side in scene.shape[1:])
    return np.ascontiguousarray(scene[:, :height, :width])


def night(seed: int, height: int, width: int) -> FloatArray:
    """Return a black surrounding with one lit place and lamps."""
    rng = np.random.default_rng(seed)
    lit = procedural_scene(seed, height, width)
    mask = _spot(rng, height, width, share=0.25)
    lamps = np.where(lit > 1.5, lit, 0) * (rng.random((1, 1, 1)) < 0.8)
    return np.asarray(lit * (_NIGHT_LIGHT + 0.6 * mask) + lamps * (1 - mask), dtype=np.float32)


def bokeh(seed: int, height: int, width: int) -> FloatArray:
    """Return a sharp subject before a background far out of focus."""
    rng = np.random.default_rng(seed)
    sharp = np.minimum(procedural_scene(seed, height, width), 1.5)
    background = np.minimum(procedural_scene(seed + 50, height, width), 1.5)
    blurred = np.stack([cv2.GaussianBlur(p, (0, 0), _BACKGROUND_SIGMA_PX) for p in background])
    mask = _spot(rng, height, width, share=0.3)
    return np.asarray(mask * sharp + (1 - mask) * blurred, dtype=np.float32)


def texture(seed: int, height: int, width: int) -> FloatArray:
    """Return texture everywhere: little can be skipped."""
    return procedural_scene(seed, height, width)


def sky(seed: int, height: int, width: int) -> FloatArray:
    """Return a clear sky over ground."""
    rng = np.random.default_rng(seed)
    ground = np.minimum(procedural_scene(seed, height, width), 1.0)
    horizon = height * rng.uniform(0.45, 0.75)
    height_share = np.linspace(0, 1, height)[:, None] * np.ones((1, width))
    top, low = np.array([0.12, 0.25, 0.55]), np.array([0.55, 0.65, 0.75])
    air = top[:, None, None] + (low - top)[:, None, None] * height_share
    edge = np.clip(np.arange(height)[:, None] - horizon + 0.5, 0, 1)
    return np.asarray(air * (1 - edge) + ground * edge, dtype=np.float32)


def text(seed: int, height: int, width: int) -> FloatArray:
    """Return a page: lines of words on paper, wide margins, a picture."""
    rng = np.random.default_rng(seed)
    page = np.full((height, width), PAPER, np.uint8)
    margin = int(0.16 * width)
    size = float(rng.uniform(0.6, 1.3))
    for y in range(int(0.2 * height), int(0.8 * height), int(44 * size)):
        line = " ".join(rng.choice(WORDS, 40))
        count = int((width - 2 * margin) / (19 * size))
        cv2.putText(
            page, line[:count], (margin, y), cv2.FONT_HERSHEY_DUPLEX, size, INK, 1, cv2.LINE_AA
        )
    paper = np.array([1.0, 0.98, 0.92], np.float32)[:, None, None]
    return np.asarray(paper * (page / np.float32(255)), dtype=np.float32)


def _spot(rng: np.random.Generator, height: int, width: int, *, share: float) -> FloatArray:
    """Return (h, w) in 0..1: an ellipse of about this share of the picture, its edge 6 px wide."""
    scale = np.sqrt(share / np.pi)
    ry, rx = height * scale * rng.uniform(0.8, 1.2), width * scale * rng.uniform(0.8, 1.2)
    cy, cx = height * rng.uniform(0.35, 0.65), width * rng.uniform(0.3, 0.7)
    y, x = np.arange(height)[:, None], np.arange(width)[None, :]
    inside = (1 - np.hypot((y - cy) / ry, (x - cx) / rx)) * min(ry, rx)
    return np.asarray(np.clip(inside / 6 + 0.5, 0, 1), dtype=np.float32)


GENERATORS: Final[dict[str, Callable[[int, int, int], FloatArray]]] = {
    "night": night,
    "bokeh": bokeh,
    "texture": texture,
    "sky": sky,
    "text": text,
}
