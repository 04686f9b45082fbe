"""Marks: four equal blocks in the corners of a screen that say which target it shows.

    cells of a block:  1 white rim | 1 black rim | 5x5 of the number | 1 black | 1 white

A number is one of the 1000 words of OpenCV's dictionary 5x5_1000, which differ in several cells
under every turn: a damaged one is mended or refused, seldom taken for another. All four blocks
carry the same word and stand upright, so that blocks check each other, the first corner of a word
tells what is up, and places tell which block is which.

References: Garrido-Jurado et al. 2014 and 2016 (ArUco).
"""

from collections import Counter
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.calibration.geometry.grey import to_codes

FloatGrid = NDArray[np.float64]

WORD_CELLS: Final = 7
"""Along the side of a word with its black rim."""
BLOCK_CELLS: Final = 9
NUMBERS: Final = 1000
LEAST_BLOCKS: Final = 3
"""Of the four, that must be seen and agree."""
SIDES_PX: Final = (1600, 1000, 640, 2400)
"""Of the copies on which blocks are looked for, one after the other."""
FINER: Final = 2
"""Times the picture that a copy may have: small cells are read better so."""
_LEAST_SHARE: Final = 0.01
_DICTIONARY: Final = cv2.aruco.DICT_5X5_1000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeenMarks:
    """Marks found in a picture.

    Attributes:
        number: What they say.
        corners: Number of a block (0 top left, 1 top right, 2 bottom right, 3 bottom left of the
            screen) -> (4, 2) x, y of the black rim's corners, the first top left, then clockwise
            as on the screen.
    """

    number: int
    corners: dict[int, FloatGrid]


def draw_word(number: int, cell_px: int) -> NDArray[np.uint8]:
    """Draw a block with its white rim, 0 or 255."""
    dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARY)
    word = cv2.aruco.generateImageMarker(dictionary, number, WORD_CELLS)
    cells = np.pad(np.asarray(word, dtype=np.uint8), 1, constant_values=255)
    return np.kron(cells, np.ones((cell_px, cell_px), dtype=np.uint8))


def find_marks(grey: FloatArray) -> SeenMarks | None:
    """Find the marks of a screen.

    Args:
        grey: (h, w), brightness that grows with light.

    Returns:
        The marks, places in px of `grey` (pixel centres at integers); None where no three blocks
        agree.
    """
    longest = max(grey.shape)
    best: SeenMarks | None = None
    for side in dict.fromkeys(min(side, FINER * longest) for side in SIDES_PX):
        scale = side / longest
        size = (round(grey.shape[1] * scale), round(grey.shape[0] * scale))
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_CUBIC
        small = cv2.resize(grey, size, interpolation=way)
        marks = _detected(to_codes(np.asarray(small, dtype=np.float32)))
        if marks is not None and (best is None or len(marks.corners) > len(best.corners)):
            factors = np.array(grey.shape[::-1]) / np.array(small.shape[::-1])
            places = {n: (at + 0.5) * factors - 0.5 for n, at in marks.corners.items()}
            best = SeenMarks(number=marks.number, corners=places)
        if best is not None and len(best.corners) == 4:
            break
    return best


def _detected(codes: NDArray[np.uint8]) -> SeenMarks | None:
    settings = cv2.aruco.DetectorParameters()
    settings.adaptiveThreshWinSizeMin = 7
    settings.adaptiveThreshWinSizeMax = 7 + 3 * (max(codes.shape) // 40)
    settings.adaptiveThreshWinSizeStep = max(4, max(codes.shape) // 40)
    settings.adaptiveThreshConstant = 3
    settings.minMarkerPerimeterRate = 4 * _LEAST_SHARE
    settings.polygonalApproxAccuracyRate = 0.06
    settings.minOtsuStdDev = 2.0
    # cells are read in their middles, where blur leaves most of them
    settings.perspectiveRemovePixelPerCell = 12
    settings.perspectiveRemoveIgnoredMarginPerCell = 0.25
    settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    dictionary = cv2.aruco.getPredefinedDictionary(_DICTIONARY)
    corners, numbers, _ = cv2.aruco.ArucoDetector(dictionary, settings).detectMarkers(codes)
    if numbers is None:
        return None
    blocks = [np.asarray(one, dtype=np.float64).reshape(4, 2) for one in corners]
    words = [int(n) for n in np.ravel(numbers)]
    number, count = Counter(words).most_common(1)[0]
    if count < LEAST_BLOCKS:
        return None
    ordered = _by_corner([block for block, n in zip(blocks, words, strict=True) if n == number])
    return None if ordered is None else SeenMarks(number=number, corners=ordered)


def _by_corner(blocks: list[FloatGrid]) -> dict[int, FloatGrid] | None:
    """Return the blocks of one word by corner of the screen, in upright orientation."""
    if not LEAST_BLOCKS <= len(blocks) <= 4:
        return None
    right = np.mean([block[1] - block[0] + block[2] - block[3] for block in blocks], axis=0)
    down = np.mean([block[3] - block[0] + block[2] - block[1] for block in blocks], axis=0)
    middles = np.array([block.mean(axis=0) for block in blocks])
    # along the sides of the words, however the screen is turned or tilted
    along = np.linalg.solve(np.stack([right, down], axis=1), middles.T).T
    halves = along > (along.min(axis=0) + along.max(axis=0)) / 2
    names = {(False, False): 0, (True, False): 1, (True, True): 2, (False, True): 3}
    ordered = {names[bool(x), bool(y)]: block for (x, y), block in zip(halves, blocks, strict=True)}
    return ordered if len(ordered) == len(blocks) else None
