"""Patches of scenes at night for a joint design; every draw follows from its generator alone."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.colorimetry import camera_from_rec709
from camkit.errors import ContractError
from camkit.models_def.design.plate.recording import Pixels
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import draw_corner
from camkit.models_def.kinds.hdr.scenes import NIGHT_SEED, exposed
from camkit.runtime.kinds.hdr.night import night_scene

TRAIN_SEED: Final = NIGHT_SEED
VALID_SEED: Final = 4_000_000
"""Of held-out scenes; scenes to measure on are night:0 and upwards."""

_CACHED_SCENES: Final = 400
"""Scenes in memory; one of 384 px takes 0.9 MB."""

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class Patches:
    """The photographed patches of a step.

    Attributes:
        sharp: (b, 3, p + n - 1, p + n - 1) white-balanced camera space, for a PSF of n pixels.
        shot: (b,) variance per unit of signal.
        read_variance: (b,).
        normal: (b, p, p) standard normal numbers.
    """

    sharp: Tensor
    shot: Tensor
    read_variance: Tensor
    normal: Tensor


@dataclass(frozen=True, slots=True, kw_only=True)
class Night:
    """An exposed scene.

    Attributes:
        light: (3, s, s) float16, white-balanced camera space.
        margin_px: Around what may be a patch.
        clipped: (s - 2 margin, s - 2 margin), what exceeds the sensor in any colour.
    """

    light: NDArray[np.float16]
    margin_px: int
    clipped: NDArray[np.bool_]

    @property
    def sharp(self) -> FloatArray:
        """Return the part of the scene that patches are cut from."""
        inner = slice(self.margin_px, self.light.shape[1] - self.margin_px)
        return self.light[:, inner, inner].astype(np.float32)


class Nights:
    """Scenes at night, made when they are first asked for."""

    def __init__(
        self, camera: HdrRecipe, *, first_seed: int, count: int, scene_px: int, psf_px: int
    ) -> None:
        """Prepare the scenes.

        Args:
            camera: Its sensor, how much saturates, its ISO; `data.sample_px` is a patch's side.
            first_seed: Of the scenes night:SEED.
            count: How many.
            scene_px: Their side.
            psf_px: Odd side of the PSF.

        Raises:
            ContractError: If a patch and the PSF around it do not lie within a scene.
        """
        least = camera.data.sample_px + psf_px - 1
        if scene_px < least:
            raise ContractError(
                f"patches of {camera.data.sample_px} px behind a PSF of {psf_px} px want "
                f"reader.scene_px >= {least}; got {scene_px}"
            )
        self._camera, self._first, self._count = camera, first_seed, count
        self._scene_px, self._psf_px = scene_px, psf_px
        self._matrix, gains = camera_from_rec709(np.array(camera.sensor.color_matrix))
        self.pixels = Pixels(cfa=camera.sensor.cfa, gains=gains)
        self._cache: dict[int, Night] = {}

    def draw(self, rng: Generator, count: int) -> Patches:
        """Draw patches, mostly about lights, turned and mirrored."""
        data = self._camera.data
        side = data.sample_px + self._psf_px - 1
        crops, noises = [], []
        for _ in range(count):
            night = self._cached_night(int(rng.integers(self._count)))
            top, left = draw_corner(rng, night, self._camera)
            crop = night.light[:, top : top + side, left : left + side].astype(np.float32)
            crop = np.rot90(crop, int(rng.integers(4)), (1, 2))
            crops.append(crop[:, ::-1] if rng.random() < 0.5 else crop)
            iso = math.exp(rng.uniform(math.log(data.iso_min), math.log(data.iso_max)))
            noise = self._camera.sensor.noise_at(iso)
            noises.append((noise.shot[0], noise.read_variance[0]))
        shot, read_variance = torch.tensor(noises).T
        shape = (count, data.sample_px, data.sample_px)
        return Patches(
            sharp=torch.from_numpy(np.stack(crops)),
            shot=shot,
            read_variance=read_variance,
            normal=torch.from_numpy(rng.standard_normal(shape, dtype=np.float32)),
        )

    def _cached_night(self, number: int) -> Night:
        if number not in self._cache:
            self._cache[number] = self._night(number)
        return self._cache[number]

    def _night(self, number: int) -> Night:
        seed, data = self._first + number, self._camera.data
        rng = np.random.default_rng(seed)
        share = float(rng.uniform(data.saturated_min, data.saturated_max))
        as_it_is = rng.random() < data.as_it_is_share
        matrix = tuple(map(tuple, self._matrix.tolist()))
        light = _light(seed, self._scene_px, matrix, self.pixels.gains, None if as_it_is else share)
        margin = self._psf_px // 2
        inner = slice(margin, self._scene_px - margin)
        gains = np.array(self.pixels.gains, np.float32)[:, None, None]
        clipped = np.asarray((light[:, inner, inner] > gains).any(axis=0))
        return Night(light=light, margin_px=margin, clipped=clipped)


# another design in the same process asks for the same scenes again
@lru_cache(maxsize=_CACHED_SCENES)
def _light(
    seed: int,
    side_px: int,
    matrix: tuple[tuple[float, ...], ...],
    gains: tuple[float, float, float],
    share: float | None,
) -> NDArray[np.float16]:
    """Return the exposed light (3, side, side) of a scene in camera space; not to be written to."""
    to_camera = np.array(matrix)
    scene = exposed(night_scene(seed, side_px, side_px), to_camera, gains, share)
    light = np.tensordot(to_camera.astype(np.float32), scene, axes=1).clip(0)
    return light.astype(np.float16)
