"""Takes the captures of a sweep with the array of a bundle, and keeps the light of its surfaces."""

import zlib
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.report.kinds.spad.stress.spad_scene import SpadScene
from camkit.report.kinds.spad.stress.spad_shot import (
    DepthSetting,
    DepthShot,
    PictureSetting,
    PictureShot,
)
from camkit.runtime.kinds.spad.captures.known_pulse import LITTLE_LOST
from camkit.runtime.kinds.spad.finer.camera import FineCamera
from camkit.runtime.kinds.spad.finer.sampling import point_kernel
from camkit.runtime.kinds.spad.golden_captures import stage_set
from camkit.runtime.kinds.spad.pile_up import without_pile_up
from camkit.runtime.kinds.spad.pulse import Pulse
from camkit.runtime.kinds.spad.time_axis import TimeAxis
from camkit.runtime.kinds.spad.timing import LIGHT_M_PER_PS
from camkit.runtime.kinds.spad.twin.array import see_through
from camkit.runtime.kinds.spad.twin.counting import (
    Disturbances,
    count_frames,
    count_times,
    scaled_to,
)
from camkit.runtime.kinds.spad.twin.photon_twin import times_of
from camkit.runtime.kinds.spad.twin.scene import light_of_depth

DARKEST: Final = 0.2
"""Albedo of black: what sends nothing back has no depth."""
NEAR_SHARE: Final = 0.6
"""Times of flight of a scene with a second surface, over those without: both must be seen."""
PANE: Final = 0.25
"""Of the picture's sides left free around the part with a second surface."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Studio:
    """An array before its scenes.

    Attributes:
        camera: The array.
    """

    camera: FineCamera
    _lit: dict[tuple[object, ...], FloatArray] = field(default_factory=dict, repr=False)

    @property
    def shape(self) -> tuple[int, int]:
        """Return (h, w) in pixels."""
        return self.camera.sensor.height_px, self.camera.sensor.width_px

    def picture(self, scene: SpadScene, setting: PictureSetting) -> PictureShot:
        """Count a picture, with the plate and without."""
        light = scene.light[None]
        plate_kernel = self.camera.kernel if setting.kernel is None else setting.kernel
        bare = setting.bare_kernel
        if bare is None:
            bare = point_kernel(plate_kernel.shape[0])
        white_photons, nothing = setting.photons, np.zeros(self.shape)
        background = 0.0
        if np.isfinite(setting.sbr):
            background = white_photons * float(scene.light.mean(dtype=np.float64)) / setting.sbr
        dark = nothing if setting.dark is None else setting.dark
        hot = np.zeros(self.shape, bool) if setting.hot is None else setting.hot
        added = Disturbances(hot=hot, hot_counts=setting.hot_counts)

        def counted(kernel: FloatArray, photons: float) -> FloatArray:
            # what lies between sub-pixels is interpolated, which may end a hair below 0
            pixels = np.maximum(see_through(light, kernel, self.camera.grid), 0).astype(np.float64)
            mean = pixels * photons + background + dark
            return np.asarray(count_frames(mean, added, _chance(scene))[0], np.float32)

        plate_photons = white_photons * setting.plate_light
        stated_dark = dark if setting.dark_known else nothing
        return PictureShot(
            scene=scene.name,
            truth=scene.light,
            counts=counted(plate_kernel, plate_photons),
            bare=counted(bare, white_photons),
            dark=stated_dark + background,
            hot=hot & setting.hot_known,
            photons=(white_photons, plate_photons),
            white_factor=setting.white_factor,
        )

    def times(self) -> tuple[TimeAxis, Pulse]:
        """Return axis and pulse as the bundle states them."""
        return times_of(self.camera)

    def depth(self, scene: SpadScene, setting: DepthSetting) -> DepthShot:
        """Count surfaces by time."""
        defaults = self.times()
        axis, pulse = setting.axis or defaults[0], setting.pulse or defaults[1]
        first = stage_set(self.camera, scene.number) * 2 / LIGHT_M_PER_PS
        times, judged = first[None], np.ones(first.shape, bool)
        if setting.behind_ps:
            judged = pane(first.shape)
            times = np.stack([NEAR_SHARE * first, NEAR_SHARE * first + setting.behind_ps])
        mean = scaled_to(self._binned_light(scene, times, judged, axis, pulse), setting.photons)
        mean += setting.photons / setting.sbr / axis.bins
        cycles = 0
        if setting.chance:
            cycles = max(1, round(float(mean.max()) / -np.log1p(-setting.chance)))
        added = Disturbances(hot=setting.hot, hot_counts=setting.hot_counts, cycles=cycles)
        counts = count_times(mean, axis.orientation, added, _chance(scene))
        flat = counts.transpose(1, 2, 0).reshape(-1, axis.bins).astype(np.float32)
        blind, scattering = np.zeros(self.shape, bool), 0
        if cycles:
            undone = without_pile_up(flat, cycles, axis.orientation)
            flat, blind = undone.counts, undone.blind.reshape(self.shape)
            scattering = cycles if undone.worst.max() >= LITTLE_LOST else 0
        assumed = setting.assumed or (axis, pulse)
        return DepthShot(
            scene=scene.name,
            times_ps=times,
            judged=judged,
            counts=np.ascontiguousarray(flat.reshape(*self.shape, axis.bins)),
            blind=blind,
            cycles=scattering,
            axis=assumed[0],
            pulse=assumed[1],
        )

    def _binned_light(
        self,
        scene: SpadScene,
        times_ps: NDArray[np.float64],
        both: NDArray[np.bool_],
        axis: TimeAxis,
        pulse: Pulse,
    ) -> FloatArray:
        """Return the light of every bin and pixel; the last of its kind is kept."""
        gap_ps = float(times_ps[-1, 0, 0] - times_ps[0, 0, 0])
        key = scene.name, axis.orientation, axis.edges_ps.tobytes(), pulse, gap_ps
        if key not in self._lit:
            albedo = DARKEST + (1 - DARKEST) * scene.light
            layers = [
                light_of_depth(
                    layer * LIGHT_M_PER_PS / 2, albedo * (1 if n == 0 else both), axis, pulse
                )
                for n, layer in enumerate(times_ps)
            ]
            light = np.asarray(sum(layers), np.float32)
            self._lit.clear()
            self._lit[key] = see_through(light, self.camera.kernel, self.camera.grid)
        return self._lit[key]


def pane(shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Return the middle of a picture (h, w), where a second surface is seen."""
    mask = np.zeros(shape, bool)
    top, left = (round(PANE * side) for side in shape)
    mask[top : shape[0] - top, left : shape[1] - left] = True
    return mask


def _chance(scene: SpadScene) -> np.random.Generator:
    return np.random.default_rng(zlib.crc32(scene.name.encode()))
