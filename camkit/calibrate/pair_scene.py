"""Two pictures of one plane, read by every tone curve, registered and cut into blocks."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.calibrate.pair_words import PairWords
from camkit.calibration.blur_pair.blur_errors import BlurErrors, Judge
from camkit.calibration.blur_pair.blur_search import SearchResult, search
from camkit.calibration.blur_pair.pair_grid import PairGrid, Transfer
from camkit.calibration.blur_pair.picture_pair import PicturePair, read_pairs
from camkit.calibration.blur_pair.plain_blurs import disc_transfer
from camkit.calibration.blur_pair.registration import Registration, register_pair
from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.runtime.signal.halves import Halves
from camkit.runtime.signal.tone_curve import Tone

PlainBlur = Callable[[PairGrid, float], NDArray[np.float64]]

FIRST_HALO_PX: Final = 48
LEAST_HALO_PX: Final = 16
LEAST_REACH_PX: Final = 5
REACH_OF_DISC: Final = 1.5
"""Of the diameter of the disc that fits best: how near a clipped sample may not be."""
FIRST_SIZE_PX: Final = 3.0
SIZE_STEP: Final = 0.25
"""Of the logarithm of a size."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PairScene:
    """The pictures, ready to judge predictions of the wide one.

    Attributes:
        judges: By the name of the tone curve.
        grid: Blocks.
        registration: Of the sharp picture in the wide one.
        pitch_um: Of the pixels.
        disc_px: Diameter of the disc that fits best.
        share: Of the samples that count.
    """

    judges: dict[str, Judge]
    grid: PairGrid
    registration: Registration
    pitch_um: float
    disc_px: float
    share: float

    @property
    def is_even(self) -> NDArray[np.bool_]:
        """Return which blocks are in the even half."""
        return even_blocks(self.grid)

    def errors(self, transfers: Sequence[Transfer]) -> dict[str, BlurErrors]:
        """Return the errors of a blur by every curve.

        Args:
            transfers: Of every block, or one for all.
        """
        shift = self.grid.shifted(self.registration.shift_px)
        all_transfers = [(transfer * shift).astype(np.complex64) for transfer in transfers]
        return {
            name: judge.errors(
                self.grid.blurred(
                    judge.pair.sharp, lambda b: all_transfers[b.index % len(all_transfers)]
                )
            )
            for name, judge in self.judges.items()
        }

    def plain(self, blur: PlainBlur, tone: str, size_px: float) -> SearchResult:
        """Fit the size of a blur that knows no lens; results are logarithms of px."""
        return search(
            lambda log_px: self.errors([blur(self.grid, float(np.exp(log_px)))])[tone],
            float(np.log(size_px)),
            SIZE_STEP,
            self.is_even,
        )


def read_scene_pair(
    files: Sequence[Path], tones: Sequence[Tone | None], halves: Halves | None, words: PairWords
) -> PairScene:
    """Read the pictures, and fit a disc to find how far blur reaches.

    Raises:
        ContractError: If there are not two, or nobody states the pixel pitch.
        DecodeError: If one cannot be read, or both do not belong together.
    """
    pairs = read_pairs(files, tones, halves)
    first = pairs[0]
    pitch_um = _pitch_um(first, words)
    grid = PairGrid.of(first.size, FIRST_HALO_PX)
    judge = Judge(first, grid, first.counted(LEAST_REACH_PX))

    def of_disc(log_px: float) -> BlurErrors:
        transfer = disc_transfer(grid, float(np.exp(log_px)))
        return judge.errors(grid.blurred(first.sharp, lambda _block: transfer))

    log_px = search(of_disc, np.log(FIRST_SIZE_PX), SIZE_STEP, even_blocks(grid)).best
    disc_px = float(np.exp(log_px))
    transfer = disc_transfer(grid, disc_px)
    blurred = grid.blurred(first.sharp, lambda _block: transfer)
    registration = register_pair(first, blurred, (files[0].name, files[1].name))
    reach_px = max(LEAST_REACH_PX, round(REACH_OF_DISC * disc_px))
    grid = PairGrid.of(first.size, max(LEAST_HALO_PX, 2 * reach_px))
    counts = first.counted(reach_px)
    return PairScene(
        judges={pair.name: Judge(pair, grid, counts) for pair in pairs},
        grid=grid,
        registration=registration,
        pitch_um=pitch_um,
        disc_px=disc_px,
        share=float(counts.mean()),
    )


def even_blocks(grid: PairGrid) -> NDArray[np.bool_]:
    """Return which blocks (block,) are the even ones of a checkerboard."""
    return np.array([block.is_even for block in grid.blocks()])


def _pitch_um(pair: PicturePair, words: PairWords) -> float:
    """Return the pixel pitch.

    Raises:
        ContractError: If nobody states it, or the sensor is of another size.
    """
    height, width = pair.size
    if words.sensor is not None:
        # heavy, and often not needed
        from camkit.models_def.sensors.sensor_choice import choose_sensor

        table = choose_sensor(words.sensor).table
        if (table["width_px"], table["height_px"]) != (width, height):
            raise ContractError(
                f"{option_text('sensor')} is of {table['width_px']}x{table['height_px']} px, and "
                f"the pictures have {width}x{height}; state the pitch of their pixels"
            )
        return float(table["pixel_pitch_um"])
    pitch_um = pair.pitch_um if words.pitch_um is None else words.pitch_um
    if pitch_um is None or not pitch_um > 0:
        raise ContractError(
            f"the pictures state no pixel pitch; state it by {option_text('pitch_um')}: width of "
            "the sensor over pixels of the picture's width"
        )
    return pitch_um
