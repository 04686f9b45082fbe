"""Exposures at which a given share of a scene saturates a sensor.

A colour clips in the raw signal, so where the white balance raises it, it clips above white: a
pixel of the scene saturates as soon as any colour c of it exceeds the gain of c in white-balanced
camera space.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

CEILING: Final = 256.0
"""2^8 times white, where the scenes of Sun 2021, ch. 5, end."""
HEADROOM: Final = 1e-3
TOLERANCE: Final = 0.1
BAND_ROWS: Final = 256


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturation:
    """An exposure, and the share of a scene that it saturates.

    Attributes:
        exposure: Factor on the scene.
        saturated_fraction: Share of the pixels of the scene that exceed what the sensor holds, in
            any colour; by the scene alone, without the lens.
        peak: The brightest colour of the exposed scene, in times white.
    """

    exposure: float
    saturated_fraction: float
    peak: float


def fill_of(scene: FloatArray, matrix: NDArray[np.float64], gains: tuple[float, ...]) -> FloatArray:
    """Return the fill of the fullest colour of every pixel; 1.0 clips.

    Args:
        scene: (3, h, w) float32 linear Rec.709.
        matrix: (c, 3) from linear Rec.709 to white-balanced channels.
        gains: White balance of each channel.

    Returns:
        (h, w) float32.

    Raises:
        ContractError: If the scene is not (3, h, w) with a pixel.
    """
    if scene.ndim != 3 or scene.shape[0] != 3 or 0 in scene.shape:
        raise ContractError(f"a scene must be (3, h, w) and hold a pixel; got {scene.shape}")
    raw = (matrix / np.array(gains)[:, None]).astype(np.float32)
    fill = np.empty(scene.shape[1:], dtype=np.float32)
    for top in range(0, scene.shape[1], BAND_ROWS):
        rows = slice(top, top + BAND_ROWS)
        fill[rows] = np.tensordot(raw, scene[:, rows], axes=1).max(axis=0)
    return fill


def saturation_at(
    exposure: float,
    scene: FloatArray,
    matrix: NDArray[np.float64],
    gains: tuple[float, ...],
    *,
    ceiling: float | None = None,
) -> Saturation:
    """Return the shares of a scene that an exposure saturates.

    Args:
        exposure: Factor on the scene.
        scene: As `fill_of`.
        matrix: Likewise.
        gains: Likewise.
        ceiling: The most light of the exposed scene, in times white; None for no limit.
    """
    return _saturation(exposure, fill_of(scene, matrix, gains), scene, ceiling)


def saturating_exposure(
    scene: FloatArray,
    matrix: NDArray[np.float64],
    gains: tuple[float, ...],
    share: float,
    *,
    ceiling: float = CEILING,
) -> Saturation:
    """Return the least exposure at which a share of the pixels of a scene saturates.

    It is found among the values of the scene, not by trying: of n pixels, the round(n share)
    fullest exceed 1, by `HEADROOM` or half the way to the next one, and no other does.

    Args:
        scene: As `fill_of`.
        matrix: Likewise.
        gains: Likewise.
        share: Of the pixels, 0 < share < 1.
        ceiling: The most light of the exposed scene, in times white.

    Raises:
        ContractError: If the share or the ceiling is none, the scene is smaller than the share
            asks for, or so many of its brightest pixels are alike that no exposure comes within
            `TOLERANCE` of the share.
    """
    if not 0 < share < 1:
        raise ContractError(f"the share that saturates must lie between 0 and 1; got {share:g}")
    if not (ceiling > max(gains) and np.isfinite(ceiling)):
        raise ContractError(
            f"the ceiling must lie above {max(gains):g}, where the last colour clips; "
            f"got {ceiling:g}"
        )
    fill = fill_of(scene, matrix, gains)
    exposure = 1 / _threshold(fill.ravel(), share)
    return _saturation(exposure, fill, scene, ceiling)


def with_exposure(scene: FloatArray, exposure: float, *, ceiling: float = CEILING) -> FloatArray:
    """Return a scene at an exposure, which ends at a ceiling.

    Args:
        scene: (3, h, w) float32, linear, 1.0 = white.
        exposure: Factor on the scene.
        ceiling: Brightest value that stays, in times white.

    Returns:
        (3, h, w) float32, linear, 1.0 = white.
    """
    return np.asarray(np.minimum(scene * np.float32(exposure), np.float32(ceiling)))


def _saturation(
    exposure: float, fill: FloatArray, scene: FloatArray, ceiling: float | None
) -> Saturation:
    full = int(np.count_nonzero(fill > 1 / exposure))
    peak = exposure * float(scene.max())
    return Saturation(
        exposure=exposure,
        saturated_fraction=full / fill.size,
        peak=peak if ceiling is None else min(peak, ceiling),
    )


def _threshold(fill: FloatArray, share: float) -> float:
    """Return a value that a share of the values exceeds."""
    count = round(share * fill.size)
    if count < 1:
        raise ContractError(
            f"{share:.3%} of a scene of {fill.size} pixels is less than one of them; "
            "give a larger scene or share"
        )
    level = float(np.partition(fill, fill.size - count)[fill.size - count])
    above, alike = np.count_nonzero(fill > level), np.count_nonzero(fill == level)
    # values that are alike saturate together: all of them, or none
    saturated = above + alike if above + alike - count <= count - above else above
    if level <= 0 or abs(saturated - count) > max(TOLERANCE * count, 0.5):
        raise ContractError(
            f"no exposure saturates {share:.3%} of this scene: {alike / fill.size:.3%} of its "
            f"pixels are alike and {above / fill.size:.3%} are brighter; "
            "it must have lights of different brightness"
        )
    if saturated == above:
        level = float(fill[fill > level].min())
    below = max(float(np.max(fill, where=fill < level, initial=0)), level * (1 - HEADROOM) ** 2)
    return float(np.sqrt(below * level))
