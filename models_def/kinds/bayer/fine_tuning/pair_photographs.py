"""The files of real pairs as linear light: captures, and references shown or photographed.

mosaic    16-bit linear camera colours, as `camkit process --bundle none` writes them
planes    whatever `camkit process` develops: by a tone curve, as the mean of two halves
shown     8-bit sRGB, what a display was given
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import RGB
from camkit.errors import ContractError, DecodeError
from camkit.models_def.kinds.bayer.fine_tuning.pair_settings import PairSettings
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.training.pictures import read_picture, to_linear
from camkit.runtime.options import Options
from camkit.runtime.signal.halves import right_half, without_right_halves
from camkit.runtime.signal.tone_curve import CURVES, Tone, read_tone

CLIPPED_ABOVE: Final = 0.999


@dataclass(frozen=True, slots=True, kw_only=True)
class Photograph:
    """Linear light of one file, or of two halves.

    Attributes:
        light: (3, h, w), white = 1.
        clipped: (h, w) whether a colour clipped: its light is unknown.
    """

    light: FloatArray
    clipped: NDArray[np.bool_]


PhotographReader = Callable[[Path], Photograph]


def photograph_reader(
    settings: PairSettings, recipe: BayerRecipe, folder: Path
) -> PhotographReader:
    """Return the reader of the captures of a folder.

    Args:
        settings: Of the folder.
        recipe: Its sensor decides: a mosaic has 16-bit linear camera colours, planes have whatever
            `camkit process` develops.
        folder: That a curve of tones is relative to.

    Raises:
        ContractError: If the curve is none.
    """
    if recipe.sensor.cfa is not None:
        return lambda path: _of_light(read_capture(path))
    tone: Tone | None = None
    if settings.tone:
        tone = read_tone(settings.tone if settings.tone in CURVES else folder / settings.tone)
    options = Options(tone=tone, halves=settings.pair_of_halves)
    return lambda path: _read_developed(path, options)


def reference_reader(settings: PairSettings, captures: PhotographReader) -> PhotographReader:
    """Return the reader of the references of a folder, given that of its captures."""
    if settings.reference == "photographed":
        return captures
    return _read_shown


def capture_files(files: tuple[Path, ...], settings: PairSettings) -> tuple[Path, ...]:
    """Return files without those that are the right half of another."""
    return tuple(without_right_halves(files, settings.pair_of_halves))


def names_of(path: Path, settings: PairSettings) -> tuple[str, ...]:
    """Return the names, without endings, of the files that a photograph consists of."""
    halves = settings.pair_of_halves
    return (path.stem,) if halves is None else (path.stem, right_half(path, halves).stem)


def read_capture(path: Path) -> FloatArray:
    """Read a 16-bit RGB picture as (3, h, w) in 0..1.

    Raises:
        DecodeError: If it cannot be decoded.
        ContractError: If it is of another kind.
    """
    data = np.fromfile(path, dtype=np.uint8)
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    if decoded is None:
        raise DecodeError(f"{path.name} cannot be decoded as a picture")
    if decoded.dtype != np.uint16 or decoded.ndim != 3 or decoded.shape[2] != 3:
        raise ContractError(
            f"a capture must be 16-bit RGB, linear; got {decoded.dtype} {decoded.shape}"
        )
    planes = decoded[..., ::-1].transpose(2, 0, 1).astype(np.float32)
    return np.ascontiguousarray(planes / np.float32(65535))


def _read_shown(path: Path) -> Photograph:
    light = to_linear(read_picture(path))
    return Photograph(light=light, clipped=np.zeros(light.shape[1:], dtype=bool))


def _of_light(light: FloatArray) -> Photograph:
    return Photograph(light=light, clipped=light.max(0) >= CLIPPED_ABOVE)


def _read_developed(path: Path, options: Options) -> Photograph:
    from camkit.runtime.kinds import bayer  # onnxruntime, which training has no need of

    capture: Any = bayer.read(path, None, None, options)
    if capture.is_of_mosaic or capture.channels != len(RGB):
        raise ContractError(f"{path.name} must be a developed picture of three colours")
    light = np.asarray(capture.linear_rows(0, capture.height), dtype=np.float32)
    clipped = np.any(capture.saturated_rows(0, capture.height), axis=0)
    return Photograph(light=np.ascontiguousarray(light), clipped=np.asarray(clipped))
