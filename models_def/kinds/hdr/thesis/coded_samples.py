"""Samples of the thesis's networks: captures, and the layers that they are made of.

    scene I, exposed -- U = min(I, 1)     what a sensor can hold
                     -- S = I in 1..2^8   the lights
    kernels p -- capture: p * I, mosaic, noise, clip, demosaic
              -- streaks: min(p * I, 1) - min(p * U, 1), what the sensor sees of the lights

The thesis does not say what the streaks are in numbers. Where the capture is clipped they are what
is left to white, so that nothing is told which the capture does not hold.

References: Sun 2021, section 5.4, eq. (5.2); section 5.4.4 (how much saturates).
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.colorimetry import camera_from_rec709
from camkit.errors import ContractError
from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import develop, draw_corner, spread_light
from camkit.models_def.kinds.hdr.scenes import LightSource, exposed
from camkit.models_def.kinds.hdr.thesis.chain import saturated
from camkit.models_def.kinds.hdr.thesis.networks import to_roots
from camkit.models_def.kinds.hdr.thesis.star import draw_angle_rad, star_kernel
from camkit.models_def.sensors.exposure import expose
from camkit.models_def.training.sample import Sample, SampleLayout
from camkit.scenes.saturation import CEILING

Generator = np.random.Generator

PORTS: Final = {
    "split": (("rgb",), ("clean", "streaks")),
    "highlight": (("streaks",), ("lights",)),
    "fusion": (("clean", "lights"), ("image",)),
    "whole": (("rgb",), ("image",)),
}
"""Role -> what its networks take and give; three channels each."""


def layout_of(recipe: HdrRecipe, role: str) -> SampleLayout:
    """Return the layout of a role's samples; the arms of a windshield stand upright."""
    takes, gives = (tuple(Port(name=n, channels=3) for n in names) for names in PORTS[role])
    return SampleLayout(inputs=takes, outputs=gives, turned=recipe.thesis.optics != "glare")


@dataclass(frozen=True, slots=True, kw_only=True)
class CodedShot:
    """A capture and the layers within; planes (3, h, w) linear, white-balanced, 1.0 = white.

    Attributes:
        rgb: As captured; a colour clips at its gain.
        sharp: The truth.
        streaks: What the sensor sees of the lights.
        clipped: (h, w) where a sample clipped.
    """

    rgb: FloatArray
    sharp: FloatArray
    streaks: FloatArray
    clipped: NDArray[np.bool_]


class CodedCamera:
    """The camera of a recipe behind its plate, its bare lens or a windshield."""

    def __init__(self, recipe: HdrRecipe, material: HdrMaterial) -> None:
        self.recipe = recipe
        self.matrix, self.gains = camera_from_rec709(np.array(recipe.sensor.color_matrix))
        self._fixed: FloatArray | None = None
        if recipe.thesis.optics != "glare":
            self._fixed = material.color_kernels(recipe, bare=recipe.thesis.optics == "bare")

    def kernels(self, rng: Generator) -> FloatArray:
        """Return the (3, n, n) kernels of a shot; a windshield's lie at another angle each time."""
        if self._fixed is not None:
            return self._fixed
        star = star_kernel(self.recipe.glare, draw_angle_rad(self.recipe.glare, rng))
        return np.repeat(star[None], 3, axis=0)

    def photograph(self, scene: FloatArray, iso: float, rng: Generator) -> CodedShot:
        """Photograph an exposed (3, h, w) linear Rec.709 scene; its surround is cut off."""
        surround, (height, width) = self.recipe.data.surround_px, scene.shape[1:]
        flat = torch.from_numpy(self.matrix).float() @ torch.from_numpy(scene).reshape(3, -1)
        sharp = flat.reshape(1, 3, height, width).clamp_(min=0)
        inside = np.s_[..., surround : height - surround, surround : width - surround]
        both = torch.cat([sharp, sharp.clamp(max=1)])
        spread, ordinary = torch.split(spread_light(both, self.kernels(rng))[inside], 1)
        raw, clipped = expose(spread, self.gains, self.recipe.sensor, iso, rng)
        streaks = (spread.clamp(max=1) - ordinary.clamp(max=1)).clamp(min=0)
        return CodedShot(
            rgb=develop(raw, self.gains, self.recipe.sensor.cfa),
            sharp=np.ascontiguousarray(sharp[inside][0].numpy()),
            streaks=np.ascontiguousarray(streaks[0].numpy()),
            clipped=clipped,
        )


def coded_sample(shot: CodedShot, corner: tuple[int, int], recipe: HdrRecipe, role: str) -> Sample:
    """Cut the sample of a role: roots of linear light."""
    side, (top, left) = recipe.data.sample_px, corner
    part = np.s_[:, top : top + side, left : left + side]
    rgb, sharp, streaks = (
        torch.from_numpy(np.ascontiguousarray(x[part]))
        for x in (shot.rgb, shot.sharp, shot.streaks)
    )
    lights = sharp.clamp(1, CEILING)
    takes, gives = PORTS[role]
    if "lights" in takes:
        lights = lights * saturated(rgb[None])[0]
    planes = {
        "rgb": rgb,
        "clean": sharp.clamp(max=1),
        "streaks": streaks,
        "lights": lights,
        "image": sharp.clamp(max=CEILING),
    }
    target = torch.cat([to_roots(planes[name]) for name in gives])
    return Sample(
        inputs={name: to_roots(planes[name]) for name in takes},
        target=target,
        weight=torch.ones(len(target)),
    )


class CodedMaker:
    """Makes sample i of a role."""

    def __init__(
        self, recipe: HdrRecipe, role: str, camera: CodedCamera, source: LightSource, seed: int
    ) -> None:
        if role not in PORTS:
            raise ContractError(f"role must be one of {', '.join(PORTS)}; got {role!r}")
        self._recipe, self._role, self._seed = recipe, role, seed
        self._camera, self._source = camera, source

    def make(self, index: int) -> Sample:
        """Photograph a scene of which some saturates."""
        rng = np.random.default_rng((self._seed, index))
        data, camera = self._recipe.data, self._camera
        scene = self._source.draw(rng, data.capture_px + 2 * data.surround_px)
        share = float(rng.uniform(data.saturated_min, data.saturated_max))
        as_it_is = rng.random() < data.as_it_is_share
        scene = exposed(scene, camera.matrix, camera.gains, None if as_it_is else share)
        iso = math.exp(rng.uniform(math.log(data.iso_min), math.log(data.iso_max)))
        shot = camera.photograph(scene, iso, rng)
        return coded_sample(shot, draw_corner(rng, shot, self._recipe), self._recipe, self._role)
