"""One training sample: a sharp crop photographed by a copy of the camera, and what it should be.

    sharp crop -> exposure, camera space -> blur of a copy -> illumination -> CFA -> noise -> clip,
    quantise -> white balance -> demosaic -> Wiener (frozen kernel of a block) -> stabilise -> Shot

A sample is one place on the sensor with one blur. It is simulated with surroundings of
`margin_px`, so that the Wiener filter sees true context, and cut to `sample_px` afterwards.
"""

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from camkit.arrays import FloatArray
from camkit.bundle.facts import Port
from camkit.bundle.light_bound import BRIGHT
from camkit.bundle.stages import Wiener
from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.networks.light import bounded, keep_share
from camkit.models_def.sensors.demosaic import developed
from camkit.models_def.sensors.exposure import expose
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.sensors.wiener import to_otf, wiener_restore
from camkit.models_def.training.sample import Batch, Finish, Sample, SampleLayout
from camkit.noise import NoiseModel
from camkit.runtime.bank.blocks import Block, taper_edges
from camkit.runtime.bank.blocks import to_otf as to_runtime_otf
from camkit.runtime.bank.wiener import wiener_filter
from camkit.runtime.twin.light import camera_space
from camkit.units import MM_PER_M

CLIPPED_REACH_PX: Final = 4
UNKNOWN_ABOVE: Final = 0.9
NOT_JUDGED: Final = -1.0
HEIGHT_POWER: Final = 0.75
LIGHT_TINT: Final = 0.08
LAYOUT: Final = SampleLayout(
    inputs=(Port(name="capture", channels=3), Port(name="wiener", channels=3)),
    outputs=(Port(name="clean", channels=3),),
)
"""What the networks take and give. A lens of revolution blurs every way, so samples may turn."""
KEPT_PORT: Final = Port(name="kept", channels=1)
"""The share of a network's change that is kept beside clipped samples, where light is bounded."""
MOST_GAIN: Final = 3.5
"""Of a white balance; daylight and lamps need 1 to 3."""
LEAST_CAST: Final = 1 / 8
"""Of light of any colour: its faintest channel over its brightest."""

