import numpy as np
import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.kinds.bayer.material import BayerMaterial
from camkit.models_def.training.pool import MAX_WORKERS, open_pool
from camkit.models_def.training.recipe import AHEAD
from tests.gaussian_bank import gaussian_bank


def draw(pool, step):
    return pool.draw_batch(step, 2, 32)


def test_a_step_draws_the_same_patches_whatever_came_before(tmp_path, recipe_path, material):
    with open_pool(tmp_path / "a", recipe_path, material, None, seed=1) as pool:
        for step in range(0, 60, 10):
            last = draw(pool, step)
    with open_pool(tmp_path / "b", recipe_path, material, None, seed=1) as pool:
        fresh = draw(pool, 50)
    assert torch.equal(last.planes, fresh.planes)
    assert torch.equal(last.target, fresh.target)
    assert torch.equal(last.weight, fresh.weight)


def test_a_run_that_goes_back_sees_what_it_saw_before(tmp_path, recipe_path, material):
    """After a crash the pool may have run ahead of the checkpoint."""
    with open_pool(tmp_path, recipe_path, material, None, seed=1) as pool:
        early = draw(pool, 0)
        draw(pool, 160)
        again = draw(pool, 0)
    assert torch.equal(early.planes, again.planes)


def test_an_existing_pool_is_used_again(tmp_path, recipe_path, material):
    with open_pool(tmp_path, recipe_path, material, None, seed=1) as pool:
        draw(pool, 0)
    with open_pool(tmp_path, recipe_path, material, None, seed=1) as pool:
        pool._make_missing = lambda: pytest.fail("a sample was made twice")
        draw(pool, 0)
    assert len(list(tmp_path.glob("pool-*"))) == 1


def test_other_kernels_get_a_pool_of_their_own(tmp_path, recipe_path, material, recipe):
    other = gaussian_bank(sensor_height_mm=2.0, axis_px=0.9, corner_px=1.7)
    open_pool(tmp_path, recipe_path, material, None, seed=1)
    open_pool(tmp_path, recipe_path, BayerMaterial(bank=other), None, seed=1)
    assert len(list(tmp_path.glob("pool-*"))) == 2


def test_a_worker_makes_the_same_samples(tmp_path, recipe_path, material):
    with open_pool(tmp_path / "own", recipe_path, material, None, seed=1) as pool:
        own = draw(pool, 0)
    with open_pool(tmp_path / "worker", recipe_path, material, None, seed=1) as pool:
        pool.start_workers(1)
        made = draw(pool, 0)
        assert pool.workers_cpu_s() > 0
    assert torch.equal(own.planes, made.planes)


def test_a_dead_worker_is_noticed(tmp_path, recipe_path, material):
    with open_pool(tmp_path, recipe_path, material, None, seed=1) as pool:
        pool.start_workers(1)
        pool._workers[0].terminate()
        pool._workers[0].wait()
        with pytest.raises(ContractError, match="worker has ended"):
            draw(pool, 0)


def test_too_many_workers_are_refused(tmp_path, recipe_path, material):
    with (
        open_pool(tmp_path, recipe_path, material, None, seed=1) as pool,
        pytest.raises(ContractError, match="workers must be"),
    ):
        pool.start_workers(MAX_WORKERS + 1)


def test_the_span_grows_with_the_steps_and_never_outruns_the_slots(
    tmp_path, recipe_path, material, recipe
):
    pool = open_pool(tmp_path, recipe_path, material, None, seed=1)
    spans = [pool.span(step) for step in range(0, 800, 50)]
    assert all(np.diff([end for _, end in spans]) > 0)
    assert all(end + AHEAD - low <= recipe.data.pool_samples for low, end in spans)
    assert all(low < end for low, end in spans)
