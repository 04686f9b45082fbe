"""The kind as training sees it: plate, then network behind the frozen plate, by `train`."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.errors import ContractError, UnsupportedError
from camkit.models_def.kinds.spad import validation
from camkit.models_def.kinds.spad.networks import JointCamera
from camkit.models_def.kinds.spad.plate_psf import read_plate_psf
from camkit.models_def.kinds.spad.recipe import SamplingRecipe, SpadRecipe
from camkit.models_def.kinds.spad.sampling import gaussian_psf, make_sampling
from camkit.models_def.kinds.spad.training import PART
from camkit.models_def.kinds.spad.validation import SpadJudge, make_judge
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.kind import training_kind
from camkit.models_def.training.trainer import TrainOptions, train


@pytest.fixture(autouse=True)
def few_crops(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(validation, "CROPS", 2)
    monkeypatch.setattr(validation, "CROP_PX", 64)


@pytest.fixture
def judge(tiny: SpadRecipe) -> SpadJudge:
    return make_judge(tiny, "upscale", make_sampling("gaussian"), None)


def test_the_kind_is_found_by_its_name() -> None:
    assert training_kind("spad") is PART


def test_a_bundle_makes_pictures_and_depth_where_there_are_time_bins(tiny: SpadRecipe) -> None:
    counting = PART.design(tiny)
    assert [stage.type for stage in counting.stages] == ["correct", "super_resolve"]
    assert counting.products == {"image": "fine"}
    timed = replace(
        tiny, sensor=tiny.sensor.model_copy(update={"time_bins": 16, "time_bin_ps": 20.0})
    )
    design = PART.design(timed)
    assert [stage.type for stage in design.stages] == ["correct", "super_resolve", "sharpen"]
    assert design.products == {"image": "fine", "depth_m": "depth"}
    blind = replace(tiny, data=replace(tiny.data, told=False))
    with pytest.raises(UnsupportedError, match=r"train them with data\.told"):
        PART.design(blind)
    assert set(PART.camera_parts) >= {"sensor", "sampling"}
    assert PART.roles == ("upscale",)


def test_material_of_another_process_is_the_same(tiny: SpadRecipe, tmp_path: Path) -> None:
    made = PART.prepare(tiny, tmp_path, tmp_path)
    np.testing.assert_array_equal(made.kernel, gaussian_psf())
    made.write(tmp_path)
    assert PART.read_material(tmp_path).digest() == made.digest()
    narrow = replace(tiny, sampling=SamplingRecipe(mode="gaussian", sigma=1.0))
    assert PART.prepare(narrow, tmp_path, tmp_path).digest() != made.digest()
    one, other = (
        PART.maker(tiny, "upscale", m, None, 1).make(0)
        for m in (made, PART.read_material(tmp_path))
    )
    assert torch.equal(one.inputs["light"], other.inputs["light"])


def test_levels_of_light_are_told_apart_and_the_truth_is_perfect(judge: SpadJudge) -> None:
    shots = iter(judge.shots)
    assert judge.score(lambda _: next(shots).fine).mean_db == validation.psnr_db(
        torch.zeros(1), torch.zeros(1)
    )
    assert set(judge.baselines()) == {"bicubic"}
    finer = validation.bicubic(judge.sampling)
    found = judge.score(finer)
    assert found.mean_db == judge.baselines()["bicubic"]
    by_photons = found.parts["by_photons"]
    assert list(by_photons) == ["100", "1000", "10000"]
    assert by_photons["100"] < by_photons["1000"] < by_photons["10000"]


def test_a_plate_is_judged_by_pictures_and_their_light(tiny: SpadRecipe) -> None:
    made = make_judge(tiny, "plate", make_sampling("gaussian"), None)
    shot = made.shots[0]
    assert torch.equal(shot.planes[:, :1], shot.fine)
    assert float(shot.planes[0, 1, 0, 0]) ** -2 == pytest.approx(shot.photons)


def test_a_plate_is_trained_frozen_and_seen_through(tiny_file: Path, tmp_path: Path) -> None:
    """The whole road: two runs of the house's trainer, the second behind the plate of the first."""
    options = TrainOptions(out_dir=tmp_path, size="S", role="plate", workers=0)
    first = train(tiny_file, options)
    assert first.steps == 4
    saved = read_checkpoint(first.checkpoint)
    joint = load_network(saved)
    assert isinstance(joint, JointCamera)
    kernel = read_plate_psf(first.checkpoint)
    np.testing.assert_allclose(kernel, joint.plate().detach().numpy(), rtol=1e-5)
    assert kernel.sum() == pytest.approx(1, abs=1e-5)
    assert not np.array_equal(kernel, gaussian_psf())
    behind = tmp_path / "behind.toml"
    text = tiny_file.read_text(encoding="utf-8")
    psf = f'mode = "learned"\npsf = "{first.checkpoint.name}"'
    behind.write_text(text.replace('mode = "gaussian"', psf), encoding="utf-8")
    second = train(behind, replace(options, role="upscale"))
    network = load_network(read_checkpoint(second.checkpoint))
    with torch.no_grad():
        assert network(torch.rand(1, 2, 32, 64)).shape == (1, 1, 128, 256)
    assert set(second.baselines) == {"bicubic"}
    with pytest.raises(ContractError, match="not trained with its plate"):
        read_plate_psf(second.checkpoint)


def test_an_interrupted_plate_ends_as_one_that_was_not(tiny_file: Path, tmp_path: Path) -> None:
    def run(folder: str, **changes: object) -> dict[str, torch.Tensor]:
        options = TrainOptions(out_dir=tmp_path / folder, size="S", role="plate", workers=0)
        result = train(tiny_file, replace(options, **changes))  # type: ignore[arg-type]
        return read_checkpoint(result.checkpoint).average

    whole = run("whole")
    run("parts", stop_at_step=2)
    parts = run("parts", resume=True)
    assert all(torch.equal(whole[name], parts[name]) for name in whole)
