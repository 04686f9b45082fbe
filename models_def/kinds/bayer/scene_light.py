"""The light of scenes: a display that shows them, or daylight and lights beyond white.

    picture -> codes of a display -> its light            a laboratory: `DisplayRecipe`
    scene -> daylight of another colour -> a wider range  outside of it: `WildRecipe`

Light is linear Rec.709 as the sensor's colour matrix sees it, 1 the white of picture or display.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.colorimetry import (
    D65,
    REC709_PRIMARIES,
    Chromaticity,
    apply_matrix,
    decode_srgb,
    encode_srgb,
    rec709_of_light,
    rgb_to_xyz,
)
from camkit.errors import ContractError
from camkit.models_def.training.recipe import check_share

Generator = np.random.Generator
Matrix = NDArray[np.float64]

LUMINANCE: Final = rgb_to_xyz(REC709_PRIMARIES, D65)[1]
"""Of linear Rec.709; sums to 1."""
MOST_BITS: Final = 16
COLDEST_K, WARMEST_K = 25000.0, 4000.0
"""Where the locus of daylight is defined."""
RANGE_POWER: Final = 4.0
"""Of luminance: a grey of 18 % stays within 7 % where white becomes 64 times as bright."""


@dataclass(frozen=True, slots=True, kw_only=True)
class DisplayRecipe:
    """A display that shows the scenes, as `camkit calibrate targets` has it: pictures of sRGB.

    Attributes:
        primaries: Chromaticities (x, y) of red, green and blue, as the sensor's colour matrix sees
            them.
        white: Of all three together.
        contrast: White over black.
        bits: Of the codes.
        gamma: Light is this power of the codes; 0 for the curve of sRGB.
        calibrated: Whether a sample should become the light of the display, as after `camkit
            calibrate tone` and `pairs`. Otherwise the picture as it is coded: black, tone and
            primaries of the display are then errors that a network may learn to undo.
    """

    primaries: tuple[tuple[float, ...], ...] = REC709_PRIMARIES
    white: tuple[float, ...] = D65
    contrast: float = 1000.0
    bits: int = 8
    gamma: float = 0.0
    calibrated: bool = True

    def __post_init__(self) -> None:
        if [len(one) for one in (*self.primaries, self.white)] != [2] * 4:
            raise ContractError(
                "data.display needs three primaries and a white, each [x, y]; got "
                f"{self.primaries}, {self.white}"
            )
        if not (self.contrast > 1 and 1 <= self.bits <= MOST_BITS and self.gamma >= 0):
            raise ContractError(
                f"data.display needs contrast > 1, bits of 1..{MOST_BITS} and gamma >= 0; got "
                f"{self.contrast:g}, {self.bits}, {self.gamma:g}"
            )
        points = np.array([(*one, 1.0) for one in self.primaries])
        inside = min(y for _, y in (*self.primaries, self.white)) > 0
        if not (inside and abs(np.linalg.det(points)) > 1e-6):
            raise ContractError("data.display.primaries must span a triangle, with y > 0")

    @property
    def to_rec709(self) -> Matrix:
        """Return the (3, 3) matrix from the display's light to linear Rec.709; not adapted."""
        red, green, blue = (_point(one) for one in self.primaries)
        to_xyz = rgb_to_xyz((red, green, blue), _point(self.white))
        return np.asarray(np.linalg.inv(rgb_to_xyz(REC709_PRIMARIES, D65)) @ to_xyz)

    def codes(self, picture: FloatArray) -> FloatArray:
        """Return the input of the display, 0..1 in steps, of linear Rec.709."""
        top = np.float32(2**self.bits - 1)
        return np.asarray(np.rint(encode_srgb(picture) * top) / top, dtype=np.float32)

    def shown_light(self, picture: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Compute the light of a shown picture.

        Args:
            picture: (3, h, w) linear Rec.709; what lies outside 0..1 is cut.

        Returns:
            The light of the display, and what a sample should become; (3, h, w) each.
        """
        codes = self.codes(picture)
        coded_light = decode_srgb(codes)
        light = coded_light if self.gamma == 0 else codes ** np.float32(self.gamma)
        black = np.float32(1 / self.contrast)
        emitted = apply_matrix(self.to_rec709, black + (1 - black) * light)
        return emitted, emitted if self.calibrated else coded_light


@dataclass(frozen=True, slots=True, kw_only=True)
class WildRecipe:
    """Scenes outside of a laboratory; distances are those of `lens.depths_mm`.

    Attributes:
        daylight_share: Share of scenes lit by daylight of another colour than D65, uniform in its
            reciprocal temperature.
        daylight_warmest_k: Correlated colour temperature, 4000 or more.
        daylight_coldest_k: Likewise, 25000 or less.
        range_share: Share of scenes whose white becomes brighter than that of a picture.
        range_least: How many times, drawn log-uniformly; shadows stay.
        range_most: Likewise.
    """

    daylight_share: float = 1.0
    daylight_warmest_k: float = WARMEST_K
    daylight_coldest_k: float = 12000.0
    range_share: float = 1.0
    range_least: float = 4.0
    range_most: float = 64.0

    def __post_init__(self) -> None:
        check_share("data.wild.daylight_share", self.daylight_share)
        check_share("data.wild.range_share", self.range_share)
        warmest, coldest = self.daylight_warmest_k, self.daylight_coldest_k
        if not WARMEST_K <= warmest <= coldest <= COLDEST_K:
            raise ContractError(
                f"data.wild needs {WARMEST_K:g} <= daylight_warmest_k <= daylight_coldest_k <= "
                f"{COLDEST_K:g}; got {warmest:g}, {coldest:g}"
            )
        if not 1 <= self.range_least <= self.range_most:
            raise ContractError(
                "data.wild needs 1 <= range_least <= range_most; got "
                f"{self.range_least:g}, {self.range_most:g}"
            )

    def lit(self, rng: Generator, scene: FloatArray) -> FloatArray:
        """Light a (3, h, w) scene."""
        if rng.random() < self.range_share:
            ends = np.log([self.range_least, self.range_most])
            scene = with_range(scene, float(np.exp(rng.uniform(*ends))))
        if rng.random() < self.daylight_share:
            kelvin = 1 / rng.uniform(1 / self.daylight_coldest_k, 1 / self.daylight_warmest_k)
            scene = scene * daylight(kelvin).astype(np.float32)[:, None, None]
        return scene


def daylight(kelvin: float) -> Matrix:
    """Return the (3,) light of a daylight in linear Rec.709, of the luminance of D65.

    Args:
        kelvin: Correlated colour temperature, 4000..25000.

    References: CIE 15:2004, the locus of daylight.
    """
    t = 1000 / kelvin
    if kelvin <= 7000:
        x = 0.244063 + 0.09911 * t + 2.9678 * t**2 - 4.6070 * t**3
    else:
        x = 0.237040 + 0.24748 * t + 1.9018 * t**2 - 2.0064 * t**3
    y = -3 * x**2 + 2.870 * x - 0.275
    return rec709_of_light((x, y))


def with_range(scene: FloatArray, times: float) -> FloatArray:
    """Scale the white of a (3, h, w) scene by a factor; colours stay."""
    bright = np.clip(np.einsum("c,cij->ij", LUMINANCE.astype(np.float32), scene), 0, 1)
    return np.asarray(scene * (1 + np.float32(times - 1) * bright ** np.float32(RANGE_POWER)))


def _point(values: tuple[float, ...]) -> Chromaticity:
    x, y = values
    return x, y
