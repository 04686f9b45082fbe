"""A bank of colours restored together is fitted to a camera, and its recipe says so."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from camkit.bundle.stages import Together
from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.kinds.bayer import bank_fit
from camkit.models_def.kinds.bayer.bank_fit import FIRST, fit_bank, spread_of, transfer_errors
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.kinds.bayer.samples import draw_exposure, photograph, scene_side_px
from camkit.models_def.sensors.wiener import to_otf, wiener_restore
from camkit.models_def.training.bank_fitting import (
    BankFitOptions,
    bank_fitting_kind,
    with_bank,
)
from camkit.models_def.training.kind import read_recipe
from camkit.runtime.bank.psf import FieldKernels
from tests.together_factory import TOGETHER
from tools.comparison.copies import relative_error, transfers


@pytest.fixture
def coloured(bank):
    """The camera's bank, its red blurred three times as far."""
    wide = np.zeros_like(bank.copies)
    side = bank.copies.shape[-1]
    y, x = np.mgrid[:side, :side] - side // 2
    for copy, field in np.ndindex(bank.copies.shape[:2]):
        for colour, sigma in enumerate((2.6, 1.6, 0.6)):
            of = np.exp(-(x**2 + y**2) / (2 * (sigma * (1 + 0.1 * copy)) ** 2))
            wide[copy, field, colour] = of / of.sum()
    frozen = np.stack([wide[0, 0]] * len(bank.frozen))
    return replace(bank, copies=wide, frozen=frozen)


def options(tmp_path, **changed):
    given = {"pictures": None, "recipe_folder": tmp_path, "cache_folder": tmp_path}
    return BankFitOptions(**(given | {"samples": 24, "steps": 40} | changed))


def test_a_fitted_bank_beats_the_one_of_each_colour_alone(recipe, coloured, tmp_path):
    told = []
    found = fit_bank(recipe, BayerMaterial(bank=coloured), options(tmp_path), told.append)
    assert found.gain_db > 0.5
    assert found.samples <= 24
    assert "step 40" in told[-1]
    # and the camera's own filter does, on a sample that was not fitted to
    fitted = recipe.with_together(found.together)
    rng = np.random.default_rng(99)
    exposure = replace(
        draw_exposure(rng, recipe, coloured), iso=100.0, factor=0.5, borders=(False,) * 4
    )
    side = scene_side_px(recipe, coloured)
    y, x = np.mgrid[:side, :side]
    grey = 0.3 + 0.2 * np.sign(np.sin(x / 5) * np.cos(y / 7))
    crop = (grey * np.array([0.9, 1.0, 0.8])[:, None, None]).astype(np.float32)
    shot = photograph(crop, exposure, recipe, coloured, rng)
    given = shot.circumstances
    noise = [shot.planes.new_tensor(v) for v in (given.noise.shot, given.noise.read_variance)]
    margin = recipe.data.margin_px
    errors = [
        wiener_restore(shot.planes, given.frozen, *noise, of.wiener, height_mm=given.height_mm)[
            ..., margin:-margin, margin:-margin
        ]
        .sub(shot.true)
        .square()
        .mean()
        for of in (recipe, fitted)
    ]
    assert errors[1] < 0.8 * errors[0]


def test_the_error_of_a_copy_is_that_by_which_methods_are_compared(recipe, coloured):
    """One definition for training (torch, many heights) and comparisons (numpy, frozen PSFs)."""
    heights_mm = coloured.copy_heights_mm.tolist()
    frozen = _transfers(coloured.frozen_kernels(0.0, height) for height in heights_mm)
    wanted = [
        relative_error(
            frozen, _transfers(coloured.blur_kernels(copy, 0.0, height) for height in heights_mm)
        )
        for copy in range(len(coloured.copies))
    ]
    assert transfer_errors(coloured, recipe) == pytest.approx(wanted, rel=1e-4)
    assert max(wanted) > 2 * min(wanted)


def _transfers(kernels):
    alone = {"field_heights_mm": np.zeros(1), "symmetry": "uniform"}
    return np.stack([transfers(FieldKernels(kernels=of.numpy(), **alone)) for of in kernels])


