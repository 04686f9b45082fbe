"""Captures that are no photographs, simulated: a scene -> what the camera records -> its file.

A kind that has a `Maker` of products has a `Recording` in its part of the runtime, where its
cameras exist as data; `camkit simulate` asks it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from camkit.bundle.reader import Bundle
from camkit.contracts import FloatArray
from camkit.errors import ContractError


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordingOptions:
    """The options of recording a scene.

    Attributes:
        photons: That are counted, whatever the sensor's detection efficiency: of a pixel that sees
            white; of captures by time, of a pixel on average. A pixel that sees all of itself
            collects as many for every sub-pixel.
        sbr: Photons of the signal over those of the background, all time bins together.
        seed: Of chance; the same seed gives the same capture.
    """

    photons: float
    sbr: float = math.inf
    seed: int = 0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.photons) and self.photons > 0):
            raise ContractError(f"photons must be a number > 0; got {self.photons}")
        if not self.sbr > 0:
            raise ContractError(f"sbr must be > 0; got {self.sbr}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A simulated capture.

    Attributes:
        name: What its array is called in files.
        values: The array.
        stated: What a file should say of it, by name.
    """

    name: str
    values: NDArray[Any]
    stated: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Recording:
    """The simulation of a kind's captures.

    Attributes:
        suffixes: Of the files that can be written, with their dots.
        record: (a picture (3, h, w) linear Rec.709, or the file of a scene, bundle, options) ->
            capture.
        write: (file, capture): writes it.
        files: A capture's file -> all files that `write` writes for it, the capture first.
    """

    suffixes: tuple[str, ...]
    record: Callable[[FloatArray | Path, Bundle, RecordingOptions], Recorded]
    write: Callable[[Path, Recorded], None]
    files: Callable[[Path], tuple[Path, ...]]
