"""One training sample: a scene photographed, its lights found from their streaks, and the truth.

scene -> exposure, camera space -> blur of the plate -> CFA, noise, clip
      -> cells -> lights (kinds.hdr.streaks: what runs at use time) -> painted planes -> Sample
"""

from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.cfa import CfaPattern
from camkit.colorimetry import camera_from_rec709, rec709_from_camera
from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.sensors.demosaic import developed
from camkit.models_def.sensors.exposure import expose
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.sensors.wiener import to_otf
from camkit.models_def.training.sample import Sample, SampleLayout
from camkit.noise import NoiseModel
from camkit.runtime.kinds.hdr.streaks.cells import cells_of, sample_sites
from camkit.runtime.kinds.hdr.streaks.kernels import StreakKernels, streak_kernels
from camkit.runtime.kinds.hdr.streaks.painting import Painter
from camkit.runtime.kinds.hdr.streaks.recovery import Recovery, recover
from camkit.runtime.kinds.hdr.streaks.rims import near_clipped, no_brighter

LAYOUT: Final = SampleLayout(
    inputs=(Port(name="rgb", channels=3), Port(name="lit", channels=3)),
    outputs=(Port(name="clean", channels=3),),
)
"""What the networks take and give. What streaks leave behind points every way alike, so samples
may turn."""
LIGHT_CANDIDATES: Final = 4
DEMOSAIC: Final = "fast"
"""Of captures and of pictures whose streaks were taken from the mosaic."""

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A capture with its lights found.

    Attributes:
        rgb: (3, h, w) white-balanced planes as captured.
        lit: (3, h, w) with lights, without streaks.
        sharp: (3, h, w) the truth.
        clipped: (h, w) where a sample clipped.
        noise: After white balance.
    """

    rgb: FloatArray
    lit: FloatArray
    sharp: FloatArray
    clipped: NDArray[np.bool_]
    noise: NoiseModel


class Located(Protocol):
    """A capture that says where its lights are."""

    @property
    def clipped(self) -> NDArray[np.bool_]:
        """Return (h, w) where a sample clipped."""
        ...

    @property
    def sharp(self) -> FloatArray:
        """Return (3, h, w), the truth."""
        ...


class HdrCamera:
    """The camera of a recipe, its kernels ready."""

    def __init__(self, recipe: HdrRecipe, material: HdrMaterial) -> None:
        self.recipe = recipe
        sensor = recipe.sensor
        self.matrix, self.gains = camera_from_rec709(np.array(sensor.color_matrix))
        self._to_rec709 = rec709_from_camera(np.array(sensor.color_matrix))
        self._dense = material.color_kernels(recipe)
        self._kernels: StreakKernels = streak_kernels(
            self._dense, sample_sites(sensor.cfa), material.streaks.reach_px
        )

    def photograph(self, scene: FloatArray, iso: float, rng: Generator, surround_px: int) -> Shot:
        """Photograph an exposed scene and find its lights.

        Args:
            scene: (3, h, w) linear Rec.709.
            iso: Sensitivity.
            rng: Source of the noise.
            surround_px: Of the scene on every side, whose light falls into the capture.
        """
        height, width = scene.shape[1:]
        flat = torch.from_numpy(self.matrix).float() @ torch.from_numpy(scene).reshape(3, -1)
        sharp = flat.reshape(1, 3, height, width).clamp_(min=0)
        inside = np.s_[..., surround_px : height - surround_px, surround_px : width - surround_px]
        blurred = spread_light(sharp, self._dense)[inside]
        sensor = self.recipe.sensor
        raw, clipped = expose(blurred, self.gains, sensor, iso, rng)
        cells = cells_of(raw[None], clipped[None], self._kernels.sites)
        recovery = recover(cells, self._kernels, least_samples=1)
        rgb = develop(raw, self.gains, sensor.cfa)
        lit = self._lit(raw, rgb, clipped, recovery)
        return Shot(
            rgb=rgb,
            lit=lit,
            sharp=np.ascontiguousarray(sharp[inside][0].numpy()),
            clipped=clipped,
            noise=sensor.noise_at(iso).with_gains(self.gains),
        )

    def _lit(
        self, raw: FloatArray, rgb: FloatArray, clipped: NDArray[np.bool_], recovery: Recovery
    ) -> FloatArray:
        """Render lights in, as the stage `highlights` does that is given the mosaic."""
        painter, cfa = Painter(recovery, self._to_rec709), self.recipe.sensor.cfa
        if recovery.blind:
            lit = rgb.copy()
            painter.paint(lit, 0, self.gains)
            return lit
        cleared = raw.copy()
        painter.clear(cleared, clipped, 0, self._kernels.sites)
        planes = develop(cleared, self.gains, cfa)
        painter.light_up(planes, clipped, 0, self.gains)
        no_brighter(planes, rgb, near_clipped(clipped))
        return planes


def spread_light(sharp: Tensor, kernels: FloatArray) -> Tensor:
    """Convolve (b, 3, h, w) light with (3, n, n) kernels; the scene goes on at its border."""
    half = kernels.shape[-1] // 2
    wide = torch.nn.functional.pad(sharp, (half,) * 4, mode="replicate")
    size = wide.shape[-2], wide.shape[-1]
    otf = to_otf(torch.from_numpy(kernels)[None], size)
    spread = torch.fft.irfft2(torch.fft.rfft2(wide) * otf, s=size)
    inner: Tensor = spread[..., half : size[0] - half, half : size[1] - half]
    return inner.clamp(min=0)


def develop(raw: FloatArray, gains: tuple[float, float, float], cfa: CfaPattern) -> FloatArray:
    """Return (3, h, w) white-balanced planes of an (h, w) mosaic."""
    return np.ascontiguousarray(developed(raw, gains, cfa)[0].numpy())


def sample_of(
    shot: Shot, corner: tuple[int, int], recipe: HdrRecipe, *, side_px: int | None = None
) -> Sample:
    """Cut and stabilise a sample, of the side of the recipe unless another is given."""
    side, (top, left) = side_px or recipe.data.sample_px, corner
    part = np.s_[:, top : top + side, left : left + side]
    shots, reads = torch.tensor(shot.noise.shot), torch.tensor(shot.noise.read_variance)
    rgb, lit, sharp = (
        stabilise(
            torch.from_numpy(np.ascontiguousarray(x[part]))[None], shots, reads, scale=recipe.scale
        )[0]
        for x in (shot.rgb, shot.lit, shot.sharp)
    )
    return Sample(inputs={"rgb": rgb, "lit": lit}, target=sharp, weight=recipe.scale * shots.sqrt())


def draw_corner(rng: Generator, shot: Located, recipe: HdrRecipe) -> tuple[int, int]:
    """Draw where a sample is cut: about a light, mostly."""
    side, data = shot.clipped.shape[0], recipe.data
    free = side - data.sample_px + 1
    places = np.argwhere(shot.clipped)
    if not len(places) or rng.random() >= data.light_share:
        return int(rng.integers(free)), int(rng.integers(free))
    # the brightest of a few, as most clipped pixels are of the faintest lights
    candidates = places[rng.integers(len(places), size=LIGHT_CANDIDATES)]
    at = candidates[np.argmax(shot.sharp[:, candidates[:, 0], candidates[:, 1]].max(axis=0))]
    jitter = rng.integers(-data.sample_px // 3, data.sample_px // 3 + 1, size=2)
    top, left = np.clip(at - data.sample_px // 2 + jitter, 0, free - 1)
    return int(top), int(left)