def test_the_spread_is_that_of_the_copies(recipe, coloured):
    spread = spread_of(coloured, recipe)
    size = (256, 256)
    frozen = to_otf(coloured.frozen_kernels(0.0, 0.0), size)
    gaps = [
        (to_otf(coloured.blur_kernels(copy, 0.0, 0.0), size) - frozen).abs().square()
        for copy in range(coloured.training_copies)
    ]
    mean = sum(gaps)[0] / len(gaps)
    index = spread.frequencies.index(0.1)
    around = float(mean[0, 0, round(0.1 * 256)])
    assert spread.variance[0][0][index] == pytest.approx(around, rel=0.35)
    assert all(line[0] == 0 for of_height in spread.variance for line in of_height)


def test_errors_of_copies_are_those_of_their_transfer(recipe, bank):
    errors = transfer_errors(bank, recipe)
    assert len(errors) == len(bank.copies)
    # copies 4 % wider and 3 % narrower than the frozen one
    assert errors[0] > errors[1] > 0
    same = replace(bank, copies=np.stack([bank.frozen] * 2))
    assert max(transfer_errors(same, recipe)) < 1e-6


def test_a_bank_that_finds_the_distance_is_off_by_its_own_copies_alone(recipe, bank):
    """Copies that are the frozen lens at each of two depths: all that is left is the estimate's."""
    apart = np.stack([bank.frozen, np.roll(bank.frozen, 1, axis=-1)])
    deep = replace(
        bank,
        copies=np.concatenate([apart] * 2),
        depths=2,
        frozen_depths=apart,
        frozen=apart.mean(0),
    )
    lens = replace(recipe.lens, depths_mm=(500.0, 1000.0))
    wiener = recipe.wiener.model_copy(update={"depth": "estimated"})
    sure = replace(recipe, lens=lens, wiener=wiener)
    assert max(transfer_errors(deep, sure)) < 1e-6 < min(transfer_errors(deep, recipe))
    unsure = replace(sure, data=replace(sure.data, depth_error=0.2))
    spreads = [np.array(spread_of(deep, of).variance) for of in (sure, unsure, recipe)]
    assert spreads[0].max() == 0
    assert 0 < spreads[1].max() < spreads[2].max()


def test_too_few_samples_are_refused(recipe, bank, tmp_path):
    with pytest.raises(ContractError, match="too few to fit a bank to; raise samples"):
        fit_bank(recipe, BayerMaterial(bank=bank), options(tmp_path, samples=3), print)
    with pytest.raises(ContractError, match="samples and steps must be >= 1"):
        options(tmp_path, steps=0)


def test_a_recipe_says_its_bank_and_nothing_else_changes(recipe_path):
    text = recipe_path.read_text(encoding="utf-8")
    once = with_bank(text, TOGETHER)
    found = tomllib.loads(once)
    assert Together.model_validate(found["wiener"].pop("together")) == TOGETHER
    assert found == tomllib.loads(text)
    other = TOGETHER.model_copy(update={"own": 0.2})
    twice = with_bank(once, other)
    assert Together.model_validate(tomllib.loads(twice)["wiener"]["together"]) == other
    assert with_bank(twice, TOGETHER) == once


def test_a_recipe_with_a_bank_is_read_and_photographs_with_it(recipe_path, tmp_path, bank):
    path = tmp_path / "with.toml"
    path.write_text(with_bank(recipe_path.read_text(encoding="utf-8"), TOGETHER), encoding="utf-8")
    found = read_recipe(path)
    assert found.wiener.together == TOGETHER


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name = 'x'\n", "no table"),
        ("[wiener]\nprior_scale = 1.0\ntogether = { own = 1.0 }\n", "in a way of its own"),
    ],
)
def test_texts_that_cannot_take_a_bank_are_refused(text, told):
    with pytest.raises(ContractError, match=told):
        with_bank(text, TOGETHER)


def test_kinds_without_a_bank_say_so():
    with pytest.raises(UnsupportedError, match="'spad' have no bank"):
        bank_fitting_kind("spad")
    assert hasattr(bank_fitting_kind("bayer"), "fit")


@pytest.mark.parametrize("exponent", [float("nan"), -1.0, 9.0])
def test_a_descent_that_leaves_the_range_of_a_number_ends_in_one_line(exponent: float) -> None:
    values = bank_fit._to_values(FIRST)
    assert bank_fit._rounded(FIRST, values).exponent == FIRST.exponent
    values[6] = exponent
    with pytest.raises(ContractError, match="raise samples"):
        bank_fit._rounded(FIRST, values)
