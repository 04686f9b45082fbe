"""Two pictures of one plane by one camera: wide open, and stopped down until it is nearly sharp."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.sensor import RGB
from camkit.caller import command_text, option_text
from camkit.errors import ContractError, DecodeError
from camkit.runtime.capture import Capture
from camkit.runtime.raw import read_capture
from camkit.runtime.signal.halves import Halves, mean_of_halves, right_half
from camkit.runtime.signal.tone_curve import SRGB_CURVE, Tone

FloatGrid = NDArray[np.float64]
Mask = NDArray[np.bool_]

BORDER_PX: Final = 16
LEAST_SHARE: Final = 0.02
"""Of a picture that must count."""
_CODES: Final = 4096
_AS_STATED: Final = "as the file states"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PicturePair:
    """Two pictures in light, white at 1.

    Attributes:
        wide: (3, h, w) float32, blurred.
        sharp: (3, h, w) float32.
        clipped: (3, h, w), in the one or the other.
        tone: Curve that codes were read by; None for what the files state.
        pitch_um: That the files state, if they do.
    """

    wide: FloatArray
    sharp: FloatArray
    clipped: Mask
    tone: Tone | None
    pitch_um: float | None

    @property
    def name(self) -> str:
        """Return the name of the curve."""
        return _AS_STATED if self.tone is None else self.tone.name

    @property
    def size(self) -> tuple[int, int]:
        """Return height and width, px."""
        return self.wide.shape[1], self.wide.shape[2]

    def codes_of(self, light: FloatArray) -> FloatArray:
        """Return codes 0..1 of light: by the curve of the pictures, of linear ones by sRGB."""
        table, codes = self._table()
        return np.interp(light, table, codes).astype(np.float32)

    def code_slopes(self, light: FloatArray) -> FloatArray:
        """Return the change of a code with light, at some light."""
        table, codes = self._table()
        slopes = np.gradient(codes, np.maximum.accumulate(table + 1e-9 * codes))
        return np.interp(light, table, slopes).astype(np.float32)

    def _table(self) -> tuple[FloatGrid, FloatGrid]:
        tone = self.tone
        if tone is None or tone.is_linear:
            tone = Tone(name=SRGB_CURVE)
        codes = np.linspace(0, 1, _CODES)
        return tone.light_at(codes), codes

    def counted(self, reach_px: int) -> Mask:
        """Return what counts (h, w): no clipped sample of any colour within a reach, no border.

        Developed colours are mixtures of the sensor's, so a clipped one spoils the others.

        Raises:
            DecodeError: If next to nothing is left.
        """
        side = 2 * reach_px + 1
        disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side))
        counts = cv2.dilate(self.clipped.any(0).astype(np.uint8), disc) == 0
        border = max(BORDER_PX, reach_px)
        counts[:border] = counts[-border:] = False
        counts[:, :border] = counts[:, -border:] = False
        if not counts.mean() > LEAST_SHARE:
            raise DecodeError(
                f"{counts.mean():.1%} of the picture lies {reach_px} px away from clipped samples "
                f"and {border} px from the border, more than {LEAST_SHARE:.0%} is needed; expose "
                "less"
            )
        return np.asarray(counts)


def read_pairs(
    files: Sequence[Path], tones: Sequence[Tone | None], halves: Halves | None = None
) -> list[PicturePair]:
    """Read the wide and the sharp picture by every tone curve; what counts is the same for all.

    Args:
        files: The wide picture and the sharp one; of dual pixels the left halves.
        tones: Curves; None for what the files state.
        halves: Texts by which left and right halves differ; None for whole pictures.

    Raises:
        ContractError: If there are not two.
        DecodeError: If one cannot be read, is a mosaic or grey, or they differ in size.
    """
    if len(files) != 2:
        raise ContractError(
            f"expected two pictures, the wide one and the sharp one; got {len(files)}: "
            f"{', '.join(file.name for file in files)}"
        )
    readings = []
    for tone in tones:
        wide, sharp = (_read(file, tone, halves) for file in files)
        if (wide.height, wide.width) != (sharp.height, sharp.width):
            raise DecodeError(
                f"{files[0].name} has {wide.width}x{wide.height} px and {files[1].name} "
                f"{sharp.width}x{sharp.height}; give two pictures of one size"
            )
        readings.append((wide, sharp))
    clipped = np.zeros(readings[0][0].samples.shape, dtype=bool)
    for capture in (one for both in readings for one in both):
        clipped |= capture.saturated_rows(0, capture.height) | (capture.samples <= 0)
    return [
        PicturePair(
            wide=_light(wide),
            sharp=_light(sharp),
            clipped=clipped,
            tone=tone,
            pitch_um=wide.pixel_pitch_um,
        )
        for (wide, sharp), tone in zip(readings, tones, strict=True)
    ]


def _read(file: Path, tone: Tone | None, halves: Halves | None) -> Capture:
    """Read one picture, the mean of its halves where it has them."""
    capture = read_capture(file, tone=tone)
    if halves is not None:
        other = right_half(file, halves)
        capture = mean_of_halves(capture, read_capture(other, tone=tone), (file.name, other.name))
    if capture.cfa is not None or capture.channels != len(RGB):
        what = "a mosaic" if capture.cfa is not None else "a grey picture"
        raise DecodeError(
            f"{file.name} is {what}; give developed pictures of three colours, such as "
            f"{command_text('process')} writes with {option_text('bundle', 'none')}"
        )
    return capture


def _light(capture: Capture) -> FloatArray:
    return (capture.samples / np.float32(capture.white_level)).astype(np.float32)
