"""Real pairs: captures of a plane that shows known pictures, as samples to fine-tune on.

    FOLDER/pairs.toml           iso = 400.0, and white_balance = [R, 1.0, B] if not D65's
    FOLDER/capture/NAME.tiff    16-bit linear camera colours, white balanced, in sensor geometry
    FOLDER/reference/NAME.png   8-bit sRGB, what the plane shows

    aligned pair -> random places: Wiener bank, stabilised | reference warped to the capture

Where the reference does not reach, nothing is judged.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from camkit.arrays import FloatArray
from camkit.caller import option_text
from camkit.errors import ContractError, DecodeError
from camkit.models_def.kinds.bayer.fine_tuning.alignment import CLIPPED_ABOVE, AlignedPair, Aligner
from camkit.models_def.kinds.bayer.fine_tuning.homography import Homography, warp_to
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import (
    LAYOUT,
    NOT_JUDGED,
    Circumstances,
    Developed,
    finish_shot,
)
from camkit.models_def.training.adversarial.picture_fitter import Mix
from camkit.models_def.training.pictures import list_pictures, read_picture, to_linear
from camkit.models_def.training.pool import cut_patch
from camkit.models_def.training.sample import Batch, Sample
from camkit.noise import NoiseModel
from camkit.radial import RadialDistortion
from camkit.runtime.twin.light import camera_space
from camkit.side_file import read_side_toml
from camkit.units import to_mm

SETTINGS: Final = "pairs.toml"
LEAST_JUDGED: Final = 0.5
TRIES: Final = 50

Generator = np.random.Generator


@dataclass(frozen=True, slots=True, kw_only=True)
class PairSamples:
    """Samples of real pairs, as the pool holds them.

    Attributes:
        planes: (n, 6, s, s) capture and Wiener planes.
        targets: (n, 3, s, s).
        weights: (n, 3) factor to the square-root domain.
        alignments: Name of a pair -> how it was aligned.
    """

    planes: NDArray[np.float16]
    targets: NDArray[np.float16]
    weights: FloatArray
    alignments: dict[str, Homography]

    def draw_batch(self, rng: Generator, count: int, patch_px: int) -> Batch:
        """Draw random patches of random samples, turned and flipped."""
        indices = rng.integers(len(self.planes), size=count)
        cut = [cut_patch(rng, self.planes[i], self.targets[i], patch_px, LAYOUT) for i in indices]
        planes, targets = (
            torch.from_numpy(np.stack(patches).astype(np.float32))
            for patches in zip(*cut, strict=True)
        )
        weight = torch.from_numpy(self.weights[indices])
        return Batch(inputs=LAYOUT.by_name(planes), target=targets, weight=weight)

    def mixer(self, share: float, seed: int) -> Mix:
        """Return a function that replaces the first patches of a batch by patches of real pairs.

        Args:
            share: How many of them are replaced; a part of a patch is one in as many steps.
            seed: Of the draw; a step draws by itself alone, so that a resumed run draws the same.
        """

        def mix(batch: Batch, step: int) -> Batch:
            count, _, patch_px, _ = batch.target.shape
            rounds_up = np.random.default_rng((seed, 4, step)).random()
            real = int(np.floor(share * count + rounds_up))
            if real == 0:
                return batch
            real_batch = self.draw_batch(np.random.default_rng((seed, 3, step)), real, patch_px)
            return Batch(
                inputs={
                    name: torch.cat([planes, batch.inputs[name][real:]])
                    for name, planes in real_batch.inputs.items()
                },
                target=torch.cat([real_batch.target, batch.target[real:]]),
                weight=torch.cat([real_batch.weight, batch.weight[real:]]),
            )

        return mix


@dataclass(frozen=True, slots=True, kw_only=True)
class PairSettings:
    """The settings of a folder's captures: ISO and the white balance they contain."""

    iso: float
    gains: tuple[float, float, float]


def read_pairs(
    folder: Path,
    recipe: BayerRecipe,
    bank: PsfBank,
    distortion: RadialDistortion | None,
    *,
    seed: int,
) -> PairSamples:
    """Align every pair of a folder and cut `fine_tuning.pair_samples` samples from each.

    Args:
        folder: See the head of the module.
        recipe: Camera, sample sizes and number.
        bank: Kernels; its frozen ones filter the captures.
        distortion: Of the lens; None for none.
        seed: Of the places.

    Raises:
        ContractError: If the folder or its settings are not as described, a capture has not the
            size of the sensor, or a pair cannot be aligned (the message names the pair); or if the
            bank of the camera finds distances, which nothing here does.
    """
    if recipe.estimates_depth:
        raise ContractError(
            "pairs are filtered with the mean kernel, and the bank of this camera finds the "
            f'distance (wiener.depth = "estimated"); fine-tune without {option_text("pairs")}'
        )
    settings = _read_settings(folder / SETTINGS, recipe)
    noise = recipe.sensor.noise_at(settings.iso).with_gains(settings.gains)
    aligner = Aligner(recipe.sensor, bank, distortion)
    samples, alignments = [], {}
    for number, path in enumerate(list_pictures(folder / "capture")):
        rng = np.random.default_rng((seed, 2, number))
        try:
            pair = aligner.align(read_capture(path), to_linear(read_picture(_partner(path))))
            for _ in range(recipe.fine_tuning.pair_samples):
                place = _draw_place(rng, pair, recipe)
                samples.append(_cut(rng, pair, place, (aligner, bank, noise, settings), recipe))
        except ContractError as error:
            raise ContractError(f"pair {path.stem}: {error}") from error
        alignments[path.stem] = pair.homography
    planes = [s.stacked(LAYOUT).numpy().astype(np.float16) for s in samples]
    targets = [s.target.numpy().astype(np.float16) for s in samples]
    return PairSamples(
        planes=np.stack(planes),
        targets=np.stack(targets),
        weights=np.stack([s.weight.numpy() for s in samples]),
        alignments=alignments,
    )


