"""Arrays of single photons in reports and runtime (numpy) and at training time (torch)."""

import math

import numpy as np
import pytest
import torch

from camkit.arrays import FloatArray
from camkit.models_def.kinds.spad import sampling as trained
from camkit.models_def.kinds.spad.counting import Exposure
from camkit.models_def.kinds.spad.evaluation import bicubic as trained_bicubic
from camkit.models_def.kinds.spad.evaluation import evaluate_each
from camkit.models_def.networks.bicubic import PHASE, SCALE, Bicubic
from camkit.models_def.training.losses import ssim as trained_ssim
from camkit.report.kinds.spad.bicubic import bicubic
from camkit.report.kinds.spad.pictures import SEED, count_picture, picture_rows
from camkit.report.kinds.spad.scenes import coded_luminance
from camkit.report.kinds.spad.score import psnr_db, ssim
from camkit.report.kinds.spad.ways import Method, Way
from camkit.runtime.kinds.spad.finer.linear import Grid
from camkit.scenes import procedural_scene
from tests.spad_bundle import leaning_kernel

FLOAT32 = 1e-6
SIMILARITY = 1e-4
PSNR_DB = 1e-3
NOISE_DB = 0.05
"""A rounding of the light may draw other photons from there on."""
GRID = Grid(scale=SCALE, phase=PHASE)
SCENES = tuple(procedural_scene(seed, 96, 128) for seed in (3, 4))
PICTURES = tuple(coded_luminance(scene) for scene in SCENES)


def _sampling(mode: str) -> trained.Sampling:
    return trained.make_sampling(mode, kernel=leaning_kernel() if mode == "learned" else None)


def _way(mode: str) -> Way:
    sampling = _sampling(mode)
    method = Method(name="bicubic", restore=lambda planes, _: bicubic(planes[0], GRID))
    return Way(sampling=mode, kernel=sampling.kernel, light=sampling.light, methods=(method,))


def _noisy(picture: FloatArray) -> FloatArray:
    noise = np.random.default_rng(1).normal(0, 0.05, picture.shape)
    return np.clip(picture + noise, 0, 1).astype(np.float32)


@pytest.mark.parametrize("phase", range(SCALE))
def test_bicubic_interpolation_is_that_of_training(phase: int) -> None:
    light = np.random.default_rng(2).random((9, 14), dtype=np.float32)
    found = bicubic(light, Grid(scale=SCALE, phase=phase))
    wanted = Bicubic(SCALE, phase)(torch.from_numpy(light)[None, None])[0, 0].numpy()
    assert found == pytest.approx(wanted, abs=FLOAT32)


def test_scores_are_those_of_training() -> None:
    picture = PICTURES[0]
    noisy = _noisy(picture)
    pair = (torch.from_numpy(noisy)[None, None], torch.from_numpy(picture)[None, None])
    assert ssim(noisy, picture) == pytest.approx(float(trained_ssim(*pair)), abs=SIMILARITY)
    mse = float(((noisy.astype(np.float64) - picture) ** 2).mean())
    assert psnr_db(noisy, picture) == pytest.approx(-10 * math.log10(mse))
    assert psnr_db(picture, picture) == 100


@pytest.mark.parametrize("mode", trained.MODES)
def test_what_an_array_counts_is_what_training_counted(mode: str) -> None:
    """The same photons of the same seed, as the light is the same but for its rounding."""
    from camkit.models_def.kinds.spad.samples import photograph

    fine = torch.from_numpy(PICTURES[0])[None, None]
    rng = np.random.default_rng((SEED, 0))
    wanted = photograph(fine, _sampling(mode), Exposure(photons=300.0), rng)[0].numpy()
    found = count_picture(PICTURES[0], _way(mode), GRID, 300.0, (SEED, 0)).planes
    assert np.mean(np.abs(found - wanted) < FLOAT32) > 0.99


@pytest.mark.parametrize("mode", trained.MODES)
@pytest.mark.parametrize(("photons", "within_db"), [(None, PSNR_DB), (1000.0, NOISE_DB)])
def test_rows_of_the_bench_are_those_of_the_tables(
    mode: str, photons: float | None, within_db: float
) -> None:
    sampling = _sampling(mode)
    exposure = Exposure(photons=math.inf if photons is None else photons)
    each = evaluate_each(PICTURES, sampling, exposure, trained_bicubic(sampling))
    row, *_ = picture_rows(PICTURES, (_way(mode),), GRID, (photons,), lambda _: None)
    wanted_db, alike = np.mean(each, axis=0)
    assert row["psnr_db"] == pytest.approx(wanted_db, abs=within_db)
    assert row["ssim"] == pytest.approx(alike, abs=SIMILARITY if photons is None else 2e-3)
