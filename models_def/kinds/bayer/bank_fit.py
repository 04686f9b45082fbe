"""The numbers of a Wiener bank that restores colours together, fitted to a camera.

    copies of the lens -> spread of the transfer
    pictures, drawn scenes -> photographed, developed -> descent on what the bank leaves -> numbers

The loss is that of training: squared errors of stabilised planes, a sample's error by its
logarithm, so that dark and bright samples, the axis and the corner, count alike. Samples with
clipped light are left out: there a bank has other work.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import torch
from pydantic import ValidationError
from torch import Tensor

from camkit.bundle.stages import Together
from camkit.bundle.stages.together import Spread
from camkit.caller import option_text
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.kinds.bayer.frames.samples import draw_developed
from camkit.models_def.kinds.bayer.frames.tiles import Frames
from camkit.models_def.kinds.bayer.material import BayerMaterial, trace_material
from camkit.models_def.kinds.bayer.psf_bank import PsfBank
from camkit.models_def.kinds.bayer.recipe import BayerRecipe
from camkit.models_def.kinds.bayer.samples import (
    Developed,
    cut_middle,
    draw_exposure,
    photograph,
    scene_side_px,
    target_of,
    tint_crop,
    told_depth,
)
from camkit.models_def.sensors.stabilise import stabilise
from camkit.models_def.sensors.together import Numbers, line_means, restore_together
from camkit.models_def.sensors.wiener import block_facts, to_otf, wiener_restore
from camkit.models_def.training.bank_fitting import BankFit, BankFitOptions
from camkit.models_def.training.pictures import open_scenes
from camkit.progress import counted

FREQUENCIES: Final = (0.0, 0.015, 0.03, 0.05, 0.075, 0.1, 0.14, 0.18, 0.23, 0.3, 0.4, 0.75)
"""Of the table of the spread, cycles per pixel."""
HEIGHTS: Final = 9
JUDGED_BELOW: Final = 0.3
"""Cycles per pixel: what lies above tells little of a lens."""
GRID_PX: Final = 256
SPREAD_DIGITS: Final = 7
DIGITS: Final = 4
FIRST: Final = Together(
    noise=(1.6, 0.5, 1.6),
    noise_rise=(1.4, 0.7, 1.6),
    scale=2e-3,
    exponent=2.4,
    follow=0.5,
    own=0.13,
    mistrust=3.3,
    spread=Spread(heights_mm=(0.0,), frequencies=(0.0, 1.0), variance=(((0.0, 0.0),) * 3,)),
)
"""Where the descent begins."""
RATE: Final = 0.04
LAST_RATE: Final = 0.002
BATCH: Final = 6
FOLLOW: Final = -4
"""Place of `follow` among the values that the descent moves."""
HELD_OUT: Final = 4
"""Every so many samples one is kept to judge by."""

Tell = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    """A sample as the input of the bank."""

    planes: Tensor
    otf: Tensor
    level: Tensor
    variance: Tensor
    height_mm: float
    target: Tensor
    shot: Tensor
    read: Tensor
    alone: float


def spread_of(bank: PsfBank, recipe: BayerRecipe) -> Spread:
    """Measure how much the transfer of the copies to train on scatters around the frozen one.

    Where the bank estimates the depth, the frozen one is that of depths a standard deviation of
    the estimate nearer and farther than the copy's.
    """
    errors = (-recipe.data.depth_error, recipe.data.depth_error)
    count = len(bank.copy_heights_mm)
    indices = np.unique(np.linspace(0, count - 1, min(HEIGHTS, count)).round().astype(int))
    variance = []
    for index in indices:
        height = float(bank.copy_heights_mm[index])
        gaps = [
            (
                _transfer(bank, height, copy) - _frozen_transfer(bank, height, recipe, copy, error)
            ).abs()
            for copy in range(bank.training_copies)
            for error in (errors if recipe.estimates_depth else (0.0,))
        ]
        mean = torch.stack(gaps).square().mean(dim=0)[0].numpy().astype(np.float64)
        lines = line_means(mean, FREQUENCIES).round(SPREAD_DIGITS)
        variance.append(tuple(tuple(line) for line in lines.tolist()))
    return Spread(
        heights_mm=tuple(float(h) for h in bank.copy_heights_mm[indices]),
        frequencies=FREQUENCIES,
        variance=tuple(variance),
    )


def _transfer(bank: PsfBank, height_mm: float, copy: int) -> Tensor:
    return to_otf(bank.blur_kernels(copy, 0.0, height_mm), (GRID_PX, GRID_PX))


def _frozen_transfer(
    bank: PsfBank, height_mm: float, recipe: BayerRecipe, copy: int, error: float = 0.0
) -> Tensor:
    """Return the transfer that a bank takes a copy's for; `error` is of the nearness, in 1/m."""
    depth = told_depth(recipe, copy, error) if recipe.estimates_depth else None
    return to_otf(bank.frozen_kernels(0.0, height_mm, depth), (GRID_PX, GRID_PX))