def read_capture(path: Path) -> FloatArray:
    """Read a 16-bit RGB picture as (3, h, w) in 0..1.

    Raises:
        DecodeError: If it cannot be decoded.
        ContractError: If it is of another kind.
    """
    data = np.fromfile(path, dtype=np.uint8)
    decoded = cv2.imdecode(data, cv2.IMREAD_UNCHANGED) if data.size else None
    if decoded is None:
        raise DecodeError(f"{path.name} cannot be decoded as a picture")
    if decoded.dtype != np.uint16 or decoded.ndim != 3 or decoded.shape[2] != 3:
        raise ContractError(
            f"a capture must be 16-bit RGB, linear; got {decoded.dtype} {decoded.shape}"
        )
    planes = decoded[..., ::-1].transpose(2, 0, 1).astype(np.float32)
    return np.ascontiguousarray(planes / np.float32(65535))


def _read_settings(path: Path, recipe: BayerRecipe) -> PairSettings:
    try:
        table = read_side_toml(path, "the settings of pairs")
    except ContractError as error:
        raise ContractError(
            f"real pairs need {path} with iso and optionally white_balance: {error}"
        ) from error
    _, gains = camera_space(recipe.sensor)
    iso, balance = table.pop("iso", None), table.pop("white_balance", list(gains))
    numbers = [iso, *balance] if isinstance(balance, list) else []
    plain = all(isinstance(n, int | float) and n > 0 for n in numbers)
    if table or len(numbers) != 4 or not plain:
        raise ContractError(
            f"{path} must hold iso > 0 and at most white_balance = [R, G, B] beside it; got "
            f"iso {iso!r}, white_balance {balance!r} and {sorted(table)}"
        )
    _, r, g, b = (float(n) for n in numbers)
    return PairSettings(iso=float(iso), gains=(r, g, b))


def _partner(capture: Path) -> Path:
    folder = capture.parent.parent / "reference"
    partners = [p for p in list_pictures(folder) if p.stem == capture.stem]
    if len(partners) != 1:
        raise ContractError(f"{folder} must hold one picture {capture.stem}.*; got {len(partners)}")
    return partners[0]


def _draw_place(rng: Generator, pair: AlignedPair, recipe: BayerRecipe) -> tuple[int, int]:
    """Draw the first pixel (x, y) of a sample that the reference covers at least by half."""
    margin, side = recipe.data.margin_px, recipe.data.sample_px
    height, width = pair.capture.shape[1:]
    room = np.array([width, height]) - (side + 2 * margin)
    if room.min() < 0:
        raise ContractError(f"a capture must hold a sample of {side + 2 * margin} px")
    for _ in range(TRIES):
        x, y = (margin + 2 * int(v) for v in rng.integers(0, room // 2 + 1))
        _, inside = _warped(pair, (x, y), side)
        if inside.mean() >= LEAST_JUDGED:
            return x, y
    raise ContractError("the reference covers too little of the capture")


def _cut(
    rng: Generator,
    pair: AlignedPair,
    place: tuple[int, int],
    setup: tuple[Aligner, PsfBank, NoiseModel, PairSettings],
    recipe: BayerRecipe,
) -> Sample:
    aligner, bank, noise, settings = setup
    data, (x, y) = recipe.data, place
    margin, side = data.margin_px, data.sample_px
    centre_px = np.array([place]) + (side - 1) / 2
    reach_mm = data.block_jitter_px * to_mm(recipe.sensor.pixel_pitch_um)
    block_x_mm, block_y_mm = aligner.to_sensor_mm(centre_px)[0] + rng.uniform(-1, 1, 2) * reach_mm
    illumination = float(aligner.illumination(centre_px)[0])
    window = np.s_[:, y - margin : y + side + margin, x - margin : x + side + margin]
    planes = torch.from_numpy(pair.capture[window].copy())[None]
    reference, inside = _warped(pair, place, side)
    developed = Developed(
        planes=planes,
        unknown=planes.amax(1, keepdim=True) >= CLIPPED_ABOVE,
        true=torch.from_numpy(reference * np.float32(illumination)).clamp(min=0)[None],
        circumstances=Circumstances(
            noise=noise,
            gains=settings.gains,
            frozen=bank.frozen_kernels(float(block_x_mm), float(block_y_mm)),
            illumination=illumination,
            height_mm=float(np.hypot(block_x_mm, block_y_mm)),
        ),
    )
    shot = finish_shot(developed, recipe)
    target = shot.sample.target
    judged = torch.where(torch.from_numpy(inside), target, torch.tensor(NOT_JUDGED))
    return replace(shot.sample, target=judged)


def _warped(
    pair: AlignedPair, place: tuple[int, int], side: int
) -> tuple[FloatArray, NDArray[np.bool_]]:
    """Return the reference as it lies in a square of the capture, and where it is valid."""
    grid = np.mgrid[0:side, 0:side][::-1].reshape(2, -1).T + np.array(place, dtype=np.float64)
    at = pair.to_reference(grid).reshape(side, side, 2)
    return warp_to(pair.reference, at[..., 0], at[..., 1])
