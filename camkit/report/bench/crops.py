"""The same patch of every method, as small PNGs that a page can hold."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from camkit.arrays import FloatArray
from camkit.bundle.golden import IMAGE
from camkit.colorimetry import decode_srgb, encode_srgb
from camkit.report.bench.accuracy import INPUT, Key
from camkit.report.bench.known_captures import KnownCapture
from camkit.report.figure import encode_png, levels_of
from camkit.report.quality import BORDER_PX

SIDE_PX: Final = 128
MOST_CAPTURES: Final = 4
SHARP: Final[Key] = ("sharp",)
DARK: Final = 0.2
"""Linear level below which a patch is shown brighter, so that a person sees something."""
_STEP_PX: Final = 32


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """One capture's patch by every method.

    Attributes:
        caption: What the capture is.
        pictures: Method -> PNG; `SHARP` and `INPUT` among them.
        psnr_db: Method -> PSNR inside the patch; the sharp one has none.
    """

    caption: str
    pictures: dict[Key, bytes] = field(default_factory=dict)
    psnr_db: dict[Key, float] = field(default_factory=dict)


class CropCollector:
    """Keeps the patches of some captures while all are measured."""

    def __init__(self, keys: Sequence[Key], *, every: int = 1) -> None:
        """Choose what is kept.

        Args:
            keys: Methods.
            every: Take every n-th capture, up to `MOST_CAPTURES`.
        """
        self.patches: list[Patch] = []
        self._keys = {INPUT, *keys}
        self._every = every
        self._number = -1
        self._capture: KnownCapture | None = None
        self._place: tuple[slice, slice] | None = None
        self._gain = np.float32(1)

    def take(self, key: Key, known_capture: KnownCapture, restored: FloatArray) -> None:
        """Keep the patch of a result; the first result of a capture begins a patch."""
        if known_capture is not self._capture:
            self._capture = known_capture
            self._number += 1
            is_sampled = self._number % self._every == 0 and len(self.patches) < MOST_CAPTURES
            self._place = busiest_place(known_capture.truths[IMAGE]) if is_sampled else None
            if self._place is not None:
                self._begin(known_capture, known_capture.truths[IMAGE][:, *self._place])
        if self._place is None or key not in self._keys:
            return
        linear = np.ascontiguousarray(restored[:, *self._place])
        error = encode_srgb(linear) - known_capture.truths[IMAGE][:, *self._place]
        mean_square = float(np.mean(np.square(error), dtype=np.float64))
        self.patches[-1].pictures[key] = encode_png(levels_of(encode_srgb(linear * self._gain)))
        self.patches[-1].psnr_db[key] = -10 * float(np.log10(max(mean_square, 1e-12)))

    def _begin(self, known_capture: KnownCapture, sharp: FloatArray) -> None:
        linear = decode_srgb(np.ascontiguousarray(sharp))
        self._gain = display_gain(linear)
        note = f", shown {self._gain:.0f} times brighter" if self._gain > 1 else ""
        patch = Patch(caption=known_capture.caption + note)
        patch.pictures[SHARP] = encode_png(levels_of(encode_srgb(linear * self._gain)))
        self.patches.append(patch)


def display_gain(linear: FloatArray) -> np.float32:
    """Return the whole factor that brings a dark patch's bright parts to middle grey, 1 for others.

    Args:
        linear: (3, h, w) float32 of the sharp patch.
    """
    bright = float(np.quantile(linear, 0.99))
    return np.float32(1 if bright >= DARK else max(1, round(2 * DARK / max(bright, 1e-3))))


def busiest_place(sharp: FloatArray, side_px: int = SIDE_PX) -> tuple[slice, slice]:
    """Return rows and columns of the patch with most detail inside the border that is judged.

    Args:
        sharp: (3, h, w) float32 sRGB values.
        side_px: Of the patch; less where the picture is smaller.
    """
    _, height, width = sharp.shape
    side = min(side_px, height - 2 * BORDER_PX, width - 2 * BORDER_PX)
    luma = sharp.mean(axis=0)
    detail = np.zeros_like(luma)
    detail[1:] += np.abs(np.diff(luma, axis=0))
    detail[:, 1:] += np.abs(np.diff(luma, axis=1))
    tops = range(BORDER_PX, height - BORDER_PX - side + 1, _STEP_PX)
    lefts = range(BORDER_PX, width - BORDER_PX - side + 1, _STEP_PX)
    places = [(top, left) for top in tops for left in lefts]
    top, left = max(
        places, key=lambda p: float(detail[p[0] : p[0] + side, p[1] : p[1] + side].sum())
    )
    return slice(top, top + side), slice(left, left + side)
