"""Optics that write streaks, by their parts: a core, arms, a coarse haze.

a dense kernel outside its core = sum over arms of profile(along) x section(across) + haze
"""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.errors import ContractError

MAX_CORE_PX: Final = 33
MAX_REACH_PX: Final = 1024
MAX_ARMS: Final = 32
SECTION_STEP_PX: Final = 0.25
HAZE_STEP_PX: Final = 8
_MOST_LIGHT: Final = 1 + 1e-4
_MOST: Final = {"profiles": 1.0, "sections": 1 / SECTION_STEP_PX, "haze": 1.0}
"""Of a sample: all the light in one pixel, or in one step of a section."""
FloatGrid = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StreakOptics:
    """The image of a point of light on the sensor, the same everywhere, turned nowhere.

    All numbers are shares of the light that enters: what is missing to 1 falls beside the kernel.

    Attributes:
        core: (depth, wavelength, n, n) float32, n odd, at most 33: everything around the middle.
        bare_core: The same of the lens without its plate.
        profiles: (depth, wavelength, arm, distance) float32: light of an arm per pixel of its
            length, at 0, 1, 2, ... pixels from the middle; counts outside the core.
        sections: (wavelength, arm, offset) float32: light across an arm per pixel, in steps of
            a quarter of a pixel about its line; an odd number of them, integral 1.
        angles_rad: (arm,) float64: direction of an arm, from +x (right) towards +y (down).
        haze: (depth, wavelength, m, m) float32: light per pixel in squares of 8, the middle one
            about the middle; counts outside the core.
        depths_mm: (depth,) float64, increasing; inf is allowed.
        wavelengths_um: (wavelength,) float64, increasing.
        pixel_pitch_um: Of the sensor.
    """

    core: FloatArray
    bare_core: FloatArray
    profiles: FloatArray
    sections: FloatArray
    angles_rad: FloatGrid
    haze: FloatArray
    depths_mm: FloatGrid
    wavelengths_um: FloatGrid
    pixel_pitch_um: float

    def __post_init__(self) -> None:
        """Refuse parts that are no optics.

        Raises:
            ContractError: If shapes disagree, or light is not a share of what enters.
        """
        self._check_axes()
        self._check_shapes()
        for name in ("core", "bare_core", "profiles", "sections", "haze"):
            light = getattr(self, name)
            if not np.isfinite(light).all() or (light < 0).any():
                raise ContractError(f"streaks: {name} must be finite and >= 0")
            most = _MOST_LIGHT * _MOST.get(name, np.inf)
            if (light > most).any():
                raise ContractError(
                    f"streaks: {name} holds more than all the light: {light.max()} in one sample"
                )
        for name in ("core", "bare_core"):
            share = getattr(self, name).sum(axis=(-2, -1), dtype=np.float64)
            if (share <= 0).any() or (share > _MOST_LIGHT).any():
                raise ContractError(
                    f"streaks: {name} holds 0 to 1 of the light; got {share.min()} to {share.max()}"
                )

    def _check_axes(self) -> None:
        for name in ("depths_mm", "wavelengths_um"):
            axis = getattr(self, name)
            if (
                axis.ndim != 1
                or not axis.size
                or not (axis > 0).all()
                or (axis[1:] <= axis[:-1]).any()
            ):
                raise ContractError(f"streaks: {name} must be > 0 and increasing; got {axis}")
        if not np.isfinite(self.wavelengths_um).all():
            raise ContractError("streaks: wavelengths_um must be finite")
        if not (math.isfinite(self.pixel_pitch_um) and self.pixel_pitch_um > 0):
            raise ContractError(f"streaks: pixel_pitch_um must be > 0; got {self.pixel_pitch_um}")

    def _check_shapes(self) -> None:
        lead = (self.depths_mm.size, self.wavelengths_um.size)
        arms, side, squares = self.angles_rad.size, self.core.shape[-1], self.haze.shape[-1]
        shapes = {
            "core": (*lead, side, side),
            "bare_core": (*lead, side, side),
            "profiles": (*lead, arms, self.profiles.shape[-1]),
            "sections": (lead[1], arms, self.sections.shape[-1]),
            "haze": (*lead, squares, squares),
            "angles_rad": (arms,),
        }
        for name, shape in shapes.items():
            if getattr(self, name).shape != shape:
                raise ContractError(
                    f"streaks: {name} must be {shape}; got {getattr(self, name).shape}"
                )
        odd = {"core": side, "sections": self.sections.shape[-1], "haze": squares}
        if even := [name for name, count in odd.items() if count % 2 == 0]:
            raise ContractError(f"streaks: {', '.join(even)} need an odd number of samples")
        if not 0 < side <= MAX_CORE_PX:
            raise ContractError(f"streaks: a core has 1 to {MAX_CORE_PX} px; got {side}")
        if not 0 < arms <= MAX_ARMS or not np.isfinite(self.angles_rad).all():
            raise ContractError(f"streaks: 1 to {MAX_ARMS} arms with finite angles; got {arms}")
        if not side // 2 < self.reach_px <= MAX_REACH_PX:
            raise ContractError(
                f"streaks: arms end outside the core, within {MAX_REACH_PX} px; "
                f"got {self.reach_px} px"
            )
        if squares * HAZE_STEP_PX > 2 * MAX_REACH_PX + 1:
            raise ContractError(f"streaks: a haze of {squares} squares is too wide")

    @property
    def reach_px(self) -> int:
        """Return the distance at which the longest arm ends."""
        return int(self.profiles.shape[-1]) - 1

    @property
    def side_px(self) -> int:
        """Return the side of the dense kernel that holds everything."""
        squares = int(self.haze.shape[-1])
        return 2 * max(self.reach_px, (squares * HAZE_STEP_PX - 1) // 2) + 1

    def dense(self, *, bare: bool = False) -> FloatArray:
        """Return the kernels (depth, wavelength, side, side), shares of the light.

        Args:
            bare: Of the lens without its plate, of which the core alone is known.
        """
        depths, waves = self.core.shape[:2]
        core = self.bare_core if bare else self.core
        side, middle = self.side_px, self.side_px // 2
        kernels = np.zeros((depths, waves, side, side), np.float32)
        if not bare:
            kernels += self._wide()
        half = core.shape[-1] // 2
        inside = slice(middle - half, middle + half + 1)
        kernels[..., inside, inside] = core
        return kernels

    def _wide(self) -> FloatArray:
        """Return haze and arms, the core's place included."""
        side = self.side_px
        place = np.arange(side) - side // 2
        taps = haze_taps(side, self.haze.shape[-1])
        wide = np.asarray(taps @ self.haze @ taps.T, np.float32)
        for arm, angle in enumerate(self.angles_rad):
            along, across = arm_axes(place, float(angle))
            for depth in range(wide.shape[0]):
                for wave in range(wide.shape[1]):
                    wide[depth, wave] += arm_light(
                        self.profiles[depth, wave, arm], self.sections[wave, arm], along, across
                    )
        return wide


def arm_axes(place: NDArray[np.integer], angle_rad: float) -> tuple[FloatGrid, FloatGrid]:
    """Return the distances of (y, x) pixels along an arm, and across it, both in pixels."""
    x, y = place[None, :], place[:, None]
    along = math.cos(angle_rad) * x + math.sin(angle_rad) * y
    across = math.cos(angle_rad) * y - math.sin(angle_rad) * x
    return along, across


def arm_light(
    profile: NDArray[Any], section: NDArray[Any], along: FloatGrid, across: FloatGrid
) -> FloatArray:
    """Return the light of an arm at places along and across it; linear between its samples."""
    distance = np.arange(profile.size)
    offset = SECTION_STEP_PX * (np.arange(section.size) - section.size // 2)
    light = np.zeros(along.shape, np.float32)
    near = (along >= 0) & (along <= distance[-1]) & (np.abs(across) <= offset[-1])
    light[near] = np.interp(along[near], distance, profile) * np.interp(
        across[near], offset, section
    )
    return light


def haze_taps(side_px: int, squares: int) -> FloatArray:
    """Return (side, squares): the weight of every square at a pixel; linear between middles."""
    place = (np.arange(side_px) - side_px // 2) / HAZE_STEP_PX + squares // 2
    return np.stack(
        [np.interp(place, np.arange(squares), unit) for unit in np.eye(squares)], axis=1
    ).astype(np.float32)