def transfer_errors(bank: PsfBank, recipe: BayerRecipe) -> tuple[float, ...]:
    """Return the error of every copy's transfer against the frozen one, training copies first.

    Root of the mean |H_copy - H|^2 over that of |H_copy|^2, below 0.3 cycles per pixel, over all
    fields and colours (and depths of a copy); tools/comparison/copies.py has it of frozen PSFs.
    """
    places = np.hypot(np.fft.fftfreq(GRID_PX)[:, None], np.fft.rfftfreq(GRID_PX)[None])
    inside = torch.from_numpy(places < JUDGED_BELOW)
    squares, powers = np.zeros(len(bank.copies)), np.zeros(len(bank.copies))
    for height in bank.copy_heights_mm.tolist():
        for copy in range(len(bank.copies)):
            frozen = _frozen_transfer(bank, height, recipe, copy)[..., inside]
            transfer = _transfer(bank, height, copy)[..., inside]
            squares[copy] += float((transfer - frozen).abs().square().sum())
            powers[copy] += float(transfer.abs().square().sum())
    wrong, whole = (sums.reshape(-1, bank.depths).sum(axis=1) for sums in (squares, powers))
    return tuple(float(error) for error in np.sqrt(wrong / whole))


def fit_bank(
    recipe: BayerRecipe, material: BayerMaterial, options: BankFitOptions, tell: Tell
) -> BankFit:
    """Fit the numbers of a camera.

    Args:
        recipe: The camera and its samples; what its bank says of colours together is not used.
        material: Its kernels, and the frames of a lens with a haze.
        options: How it is fitted; folders of kernels are not used.
        tell: Takes a line now and then.

    Raises:
        ContractError: If there are too few samples, or the descent leaves the numbers' ranges.
    """
    samples, steps, seed = options.samples, options.steps, options.seed
    alone, bank = recipe.with_together(None), material.bank
    if material.frames is None:
        shots = _photographed(alone, bank, options.pictures, samples, seed)
    else:
        shots = _cut(alone, material.frames, options.pictures, samples, seed)
    cases = [_case(shot, alone) for shot in shots if not bool(shot.unknown.any())]
    if len(cases) < 2 * HELD_OUT:
        raise ContractError(
            f"{len(cases)} of {samples} samples are without clipped light, too few to fit a bank "
            f"to; raise {option_text('samples')}"
        )
    tell(f"{len(cases)} samples, {samples - len(cases)} left out for clipped light")
    errors = transfer_errors(bank, recipe)
    training_errors, validation_errors = (
        errors[: -bank.validation_copies],
        errors[-bank.validation_copies :],
    )
    tell(
        f"transfer of copies off by {_errors_text(training_errors)}; "
        f"of those to choose by {_errors_text(validation_errors)}"
    )
    first = FIRST.model_copy(update={"spread": spread_of(bank, recipe)})
    held_out, training_cases = cases[::HELD_OUT], [c for i, c in enumerate(cases) if i % HELD_OUT]
    values = _to_values(first).requires_grad_()
    optimiser = torch.optim.Adam([values], lr=RATE, betas=(0.9, 0.99))
    rng = np.random.default_rng(seed)
    for step in counted(range(steps), "descending", "steps"):
        for group in optimiser.param_groups:
            group["lr"] = LAST_RATE + (RATE - LAST_RATE) * (1 - step / steps)
        optimiser.zero_grad()
        losses = [
            torch.log(_error(training_cases[i], first, _to_numbers(values), alone))
            for i in rng.integers(len(training_cases), size=BATCH)
        ]
        torch.stack(losses).mean().backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        with torch.no_grad():  # at an end of its range it may turn back
            values[FOLLOW].clamp_(0, 1)
        if (step + 1) % max(steps // 5, 1) == 0:
            tell(f"step {step + 1}: {_gain_db(held_out, first, values, alone):.2f} dB over alone")
    together = _rounded(first, values.detach())
    return BankFit(
        together=together,
        gain_db=_gain_db(held_out, together, _to_values(together), alone),
        samples=len(cases),
        steps=steps,
    )


def _errors_text(errors: Sequence[float]) -> str:
    return ", ".join(f"{error:.2f}" for error in errors)


def _photographed(
    recipe: BayerRecipe, bank: PsfBank, pictures: Path | None, count: int, seed: int
) -> Sequence[Developed]:
    source = open_scenes(recipe.data, pictures)
    shots = []
    for index in counted(range(count), "photographing", "samples"):
        rng = np.random.default_rng((seed, index))
        exposure = draw_exposure(rng, recipe, bank)
        crop = tint_crop(rng, source.draw_crop(rng, scene_side_px(recipe, bank)))
        shots.append(photograph(crop, exposure, recipe, bank, rng))
    return shots


def _cut(
    recipe: BayerRecipe, frames: Frames, pictures: Path | None, count: int, seed: int
) -> Sequence[Developed]:
    tiles = frames.tiles("train", pictures)
    rng = np.random.default_rng(seed)
    indices = rng.permutation(len(tiles))[:count]
    return [draw_developed(rng, tiles.read(int(i)), recipe, frames.bank) for i in indices]


def _case(developed: Developed, recipe: BayerRecipe) -> _Case:
    circumstances = developed.circumstances
    shot, read = (
        torch.tensor(circumstances.noise.shot),
        torch.tensor(circumstances.noise.read_variance),
    )
    facts = block_facts(developed.planes, circumstances.frozen, *circumstances.met, recipe.wiener)
    target = target_of(developed, recipe)
    plain = wiener_restore(
        developed.planes, circumstances.frozen, *circumstances.met, recipe.wiener
    )
    return _Case(
        planes=facts.planes,
        otf=facts.otf,
        level=facts.level,
        variance=facts.variance,
        height_mm=circumstances.height_mm,
        target=target,
        shot=shot,
        read=read,
        alone=float(_squares(plain, target, (shot, read), recipe)),
    )


def _error(case: _Case, together: Together, numbers: Numbers, recipe: BayerRecipe) -> Tensor:
    restored = restore_together(
        case.planes, case.otf, case.level, case.variance, case.height_mm, together, numbers
    )
    return _squares(restored, case.target, (case.shot, case.read), recipe)


def _squares(
    restored: Tensor, target: Tensor, noise: tuple[Tensor, Tensor], recipe: BayerRecipe
) -> Tensor:
    """Return the mean squared error of stabilised planes."""
    stable = stabilise(cut_middle(restored, recipe.data.sample_px), *noise, scale=recipe.scale)
    weight = recipe.scale * noise[0].sqrt()[:, None, None]
    return ((stable - target) * weight).square().mean()


def _gain_db(
    cases: Sequence[_Case], together: Together, values: Tensor, recipe: BayerRecipe
) -> float:
    with torch.no_grad():
        numbers = _to_numbers(values)
        gains = [
            10 * np.log10(case.alone / float(_error(case, together, numbers, recipe)))
            for case in cases
        ]
    return float(np.mean(gains))


def _to_values(together: Together) -> Tensor:
    """Return the numbers as the descent moves them: those > 0 by their logarithm."""
    logs = np.log([together.scale, max(together.own, 1e-6), max(together.mistrust, 1e-6)])
    return torch.tensor(
        [*together.noise, *together.noise_rise, together.exponent, together.follow, *logs],
        dtype=torch.float32,
    )


def _to_numbers(values: Tensor) -> Numbers:
    colours = (len(values) - 5) // 2
    exponent, follow, scale, own_power, mistrust = values[2 * colours :]
    return Numbers(
        noise=values[:colours],
        noise_rise=values[colours : 2 * colours],
        scale=scale.exp(),
        exponent=exponent,
        follow=follow.clamp(0, 1),
        own=own_power.exp(),
        mistrust=mistrust.exp(),
    )


def _rounded(first: Together, values: Tensor) -> Together:
    """Return the numbers as a recipe states them.

    Raises:
        ContractError: If one is not what it may be.
    """
    numbers = _to_numbers(values)

    def short(value: Tensor) -> float:
        return float(f"{float(value):.{DIGITS}g}")

    try:
        return Together(
            noise=tuple(short(v) for v in numbers.noise),
            noise_rise=tuple(short(v) for v in numbers.noise_rise),
            scale=short(numbers.scale),
            exponent=short(numbers.exponent),
            follow=short(numbers.follow),
            own=short(numbers.own),
            mistrust=short(numbers.mistrust),
            spread=first.spread,
        )
    except ValidationError as error:
        raise ContractError(
            f"the descent did not find numbers for the bank; raise {option_text('samples')}"
        ) from error


def _check_folder(prescription: str, options: BankFitOptions) -> None:
    """Refuse a folder in which a relative path of the recipe to its lens would break."""
    recipe_folder, output_folder = options.recipe_folder.resolve(), options.output_folder
    if (
        output_folder is None
        or output_folder.resolve() == recipe_folder
        or Path(prescription).is_absolute()
    ):
        return
    if (recipe_folder / prescription).is_file():
        raise ContractError(
            f"the recipe names its lens {prescription} relative to itself; write to {recipe_folder}"
        )


class BayerBankFitting:
    """Fulfils `camkit.models_def.training.bank_fitting.BankFittingKind`."""

    def fit(self, recipe: BayerRecipe, options: BankFitOptions, tell: Tell) -> BankFit:
        """Trace the lens, or read what was traced before, and fit."""
        _check_folder(recipe.lens.prescription or recipe.lens.psf, options)
        material = trace_material(recipe, options.recipe_folder, options.cache_folder)
        if material.bank.grid_x_mm is not None:
            raise UnsupportedError(
                "the numbers of a bank run over the field height; kernels on a grid have none: "
                "leave wiener.together out"
            )
        return fit_bank(recipe, material, options, tell)


BANK_FITTING: Final = BayerBankFitting()
