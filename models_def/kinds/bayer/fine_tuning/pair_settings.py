"""The settings of a folder of real pairs, `pairs.toml`.

iso = 400.0                    or noise = [SHOT, READ_VARIANCE]
white_balance = [R, 1.0, B]    of the captures, if not that of D65
reference = "photographed"     by the same camera from the same place; else "shown" by a display
tone = "maker.toml"            of developed pictures: srgb, linear, or a file beside this one
halves = ["_l", "_r"]          of dual pixels, as `camkit process --halves`
depth_m = 1.5                  of a camera whose PSF has several distances
parts = [[0, 0, 384, 512]]     of the captures that count: x0, y0, x1, y1
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

import numpy as np

from camkit.caller import option_text
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.toml_table import section
from camkit.noise import NoiseModel
from camkit.runtime.signal.halves import check_halves
from camkit.runtime.twin.light import camera_space
from camkit.side_file import read_side_toml
from camkit.units import MM_PER_M

SETTINGS: Final = "pairs.toml"
Origin = Literal["shown", "photographed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PairSettings:
    """The keys of `pairs.toml`.

    Attributes:
        iso: Of the captures, for the noise that the recipe states; None where `noise` is given.
        noise: (shot, read variance) of linear light, white = 1; empty for that of the ISO.
        white_balance: Gains (R, G, B) that the captures contain; empty for those of D65.
        reference: shown: what a display showed, 8-bit sRGB; photographed: by the same camera from
            the same place, stopped down or refocused, in files like those of the captures.
        tone: Curve of developed pictures, see `camkit.runtime.signal.tone_curve.read_tone`; empty
            for what the files state.
        halves: Texts by which the two halves of dual pixels differ; empty for whole pictures.
        depth_m: Distance of the scene, whose kernels filter the captures; None for the mean kernel.
        parts: Rectangles (x0, y0, x1, y1) in pixels of the captures, without x1 and y1; nothing
            else is learned from. Empty for all.
    """

    iso: float | None = None
    noise: tuple[float, ...] = ()
    white_balance: tuple[float, ...] = ()
    reference: Origin = "shown"
    tone: str = ""
    halves: tuple[str, ...] = ()
    depth_m: float | None = None
    parts: tuple[tuple[int, ...], ...] = ()

    def __post_init__(self) -> None:
        if (self.iso is None) == (not self.noise):
            raise ContractError("one of iso > 0 and noise = [SHOT, READ_VARIANCE] is needed")
        if self.iso is not None and not self.iso > 0:
            raise ContractError(f"iso must be > 0; got {self.iso:g}")
        if self.noise and (len(self.noise) != 2 or not self.noise[0] > 0 <= self.noise[1]):
            raise ContractError(
                f"noise must be [SHOT, READ_VARIANCE], > 0 and >= 0; got {list(self.noise)}"
            )
        if self.white_balance and (len(self.white_balance) != 3 or min(self.white_balance) <= 0):
            raise ContractError(
                f"white_balance must be [R, G, B], all > 0; got {list(self.white_balance)}"
            )
        if self.halves and len(self.halves) != 2:
            raise ContractError(f"halves must be two texts; got {list(self.halves)}")
        check_halves(self.pair_of_halves)
        if self.depth_m is not None and not self.depth_m > 0:
            raise ContractError(f"depth_m must be > 0; got {self.depth_m:g}")
        for part in self.parts:
            if len(part) != 4 or not (0 <= part[0] < part[2] and 0 <= part[1] < part[3]):
                raise ContractError(
                    "parts must be rectangles [x0, y0, x1, y1] with 0 <= x0 < x1, 0 <= y0 < y1; "
                    f"got {list(part)}"
                )

    @property
    def pair_of_halves(self) -> tuple[str, str] | None:
        """Return the two texts of halves; None for whole pictures."""
        if not self.halves:
            return None
        left, right = self.halves
        return left, right

    def gains(self, recipe: BayerRecipe) -> tuple[float, float, float]:
        """Return the white balance (R, G, B) of the captures."""
        r, g, b = self.white_balance or camera_space(recipe.sensor)[1]
        return r, g, b

    def noise_in(self, recipe: BayerRecipe) -> NoiseModel:
        """Return the noise of the captures behind their white balance."""
        if self.iso is not None:
            noise = recipe.sensor.noise_at(self.iso)
        else:
            shot, read_variance = self.noise
            noise = NoiseModel(shot=(shot,) * 3, read_variance=(read_variance,) * 3)
        return noise.with_gains(self.gains(recipe))

    def depth_in(self, recipe: BayerRecipe) -> float | None:
        """Return the number of the depth whose kernels filter, between two where it lies there.

        Raises:
            ContractError: If the distance is needed and not stated, or stated in vain, or lies
                outside those of the recipe.
        """
        depths_mm = recipe.lens.depths_mm
        if self.depth_m is None:
            if recipe.estimates_depth:
                raise ContractError(
                    "the bank of this camera finds the distance of a scene (wiener.depth = "
                    f'"estimated"), and pairs have one: state depth_m in {SETTINGS}, or train '
                    f"without {option_text('pairs')}"
                )
            return None
        if not recipe.tells_depth:
            raise ContractError(
                "depth_m is for cameras whose filters are told a distance (wiener.depth or "
                "data.known_depth_share); leave it out"
            )
        depth_mm = self.depth_m * MM_PER_M
        if not depths_mm[0] <= depth_mm <= depths_mm[-1]:
            reach = f"{depths_mm[0] / MM_PER_M:g} to {depths_mm[-1] / MM_PER_M:g} m"
            raise ContractError(f"depth_m must lie within the PSF, {reach}; got {self.depth_m:g}")
        nearness = MM_PER_M / np.array(depths_mm)
        numbers = np.arange(nearness.size)
        return float(np.interp(MM_PER_M / depth_mm, nearness[::-1], numbers[::-1]))


def read_settings(folder: Path, recipe: BayerRecipe) -> PairSettings:
    """Read the settings of a folder of pairs.

    Raises:
        ContractError: If there are none, or they are not those of this camera; all faults of the
            file are named.
    """
    path = folder / SETTINGS
    try:
        table = read_side_toml(path, "the settings of pairs")
    except ContractError as error:
        raise ContractError(f"real pairs need {path}, with iso at least: {error}") from error
    try:
        settings = section(SETTINGS, PairSettings, table)
    except ContractError as error:
        raise ContractError(f"{path}: {error}") from error
    developed = [name for name in ("tone", "halves") if getattr(settings, name)]
    if developed and recipe.sensor.cfa is not None:
        raise ContractError(
            f"{path}: {' and '.join(developed)} are for cameras of developed pictures (planes); "
            "captures of a mosaic are 16-bit linear camera colours"
        )
    return settings
