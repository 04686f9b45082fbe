"""The toy camera's part of the design side: its stages, samples and judging.

scene, twice as fine -> mean of 2 x 2 -> streak of its place -> noise -> DN    capture
denoise   stabilised capture           -> stabilised, without noise
upscale   linear, with a little noise  -> the scene
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor, nn

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.psf_file import psf_to_bytes, read_psf, write_psf
from camkit.bundle.stages import Color, Linearise, Network, Repair
from camkit.models_def.sensors.forward import blur
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.training.kind import Design, Restorer, Score
from camkit.models_def.training.pictures import SCENE_SEED, open_source
from camkit.models_def.training.sample import Sample, SampleLayout
from camkit.psf import FrozenPsf
from camkit.runtime.bank.psf import FieldKernels, color_kernels
from camkit.scenes import procedural_scene
from tests.toy_camera.networks import build_toy_network
from tests.toy_camera.recipe import ROLES, ToyRecipe, to_toy_recipe

SCALE: Final = 64.0
FACTOR: Final = 2
ISOS: Final = (400.0, 3200.0)
RESIDUAL: Final = 0.3
"""Share of the noise that is left where the first network has been."""
LAYOUTS: Final = {
    role: SampleLayout(
        inputs=(Port(name="planes", channels=1),),
        outputs=(Port(name="planes", channels=1, scale=scale),),
        turned=False,
    )
    for role, scale in zip(ROLES, (1, FACTOR), strict=True)
}
PSF_FILE: Final = "psf.safetensors"

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class ToyMaterial:
    """The frozen PSF; there is no lens."""

    psf: FrozenPsf
    designed: Mapping[str, bytes] = field(default_factory=dict)

    def digest(self) -> str:
        """Hash the kernels."""
        return hashlib.sha256(psf_to_bytes(self.psf)).hexdigest()

    def write(self, folder: Path) -> None:
        """Write the kernels for another process."""
        write_psf(folder / PSF_FILE, self.psf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Photographer:
    """Photographs scenes for one role."""

    recipe: ToyRecipe
    role: str
    kernels: FieldKernels

    @property
    def side_px(self) -> int:
        """Side of the scene that a sample needs, in its own fine pixels."""
        return FACTOR * (self.recipe.data.sample_px + self.kernels.kernels.shape[-1] - 1)

    def take(
        self, scene: FloatArray, place: tuple[float, float], iso: float, rng: Generator
    ) -> Sample:
        """Photograph a (3, side, side) scene at a place (x, y) in -1..1 of the half sensor."""
        sensor, sample_px = self.recipe.sensor, self.recipe.data.sample_px
        half_mm = np.array([sensor.width_px, sensor.height_px]) * sensor.pixel_pitch_um / 2000
        x_mm, y_mm = (float(v) for v in np.array(place) * half_mm)
        fine = torch.from_numpy(scene).mean(0)[None, None].clamp(0, 0.95)
        coarse = nn.functional.avg_pool2d(fine, FACTOR)
        kernels = torch.from_numpy(self.kernels.at(x_mm, y_mm))[None]
        light = blur(coarse, kernels).clamp(min=0)
        noise = sensor.noise_at(iso)
        shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
        grain = torch.from_numpy(rng.standard_normal(light.shape, dtype=np.float32))
        grain = grain * (light * shot + read).sqrt()
        if self.role == "denoise":
            planes, target = (
                stabilise(x, shot, read, scale=SCALE)[0] for x in (light + grain, light)
            )
            return Sample(inputs={"planes": planes}, target=target, weight=SCALE * shot.sqrt())
        cut = (fine.shape[-1] - FACTOR * sample_px) // 2
        sharp = fine[0, :, cut:, cut:][:, : FACTOR * sample_px, : FACTOR * sample_px]
        planes = (light + RESIDUAL * grain)[0]
        return Sample(inputs={"planes": planes}, target=sharp, weight=torch.ones(1))


class ToyMaker:
    """Makes sample i."""

    def __init__(self, photographer: Photographer, pictures: Path | None, seed: int) -> None:
        self._photographer, self._seed = photographer, seed
        data = photographer.recipe.data
        self._source = open_source(
            pictures,
            picture_share=data.picture_share,
            scenes=data.procedural_scenes,
            scene_px=data.scene_px,
        )

    def make(self, index: int) -> Sample:
        """Photograph a crop anywhere on the sensor."""
        rng = np.random.default_rng((self._seed, index))
        x, y = (float(v) for v in rng.uniform(-1, 1, 2))
        iso = float(rng.uniform(*ISOS))
        crop = self._source.draw_crop(rng, self._photographer.side_px)
        return self._photographer.take(crop, (x, y), iso, rng)


@dataclass(frozen=True, slots=True, kw_only=True)
class ToyJudge:
    """Judges by a few scenes that are never trained on."""

    samples: Mapping[float, tuple[Sample, ...]]
    layout: SampleLayout

    def baselines(self) -> Mapping[str, float]:
        """What is given, every sample as often as the target has it."""
        return {"input": self.score(lambda planes: _repeated(planes, self.layout.scale)).mean_db}

    def score(self, restore: Restorer) -> Score:
        """Mean PSNR in the domain of the target, by ISO."""
        with torch.no_grad():
            by_iso = {
                f"{iso:g}": float(np.mean([_psnr(s, restore, self.layout) for s in samples]))
                for iso, samples in self.samples.items()
            }
        return Score(mean_db=float(np.mean(list(by_iso.values()))), parts={"by_iso": by_iso})


def _repeated(planes: Tensor, scale: int) -> Tensor:
    return planes.repeat_interleave(scale, -1).repeat_interleave(scale, -2)


def _psnr(sample: Sample, restore: Restorer, layout: SampleLayout) -> float:
    gap = (restore(sample.stacked(layout)[None])[0] - sample.target) * sample.weight[:, None, None]
    return float(-10 * torch.log10(gap.square().mean() + 1e-12))


class ToyPart:
    """Fulfils `camkit.models_def.training.kind.TrainingKind`."""

    @property
    def roles(self) -> tuple[str, ...]:
        """Two, in a row."""
        return ROLES

    @property
    def camera_parts(self) -> tuple[str, ...]:
        """What says which camera it is."""
        return ("name", "kind", "sensor", "optics")

    def to_recipe(self, table: Mapping[str, Any]) -> ToyRecipe:
        """Check the tables of a recipe."""
        return to_toy_recipe(table)

    def design(self, recipe: ToyRecipe) -> Design:
        """No bank, no correction of optics."""
        del recipe
        return Design(
            stages=(
                Linearise(),
                Repair(),
                Network(role="denoise", takes=("sound",), gives=("quiet",), scale=SCALE),
                Network(role="upscale", takes=("quiet",), gives=("fine",), transform="none"),
                Color(takes=("fine",)),
            ),
            fails_on=("streaks of another direction",),
        )

    def build_network(self, name: str, **config: Any) -> nn.Module:
        """Build a network of its own."""
        return build_toy_network(name, **config)

    def layout(self, recipe: ToyRecipe, role: str) -> SampleLayout:
        """One plane in, one out; the second network makes it twice as large."""
        del recipe
        return LAYOUTS[role]

    def finish(self, recipe: ToyRecipe, role: str) -> None:
        """Nothing is done behind a network."""
        del recipe, role

    def prepare(self, recipe: ToyRecipe, recipe_folder: Path, cache_folder: Path) -> ToyMaterial:
        """Read the frozen PSF."""
        del cache_folder
        return ToyMaterial(psf=read_psf(recipe_folder / recipe.optics.psf))

    def read_material(self, folder: Path) -> ToyMaterial:
        """Read the PSF that a trainer wrote."""
        return ToyMaterial(psf=read_psf(folder / PSF_FILE))

    def samples_digest(self, recipe: ToyRecipe, role: str, seed: int) -> str:
        """Hash what decides the samples."""
        content = [recipe.sensor.model_dump(mode="json"), asdict(recipe.data), role, seed]
        return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()

    def maker(
        self,
        recipe: ToyRecipe,
        role: str,
        material: ToyMaterial,
        pictures: Path | None,
        seed: int,
    ) -> ToyMaker:
        """Open the scenes."""
        return ToyMaker(_photographer(recipe, role, material), pictures, seed)

    def judge(
        self, recipe: ToyRecipe, role: str, material: ToyMaterial, pictures: Path | None
    ) -> ToyJudge:
        """Photograph scenes at two ISOs."""
        del pictures
        photographer = _photographer(recipe, role, material)
        side = photographer.side_px
        samples = {
            iso: tuple(
                photographer.take(
                    procedural_scene(SCENE_SEED - 1 - i, side, side),
                    (0.5 * i - 0.5, 0.5 - 0.5 * i),
                    iso,
                    np.random.default_rng((int(iso), i)),
                )
                for i in range(3)
            )
            for iso in ISOS
        }
        return ToyJudge(samples=samples, layout=LAYOUTS[role])


def _photographer(recipe: ToyRecipe, role: str, material: ToyMaterial) -> Photographer:
    kernels = color_kernels(material.psf, *recipe.sensor.response_arrays())
    return Photographer(recipe=recipe, role=role, kernels=kernels)


PART: Final = ToyPart()
