"""Bars of full contrast behind optics: what two pixels on them see, and who can tell them apart.

    lines of a point's image -> contrast -> two pixels, recorded again and again -> shares

Bars are as wide as the gaps between them and fill all of the scene that throws light here. One
pixel lies in the middle of a bright bar, the other in the middle of the dark one beside it, both
where the peak puts them. Nominally one sees white and the other nothing.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import norm

from camkit.bundle.sensor import ColorSensor
from camkit.errors import ContractError
from camkit.noise import NoiseModel
from camkit.report.analysis.point_image import Array, Direction, PointImage
from camkit.runtime.twin.exposure import Setting, levels_of, noise_of, record, variance_of

CONFIDENCE: Final = 0.95
"""With which a difference must be said to be one, and of the interval of a share."""
NOMINAL: Final = 1.0
"""Contrast of the bars."""
TOLERANCE: Final = 0.5
"""Of the nominal contrast, in the CDP of the standard."""
WHITE: Final = 0.9
"""Signal of an even white scene on the axis; the exposure of every lens is set to it."""
PAIRS: Final = 20_000
SEED: Final = 7


@dataclass(frozen=True, slots=True, kw_only=True)
class Bars:
    """Bars as two pixels tell them apart.

    Attributes:
        width_px: Of a bar.
        contrast: (bright - dark) / (bright + dark) without noise; negative where bright bars look
            dark.
        detection: Share of the pairs of pixels whose difference, bright less dark, two pixels of
            the same mean light would exceed once in twenty only.
        detection_ci: Interval of that share (95 %).
        cdp: Share of the pairs whose contrast is within half of the nominal one.
    """

    width_px: int
    contrast: float
    detection: float
    detection_ci: tuple[float, float]
    cdp: float


def contrast_of(line: Array, width_px: int) -> float:
    """Return signed contrast of bars behind a line spread, both pixels where the peak puts them.

    Args:
        line: (n,) light by pixel, n odd, the peak in the middle.
        width_px: Of a bar, in whole pixels.

    Raises:
        ContractError: If a bar is narrower than a pixel.
    """
    if width_px < 1:
        raise ContractError(f"a bar is at least 1 px wide; got {width_px}")
    half = line.size // 2
    # light that falls on the middle pixel comes from a scene at minus its own offset
    place = np.arange(half, -half - 1, -1)
    bright = (place + width_px // 2) // width_px % 2 == 0
    return float((line * np.where(bright, 1.0, -1.0)).sum() / line.sum())


def see_bars(
    image: PointImage, direction: Direction, width_px: int, sensor: ColorSensor, iso: float
) -> Bars:
    """Record two pixels on bars again and again, and count what they can tell.

    Args:
        image: Of a point.
        direction: In which the bars vary.
        width_px: Of a bar.
        sensor: Full well, noise, levels; a pixel of its middle colour sees white as `WHITE`.
        iso: Sensitivity.

    Raises:
        ContractError: If a bar is narrower than a pixel, or the ISO is not > 0.
    """
    contrast = contrast_of(image.lines[direction], width_px)
    mean = WHITE * image.illumination / 2
    setting = Setting(iso=iso)
    noise, step = noise_of(sensor, setting), _step(sensor, setting)
    signals = mean * np.array([1 + contrast, 1 - contrast])
    rng = np.random.default_rng(SEED)
    samples = record(np.repeat(signals[:, None], PAIRS, axis=1), noise, sensor.full_well_e, rng)
    bright, dark = np.rint(samples / step) * step
    hits = int((bright - dark > least_difference(mean, noise, step)).sum())
    total = bright + dark
    ratio = np.divide(bright - dark, total, out=np.zeros(PAIRS), where=total > 0)
    near = np.abs(ratio - NOMINAL) <= TOLERANCE * NOMINAL
    return Bars(
        width_px=width_px,
        contrast=contrast,
        detection=hits / PAIRS,
        detection_ci=interval(hits, PAIRS),
        cdp=float(near.mean()),
    )


def least_difference(mean: float, noise: NoiseModel, step: float) -> float:
    """Return the difference that two pixels of the same mean light exceed once in twenty only.

    Args:
        mean: Their light, 1.0 = white level.
        noise: At the ISO.
        step: Of the converter, in the same unit.
    """
    variance = variance_of(np.array(mean), noise, step)
    return float(norm.ppf(CONFIDENCE) * np.sqrt(2 * variance))


def interval(count: int, total: int) -> tuple[float, float]:
    """Return the interval (95 %) of a share that was counted.

    Args:
        count: Those that count.
        total: Of all, > 0.
    References: Wilson 1927.
    """
    z = float(norm.ppf(0.5 + CONFIDENCE / 2))
    share = count / total
    middle = (share + z * z / (2 * total)) / (1 + z * z / total)
    half = z / (1 + z * z / total) * np.sqrt(share * (1 - share) / total + (z / total / 2) ** 2)
    low = 0.0 if count == 0 else float(middle - half)
    return low, 1.0 if count == total else float(middle + half)


def _step(sensor: ColorSensor, setting: Setting) -> float:
    black, white = levels_of(sensor, setting)
    return 1 / (white - black)