Generator = np.random.Generator
Sides = tuple[bool, bool, bool, bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Exposure:
    """The settings of a sample: the place, the light, and the copy of the camera.

    Attributes:
        x_mm: Position on the sensor, to the right of the axis.
        y_mm: Position down the rows.
        block_x_mm: Centre of the Wiener block that the place belongs to.
        block_y_mm: Likewise.
        copy: Index of the fabricated copy.
        iso: Sensitivity.
        factor: Exposure, 1 for the picture as it is.
        borders: Whether the picture ends at the (top, bottom, left, right) of the sample.
        drift: (size, turn in radians) of the copy's kernels against the traced ones.
        designed: Whether it is the lens as designed, at the distance of the copy, and no copy.
        gains: White balance (R, G, B); None for that of the sensor's illuminant.
        cast: What the light of each channel is multiplied by, behind the white balance.
        filter_depth: Number of the depth whose kernels the Wiener filter has, between two where the
            distance is estimated; None for the mean over the depths.
    """

    x_mm: float
    y_mm: float
    block_x_mm: float
    block_y_mm: float
    copy: int
    iso: float
    factor: float = 1.0
    borders: Sides = (False, False, False, False)
    drift: tuple[float, float] = (1.0, 0.0)
    filter_depth: float | None = None
    designed: bool = False
    gains: tuple[float, float, float] | None = None
    cast: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """A finished sample and the facts that its front end used.

    Attributes:
        sample: Stabilised capture, Wiener planes and sharp planes, (3, s, s) each.
        noise: Noise after white balance.
        illumination: Relative illumination, contained in the planes and the target.
    """

    sample: Sample
    noise: NoiseModel
    illumination: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Circumstances:
    """The facts of a sample that the front end uses.

    Attributes:
        noise: After white balance.
        gains: White balance (R, G, B).
        frozen: (1, 3, kh, kw) kernels of the block that the place belongs to.
        illumination: Relative illumination of the place.
        height_mm: Field height of the block.
        noise_rise: What was done before the bank multiplied the variance of every colour by.
        red: (row, column) of red in the first cell of the mosaic that the planes were made of; None
            where that is not known: no filter then works on the mosaic.
    """

    noise: NoiseModel
    gains: tuple[float, float, float]
    frozen: Tensor
    illumination: float
    height_mm: float = 0.0
    noise_rise: tuple[float, float, float] = (1.0, 1.0, 1.0)
    red: tuple[int, int] | None = None

    @property
    def met_noise(self) -> NoiseModel:
        """Return the noise that the bank meets."""
        return self.noise.raised(self.noise_rise)

    @property
    def met(self) -> tuple[Tensor, Tensor]:
        """Return shot and read variance of that noise."""
        return torch.tensor(self.met_noise.shot), torch.tensor(self.met_noise.read_variance)


@dataclass(frozen=True, slots=True, kw_only=True)
class Developed:
    """A photographed crop before any filter.

    Attributes:
        planes: (1, 3, S, S) linear, white balanced, with surroundings of `margin_px`.
        unknown: (1, 1, S, S) bool, where the sensor clipped.
        true: (1, 3, s, s) sharp light of the middle, illumination contained.
        circumstances: Noise, gains, kernels and light.
    """

    planes: Tensor
    unknown: Tensor
    true: Tensor
    circumstances: Circumstances


def scene_side_px(recipe: BayerRecipe, bank: PsfBank) -> int:
    """Return the side of the sharp crop that a sample needs."""
    return recipe.data.sample_px + 2 * (recipe.data.margin_px + bank.radius_px)


def corner_height_mm(recipe: BayerRecipe) -> float:
    """Return the field height of the sensor's corner."""
    sensor = recipe.sensor
    sides = (sensor.width_px - 1, sensor.height_px - 1)
    return float(np.hypot(*sides)) / 2 * sensor.pixel_pitch_um / 1000


def draw_exposure(rng: Generator, recipe: BayerRecipe, bank: PsfBank) -> Exposure:
    """Draw the conditions of a training sample."""
    data = recipe.data
    height = corner_height_mm(recipe) * rng.random() ** HEIGHT_POWER
    azimuth = rng.uniform(0, 2 * np.pi)
    x_mm, y_mm = height * np.cos(azimuth), height * np.sin(azimuth)
    jitter = rng.uniform(-1, 1, 2) * data.block_jitter_px * recipe.sensor.pixel_pitch_um / 1000
    at_border = rng.random() < data.border_share
    borders = rng.random(4) < 0.4 if at_border else np.zeros(4, dtype=bool)
    least, most = data.exposure_min_ev, data.exposure_max_ev
    stops = rng.triangular(least, min(max(0.0, least), most), most) if most > least else most
    exposure = Exposure(
        x_mm=float(x_mm),
        y_mm=float(y_mm),
        block_x_mm=float(x_mm + jitter[0]),
        block_y_mm=float(y_mm + jitter[1]),
        copy=_draw_copy(rng, data.depth_shares, bank),
        iso=float(np.exp(rng.uniform(np.log(data.iso_min), np.log(data.iso_max)))),
        factor=float(2.0**stops),
        borders=(bool(borders[0]), bool(borders[1]), bool(borders[2]), bool(borders[3])),
        drift=_draw_drift(rng, recipe),
    )
    # drawn last, and only where asked for: other recipes keep their samples
    if recipe.estimates_depth or (
        data.known_depth_share > 0 and rng.random() < data.known_depth_share
    ):
        error = rng.normal() * data.depth_error if data.depth_error else 0.0
        exposure = replace(exposure, filter_depth=told_depth(recipe, exposure.copy, error))
    if data.designed_share > 0 and rng.random() < data.designed_share:
        exposure = replace(exposure, designed=True)
    if data.light_share > 0 and rng.random() < data.light_share:
        gains, cast = _draw_light(rng, recipe)
        exposure = replace(exposure, gains=gains, cast=cast)
    return exposure


def told_depth(recipe: BayerRecipe, copy: int, error: float = 0.0) -> float:
    """Return the number of the depth that a filter assumes for a copy.

    Args:
        recipe: Its lens has several depths.
        copy: Each depth of a copy counted.
        error: Of the nearness, in 1/m; what lies beyond the depths is taken for their end.
    """
    nearness = MM_PER_M / np.array(recipe.lens.depths_mm)
    numbers = np.arange(nearness.size)
    at = nearness[copy % nearness.size] + error
    return float(np.interp(at, nearness[::-1], numbers[::-1]))


def layout_of(recipe: BayerRecipe) -> SampleLayout:
    """Return the layout of a recipe's samples; those of a measured PSF do not turn."""
    masks = () if recipe.light is None else (KEPT_PORT,)
    return replace(LAYOUT, masks=masks, turned=not recipe.lens.psf)


def finish_of(recipe: BayerRecipe) -> Finish | None:
    """Return the stage that follows the network; None where its light is not bounded."""
    bound = recipe.light
    if bound is None:
        return None

    def finish(output: Tensor, batch: Batch) -> Tensor:
        front = batch.inputs["wiener"].to(output.device)
        kept_share = batch.masks[KEPT_PORT.name].to(output.device)
        # without the noise of reading, which is little there
        bright = BRIGHT**0.5 / batch.weight.to(output.device)
        return bounded(output, front, kept_share, bound, scale=recipe.scale, bright=bright)

    return finish


def _draw_light(
    rng: Generator, recipe: BayerRecipe
) -> tuple[tuple[float, float, float] | None, tuple[float, float, float]]:
    """Draw a white balance from 1, 1, 1 up, and the colour of a light."""
    gains, cast = None, (1.0, 1.0, 1.0)
    kind = int(rng.integers(4))
    if kind == 0:
        gains = (1.0, 1.0, 1.0)
    elif kind == 1:
        red, blue = np.exp(rng.uniform(0, np.log(MOST_GAIN), 2))
        gains = (float(red), 1.0, float(blue))
    elif kind == 2:  # raw values of a grey are about equal
        _, balance = camera_space(recipe.sensor)
        cast = _peak_one(np.array(balance) * np.exp(rng.normal(0, 0.1, 3)))
    if kind in (1, 3):
        cast = _peak_one(np.exp(rng.uniform(np.log(LEAST_CAST), 0, 3)))
    return gains, cast


def _peak_one(values: NDArray[np.float64]) -> tuple[float, float, float]:
    red, green, blue = (float(v) for v in values / values.max())
    return red, green, blue


def _draw_copy(rng: Generator, shares: tuple[float, ...], bank: PsfBank) -> int:
    """Draw a copy to train on, at one of its depths."""
    if not shares:
        return int(rng.integers(bank.training_copies))
    copy = int(rng.integers(bank.training_copies // bank.depths))
    odds = np.array(shares) / np.sum(shares)
    return copy * bank.depths + int(rng.choice(bank.depths, p=odds))


def _draw_drift(rng: Generator, recipe: BayerRecipe) -> tuple[float, float]:
    """Draw how far the lens has drifted; most have not."""
    data = recipe.data
    if rng.random() >= data.drift_share:
        return 1.0, 0.0
    size, turn = rng.uniform(-1, 1, 2) * (data.drift_scale, np.deg2rad(data.drift_turn_deg))
    return float(1 + size), float(turn)


def tint_crop(rng: Generator, crop: FloatArray) -> FloatArray:
    """Vary the colour of the light a little, since pictures are graded."""
    tint = np.exp(rng.normal(0, LIGHT_TINT, 3)).astype(np.float32)
    return crop * tint[:, None, None]


def make_shot(
    crop: FloatArray,
    exposure: Exposure,
    recipe: BayerRecipe,
    bank: PsfBank,
    rng: Generator,
    truth: FloatArray | None = None,
) -> Shot:
    """Photograph a sharp crop and run the front end of the runtime on it; see `photograph`."""
    return finish_shot(photograph(crop, exposure, recipe, bank, rng, truth), recipe)


def photograph(
    crop: FloatArray,
    exposure: Exposure,
    recipe: BayerRecipe,
    bank: PsfBank,
    rng: Generator,
    truth: FloatArray | None = None,
) -> Developed:
    """Photograph a sharp crop and develop it.

    Args:
        crop: (3, side, side) linear Rec.709 with side = `scene_side_px`.
        exposure: The conditions.
        recipe: Camera and sample sizes.
        bank: PSFs of the copies and the frozen one.
        rng: Source of the noise.
        truth: What the crop should become, likewise; None for itself.

    Raises:
        ContractError: If the crop has another size.
    """
    side = scene_side_px(recipe, bank)
    truth = crop if truth is None else truth
    if not crop.shape == truth.shape == (3, side, side):
        raise ContractError(f"a crop must be (3, {side}, {side}); got {crop.shape}")
    sensor, data = recipe.sensor, recipe.data
    matrix, balance = camera_space(sensor)
    red, green, blue = balance if exposure.gains is None else exposure.gains
    gains = red, green, blue
    illumination = float(bank.illumination_at(exposure.x_mm, exposure.y_mm))
    cast = np.array(exposure.cast)[:, None]
    to_camera = torch.from_numpy(cast * matrix * exposure.factor).float()
    sharp, true = (
        (to_camera @ torch.from_numpy(light).reshape(3, -1)).reshape(1, 3, side, side).clamp_(min=0)
        for light in (crop, truth)
    )
    place = exposure.x_mm, exposure.y_mm
    if exposure.designed:
        depth = exposure.copy % bank.depths if bank.depths > 1 else None
        kernels = bank.frozen_kernels(*place, depth)
    else:
        kernels = bank.blur_kernels(exposure.copy, *place)
    kernels = _drifted(kernels, *exposure.drift)
    blurred = _blur(sharp, kernels, bank.radius_px) * illumination
    capture, saturated = expose(blurred, gains, recipe.sensor, exposure.iso, rng)
    noise = sensor.noise_at(exposure.iso).with_gains(gains)
    planes, unknown = _planes(capture, saturated, gains, recipe, exposure.borders)
    frozen = bank.frozen_kernels(
        exposure.block_x_mm,
        exposure.block_y_mm,
        exposure.filter_depth,
    )
    return Developed(
        planes=planes,
        unknown=unknown,
        true=cut_middle(true, data.sample_px) * illumination,
        circumstances=Circumstances(
            noise=noise,
            gains=gains,
            frozen=frozen,
            illumination=illumination,
            height_mm=float(np.hypot(exposure.block_x_mm, exposure.block_y_mm)),
            red=_red_of(recipe, exposure.borders),
        ),
    )


def _red_of(recipe: BayerRecipe, borders: Sides) -> tuple[int, int] | None:
    """Return (row, column) of red in the first cell of planes that borders may be mirrored in.

    None of a sensor without a mosaic.
    """
    if recipe.sensor.cfa is None:
        return None
    row, column = divmod(recipe.sensor.cfa.index("R"), 2)
    beyond_px = [recipe.data.margin_px if borders[side] else 0 for side in (0, 2)]
    return (row + beyond_px[0]) % 2, (column + beyond_px[1]) % 2


def filtered(developed: Developed, recipe: BayerRecipe) -> Tensor:
    """Return (1, 3, S, S) of developed planes behind the recipe's bank, linear."""
    circumstances, mosaic = developed.circumstances, recipe.wiener.mosaic
    is_near = mosaic is not None and circumstances.height_mm <= mosaic.within_mm
    if is_near and circumstances.red is not None:
        return _filtered_by_runtime(developed, recipe.wiener)
    return wiener_restore(
        developed.planes,
        circumstances.frozen,
        *circumstances.met,
        recipe.wiener,
        developed.unknown,
        height_mm=circumstances.height_mm,
    )


def _filtered_by_runtime(developed: Developed, settings: Wiener) -> Tensor:
    """Filter planes as the runtime does: no gradient goes through the way on the mosaic."""
    circumstances = developed.circumstances
    planes, unknown = developed.planes[0].numpy(), developed.unknown[0].numpy()
    otf = to_runtime_otf(circumstances.frozen[0].numpy(), planes.shape[-1])
    block = Block(
        samples=taper_edges(planes, otf, settings.overlap_px // 4),
        otf=otf,
        unknown=unknown if unknown.any() else None,
        height_mm=circumstances.height_mm,
        red=circumstances.red,
    )
    return torch.from_numpy(wiener_filter(settings, circumstances.met_noise)(block))[None]


def finish_shot(developed: Developed, recipe: BayerRecipe, restored: Tensor | None = None) -> Shot:
    """Filter and stabilise developed planes, as the runtime does.

    Args:
        developed: What was photographed.
        recipe: Camera and sample sizes.
        restored: (1, 3, S, S) of another filter than the recipe's bank, linear.
    """
    planes, circumstances, data = developed.planes, developed.circumstances, recipe.data
    noise = circumstances.noise
    shot, read = torch.tensor(noise.shot), torch.tensor(noise.read_variance)
    restored = filtered(developed, recipe) if restored is None else restored
    stable = [
        stabilise(cut_middle(x, data.sample_px), shot, read, scale=recipe.scale)
        for x in (planes, restored)
    ]
    target = target_of(developed, recipe)
    # Not asked, a network answers at random: lamps came out dark. Such places stay as the bank has
    # them.
    target = torch.where(target == NOT_JUDGED, stable[1], target)
    inputs = {port.name: x[0] for port, x in zip(LAYOUT.inputs, stable, strict=True)}
    if recipe.light is not None:
        inputs[KEPT_PORT.name] = cut_middle(keep_share(developed.unknown), data.sample_px)[0]
    return Shot(
        sample=Sample(
            inputs=inputs,
            target=target[0],
            weight=recipe.scale * shot.sqrt(),
        ),
        noise=noise,
        illumination=circumstances.illumination,
    )


def target_of(developed: Developed, recipe: BayerRecipe) -> Tensor:
    """Return (1, 3, s, s) the target of a sample, stabilised; NOT_JUDGED if unknown."""
    data, circumstances = recipe.data, developed.circumstances
    shot, read = (
        torch.tensor(circumstances.noise.shot),
        torch.tensor(circumstances.noise.read_variance),
    )
    bright = developed.true.clamp(max=data.target_max)
    target = stabilise(bright, shot, read, scale=recipe.scale)
    highlights = _clipped_highlights(
        developed.true, cut_middle(developed.unknown, data.sample_px), circumstances.gains
    )
    return torch.where(highlights, torch.tensor(NOT_JUDGED), target)


def _drifted(kernels: Tensor, size: float, turn: float) -> Tensor:
    """Scale and turn (1, 3, h, w) kernels about their centre; each keeps its light."""
    if (size, turn) == (1.0, 0.0):
        return kernels
    cos, sin = math.cos(turn) / size, math.sin(turn) / size
    matrix = torch.tensor([[[cos, sin, 0.0], [-sin, cos, 0.0]]], dtype=kernels.dtype)
    shape = list(kernels.shape)
    grid = torch.nn.functional.affine_grid(matrix, shape, align_corners=True)
    turned = torch.nn.functional.grid_sample(kernels, grid, align_corners=True)
    return turned / turned.sum((-2, -1), keepdim=True)


def _clipped_highlights(true: Tensor, unknown: Tensor, gains: tuple[float, float, float]) -> Tensor:
    """Mark (1, 1, s, s) highlights that clipped: their light is unknown."""
    if not bool(unknown.any()):
        return unknown
    raw_peak = (true / torch.tensor(gains).reshape(1, 3, 1, 1)).amax(1, keepdim=True)
    side = 2 * CLIPPED_REACH_PX + 1
    near = torch.nn.functional.max_pool2d(unknown.float(), side, 1, CLIPPED_REACH_PX)
    return (near > 0) & (raw_peak > UNKNOWN_ABOVE)


def _blur(sharp: Tensor, kernels: Tensor, radius_px: int) -> Tensor:
    """Blur each pixel with its colour's kernel; keep what the crop fully determines."""
    size = (sharp.shape[-2], sharp.shape[-1])
    spread = torch.fft.irfft2(torch.fft.rfft2(sharp) * to_otf(kernels, size), s=size)
    r = radius_px
    inner: Tensor = spread[..., r : size[0] - r, r : size[1] - r]
    return inner.clamp(min=0)


def _planes(
    capture: FloatArray,
    saturated: NDArray[np.bool_],
    gains: tuple[float, float, float],
    recipe: BayerRecipe,
    borders: Sides,
) -> tuple[Tensor, Tensor]:
    """White-balance and demosaic; return (1, 3, h, w) planes and (1, 1, h, w) clipped pixels.

    Planes are white-balanced alone.

    Where the picture ends, what lies beyond is cut before the demosaic and mirrored afterwards.
    """
    cfa = recipe.sensor.cfa
    top, bottom, left, right = (recipe.data.margin_px if side else 0 for side in borders)
    height, width = capture.shape[-2:]
    inside = np.s_[..., top : height - bottom, left : width - right]
    samples, clipped = np.ascontiguousarray(capture[inside]), saturated[inside]
    if cfa is None:
        planes = torch.from_numpy(samples)[None] * torch.tensor(gains).reshape(1, -1, 1, 1)
        clipped = np.any(clipped, axis=0)
    else:
        planes = developed(samples, gains, cfa)
    unknown = torch.from_numpy(np.ascontiguousarray(clipped))[None, None].float()
    if any(borders):
        outside = (left, right, top, bottom)
        planes = torch.nn.functional.pad(planes, outside, mode="reflect")
        unknown = torch.nn.functional.pad(unknown, outside, mode="reflect")
    return planes, unknown > 0


def cut_middle(planes: Tensor, side_px: int) -> Tensor:
    """Cut the middle square."""
    top, left = ((n - side_px) // 2 for n in planes.shape[-2:])
    return planes[..., top : top + side_px, left : left + side_px]
