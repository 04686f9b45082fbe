"""The network of a joint design: it learns to read a plate, and tells the plate where to go.

    PSFs -- kernels -- captures of nights -- network -- picture's loss, eq. (5.11)
      '------------------ slope of the loss to the PSFs ------------'

The network takes and gives roots of linear light, as those of the role `whole` do. Heights are not
known here: the loop carries the slope from the PSFs to them.
"""

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import torch
from torch import Tensor

from camkit.errors import ContractError
from camkit.models_def.design.plate.nights import TRAIN_SEED, VALID_SEED, Nights, Patches
from camkit.models_def.design.plate.reader_recipe import ReaderRecipe
from camkit.models_def.design.plate.recording import recorded, whole_kernels
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.thesis.coded_samples import layout_of
from camkit.models_def.kinds.hdr.thesis.networks import THESIS_NAMES
from camkit.models_def.kinds.hdr.thesis.thesis_losses import EPSILON, GAMMA, HUBER
from camkit.models_def.kinds.hdr.validation import MOST_DB
from camkit.models_def.networks.catalog import build_network, check_patch
from camkit.models_def.sensors.forward import blur
from camkit.models_def.training.first_weights import FirstWeights, read_first_weights
from camkit.models_def.training.fitter import Fitter
from camkit.models_def.training.kind import read_recipe
from camkit.models_def.training.recipe import NetworkRecipe
from camkit.scenes.saturation import CEILING

ROLE: Final = "whole"
COLOURS: Final = 3
_FLOOR: Final = 1e-5
"""The root of zero has no slope."""

State = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """The result of reading fixed patches.

    Attributes:
        loss: Eq. (5.11).
        db: Mean PSNR of linear light, peak 2^8.
        capture_db: The same of the captures themselves.
    """

    loss: float
    db: float
    capture_db: float


class PlateReader:
    """A network, its captures, its fitter."""

    def __init__(
        self,
        reader_recipe: ReaderRecipe,
        camera: HdrRecipe,
        *,
        psf_px: int,
        seed: int,
        first: FirstWeights | None = None,
    ) -> None:
        """Prepare network, captures and fitter.

        Args:
            reader_recipe: Of the recipe of the plate.
            camera: The one that `reader_recipe` names.
            psf_px: Odd side of the PSFs.
            seed: Of weights and draws.
            first: First weights; None for random ones.

        Raises:
            ContractError: If there is no such network, or it does not take the patches.
        """
        self.recipe, self._seed = reader_recipe, seed
        self._entry = _entry(reader_recipe, camera, seed)
        data = replace(
            camera.data, sample_px=reader_recipe.patch_px, capture_px=reader_recipe.patch_px
        )
        camera = replace(camera, data=data)

        def nights(first_seed: int, count: int) -> Nights:
            return Nights(
                camera,
                first_seed=first_seed,
                count=count,
                scene_px=reader_recipe.scene_px,
                psf_px=psf_px,
            )

        self._nights = nights(TRAIN_SEED, reader_recipe.scenes)
        self._valid_nights = nights(VALID_SEED, reader_recipe.valid_patches)
        self._valid: Patches | None = None
        self.fitter = Fitter(self._entry, build_network, "cpu", first)

    def follow(self, light: Tensor, step: int, progress: float) -> tuple[Tensor, float]:
        """Train the network for its steps behind the present plate.

        Args:
            light: (3, n, n) PSFs, shares of the light.
            step: Of the plate, done before.
            progress: How much of the schedule lies behind, 0..1.

        Returns:
            Slope of the picture's loss to the PSFs, its mean over the steps, and the mean loss.
        """
        leaf = light.detach().requires_grad_()
        losses = []
        for k in range(self.recipe.network_steps):
            number = step * self.recipe.network_steps + k
            patches = self._nights.draw(
                np.random.default_rng((self._seed, number)), self.recipe.batch
            )
            captures, truth = self._exposures(leaf, patches)
            loss = picture_loss(self.fitter.run(captures, progress), truth)
            self.fitter.descend(loss, number, progress)
            losses.append(float(loss.detach()))
        return torch.as_tensor(leaf.grad) / len(losses), float(np.mean(losses))

    def judge(self, light: Tensor) -> Picture:
        """Read fixed patches behind PSFs (3, n, n), by the averaged network."""
        if self._valid is None:
            rng = np.random.default_rng((VALID_SEED, self.recipe.patch_px))
            self._valid = self._valid_nights.draw(rng, self.recipe.valid_patches)
        with torch.no_grad():
            captures, truth = self._exposures(light, self._valid)
            roots = self.fitter.restore(captures)
            return Picture(
                loss=float(picture_loss(roots, truth)),
                db=_psnr_db(roots, truth),
                capture_db=_psnr_db(captures, truth),
            )

    def _exposures(self, light: Tensor, patches: Patches) -> tuple[Tensor, Tensor]:
        """Return roots of captures (b, 3, p, p) and the true light there."""
        spread = blur(patches.sharp, whole_kernels(light)[None]).clamp(min=0)
        captured = recorded(
            spread,
            self._nights.pixels,
            shot=patches.shot,
            read_variance=patches.read_variance,
            normal=patches.normal,
        )
        edge = light.shape[-1] // 2
        inner = slice(edge, patches.sharp.shape[-1] - edge)
        return (captured.clamp(min=0) + _FLOOR).sqrt(), patches.sharp[..., inner, inner]

    def average(self) -> State:
        """Return the averaged weights."""
        return self.fitter.average()

    def take_average(self, state: State) -> None:
        """Load averaged weights."""
        self.fitter.averaged.load_state_dict(state)

    def state(self) -> State:
        """Return all that a resumed run needs."""
        return {
            "weights": self.fitter.weights(),
            "average": self.fitter.average(),
            "optimizer": self.fitter.optimizer_state(),
        }

    def load(self, state: State) -> None:
        """Restore a saved state."""
        self.fitter.load(state["weights"], state["average"], state["optimizer"])


