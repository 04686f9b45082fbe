"""A camera that no file of camkit knows is frozen and trained by the same commands as any other."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
import torch

from camkit.bundle.psf_file import read_psf
from camkit.cli.app import run
from camkit.errors import ContractError, UnsupportedError
from camkit.kinds import find_kind
from camkit.models_def.training.checkpoint import load_network, read_checkpoint, recipe_of
from camkit.models_def.training.kind import read_recipe, training_kind
from camkit.models_def.training.log import plot_logs, read_log
from camkit.models_def.training.pool import open_pool
from camkit.models_def.training.refinement import refining_kind
from camkit.models_def.training.trainer import TrainOptions, train
from tests.installed_package import ROOT
from tests.toy_camera.install import toy_installed  # noqa: F401
from tests.toy_camera.models_def import PART
from tests.toy_camera.recipe import ROLES, STREAKS, TURN_DEG, write_toy

pytestmark = pytest.mark.usefixtures("toy_installed")


def camkit(*arguments):
    """Run a command as a user does, in a process of its own."""
    command = [sys.executable, "-m", "camkit", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=ROOT)


@pytest.fixture(scope="module")
def recipe_path(tmp_path_factory, toy_installed):  # noqa: F811
    """The recipe, with the PSF frozen by the command."""
    folder = tmp_path_factory.mktemp("toy")
    path = write_toy(folder)
    done = camkit(
        *("freeze", folder / STREAKS, "-o", folder / "psf.safetensors", "--recipe", path),
        *("--report", folder / "freeze.json", "--limit-db", "2", "--max-side-px", "21"),
    )
    assert done.returncode == 0, done.stderr
    return path


def light_of(kernel):
    """Give how much light lies on either side of the centre, along the streak and against it."""
    side = kernel.shape[-1] // 2
    y, x = np.mgrid[-side : side + 1, -side : side + 1]
    along = x * np.cos(np.deg2rad(TURN_DEG)) + y * np.sin(np.deg2rad(TURN_DEG))
    return kernel[along > 1.5].sum(), kernel[along < -1.5].sum()


def test_its_streaks_stay_on_their_side_through_freezing(recipe_path):
    psf = read_psf(recipe_path.parent / "psf.safetensors")
    assert psf.symmetry == "grid"
    for field in psf.kernels[:, 0, 0]:
        along, against = light_of(field)
        assert along > 10 * against
    report = json.loads((recipe_path.parent / "freeze.json").read_text())
    assert report["fields"] == 4
    assert report["loss_db"] <= 0.2


def test_its_kind_is_found_like_any_other(recipe_path):
    assert find_kind("toy").home == "tests.toy_camera"
    assert training_kind("toy") is PART
    assert read_recipe(recipe_path).network("S", "upscale").network == "upscaler"
    with pytest.raises(UnsupportedError, match="not fine-tuned"):
        refining_kind("toy")


@pytest.mark.parametrize("role", ROLES)
def test_each_of_its_networks_learns(role, recipe_path, tmp_path):
    result = train(recipe_path, TrainOptions(out_dir=tmp_path, size="S", role=role))
    assert result.checkpoint.name == f"toy_{role}_S.pt"
    losses = [entry["loss"] for entry in read_log(result.log) if "loss" in entry]
    assert result.valid_db > result.baselines["input"] + 0.5
    saved = read_checkpoint(result.checkpoint)
    assert (saved.role, saved.designed) == (role, {})
    assert recipe_of(saved).kind == "toy"
    shape = load_network(saved)(torch.rand(1, 1, 16, 24)).shape
    assert shape == ((1, 1, 16, 24) if role == "denoise" else (1, 1, 32, 48))
    plot_logs({role: result.log}, tmp_path / "chart.png")
    assert losses


@pytest.mark.slow
@pytest.mark.parametrize("role", ROLES)
def test_in_a_minute_its_loss_falls_and_falls(role, recipe_path, tmp_path):
    options = TrainOptions(
        out_dir=tmp_path, size="S", role=role, steps=100_000, max_minutes=1.0, validate_s=15.0
    )
    result = train(recipe_path, options)
    losses = [entry["loss"] for entry in read_log(result.log) if "loss" in entry]
    fifth = len(losses) // 5
    # a fast machine is through most of the fall within the first fifth of the minute
    assert np.mean(losses[-fifth:]) < np.mean(losses[:5]) - 0.1
    assert np.mean(losses[-fifth:]) < np.mean(losses[:fifth]) - 0.02
    assert result.valid_db > result.baselines["input"] + 1.0


def test_a_role_must_be_named_where_there_are_several(recipe_path, tmp_path, capsys):
    words = ["train", str(recipe_path)]
    assert run([*words, "--size", "S", "--out-dir", str(tmp_path)]) == 2
    assert "roles denoise, upscale; choose one" in capsys.readouterr().err
    assert run([*words, "--role", "upscale", "--fine-tune", "x.pt"]) != 0
    assert "'toy' are not fine-tuned" in capsys.readouterr().err


def test_targets_are_twice_as_large_and_never_turned(recipe_path, tmp_path):
    material = PART.prepare(read_recipe(recipe_path), recipe_path.parent, tmp_path)
    pool = open_pool(tmp_path, recipe_path, material, None, seed=1, role="upscale")
    with pool:
        pool.start_workers(1)
        batch = pool.draw_batch(0, 3, 32)
    assert list(batch.inputs) == ["planes"]
    assert batch.planes.shape == (3, 1, 32, 32)
    assert batch.target.shape == (3, 1, 64, 64)
    assert batch.weight.shape == (3, 1)
    coarse = torch.nn.functional.avg_pool2d(batch.target, 2)
    # blurred along the streak, a patch still lies where its target lies
    for found, sharp in zip(batch.planes[:, 0], coarse[:, 0], strict=True):
        apart = [float((found - torch.roll(sharp, n, 1)).square().mean()) for n in (-8, 2, 8)]
        assert apart[1] < min(apart[0], apart[2])


def test_a_network_that_does_not_fit_its_role_is_refused(recipe_path, tmp_path):
    swapped = recipe_path.read_text().replace('"denoiser"', '"upscaler"', 1)
    path = recipe_path.with_name("swapped.toml")
    path.write_text(swapped)
    with pytest.raises(ContractError, match=r"upscaler must make \(1, 1, 8, 8\)"):
        train(path, TrainOptions(out_dir=tmp_path, size="S", role="denoise"))
    path.write_text(swapped.replace('"upscaler"', '"nobody"', 1))
    with pytest.raises(ContractError, match="must be one of denoiser, upscaler"):
        train(path, TrainOptions(out_dir=tmp_path, size="S", role="denoise"))


def test_no_file_of_camkit_knows_it():
    found = [
        path
        for folder in ("camkit", "runtime", "export", "models_def")
        for path in (ROOT / folder).rglob("*.py")
        if not path.is_symlink() and "toy" in path.read_text(encoding="utf-8").lower()
    ]
    assert found == []
    assert os.environ["PYTHONPATH"]