def open_reader(
    reader_recipe: ReaderRecipe, *, psf_px: int, colours: int, seed: int, folder: Path | None = None
) -> PlateReader:
    """Open the reader of a recipe.

    Args:
        reader_recipe: The table [reader].
        psf_px: Odd side of the PSFs.
        colours: Of the plate's recipe.
        seed: Of weights and draws.
        folder: For relative paths.

    Raises:
        ContractError: If the camera's recipe or the first weights cannot be read or do not fit.
    """
    camera = read_recipe(_path_of(reader_recipe.recipe, folder))
    if not isinstance(camera, HdrRecipe):
        raise ContractError(
            f'reader.recipe must be that of a camera of the kind "hdr"; '
            f"{reader_recipe.recipe} is of the kind {camera.kind!r}"
        )
    if colours != COLOURS:
        raise ContractError(
            f"a reader wants pixels.wavelengths_um for R, G and B, {COLOURS} of them; got {colours}"
        )
    first = None
    if reader_recipe.begin:
        first = read_first_weights(_path_of(reader_recipe.begin, folder), reader_recipe.size, ROLE)
    return PlateReader(reader_recipe, camera, psf_px=psf_px, seed=seed, first=first)


def reader_digest(reader_recipe: ReaderRecipe, folder: Path | None) -> str:
    """Return a hash of the camera's recipe and the first weights, which the table only names."""
    digest = hashlib.sha256()
    for name in filter(None, (reader_recipe.recipe, reader_recipe.begin)):
        path = _path_of(name, folder)
        digest.update(path.read_bytes() if path.is_file() else name.encode())
    return digest.hexdigest()


def picture_loss(roots: Tensor, light: Tensor) -> Tensor:
    """Return the Huber loss of roots, eq. (5.11).

    Args:
        roots: (b, 3, h, w) of a network: what it takes for the root of light.
        light: (b, 3, h, w) linear, the truth.
    """
    return torch.nn.functional.huber_loss(roots, (light + EPSILON) ** GAMMA, delta=HUBER)


def _psnr_db(roots: Tensor, light: Tensor) -> float:
    gap = roots.clamp(min=0).square().clamp(max=CEILING) - light.clamp(max=CEILING)
    mean = gap.double().square().mean((1, 2, 3)).clamp(min=1e-30)
    db = (10 * torch.log10(CEILING**2 / mean)).clamp(max=MOST_DB)
    return float(db.mean())


def _entry(reader_recipe: ReaderRecipe, camera: HdrRecipe, seed: int) -> NetworkRecipe:
    entry = camera.network(reader_recipe.size, ROLE)
    if entry.network in THESIS_NAMES:
        raise ContractError(
            f"reader.size {reader_recipe.size}: {entry.network} is trained by losses of its own "
            "through VGG-19; take a network from the capture to the picture, lean_s say"
        )
    # slopes of a plate are small differences
    schedule = replace(entry.schedule, precision="float32", seed=seed)
    network = build_network(entry.network, **entry.config)
    check_patch(entry.network, network, reader_recipe.patch_px)
    layout_of(camera, ROLE).check(entry.network, network)
    return replace(entry, schedule=schedule)


def _path_of(name: str, folder: Path | None) -> Path:
    path = Path(name) if folder is None else folder / name
    return path if path.is_file() else Path(name)
