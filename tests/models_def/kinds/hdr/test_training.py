"""The kind as training sees it: samples by number, a judge, a network trained for two steps."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from camkit.bundle.stages import Demosaic, Highlights, Network
from camkit.models_def.kinds.hdr import validation
from camkit.models_def.kinds.hdr.material import HdrMaterial
from camkit.models_def.kinds.hdr.recipe import HdrRecipe
from camkit.models_def.kinds.hdr.samples import DEMOSAIC, LAYOUT, sample_of
from camkit.models_def.kinds.hdr.training import PART
from camkit.models_def.kinds.hdr.validation import MOST_DB, HdrJudge
from camkit.models_def.training.checkpoint import load_network, read_checkpoint
from camkit.models_def.training.kind import training_kind
from camkit.models_def.training.trainer import TrainOptions, train

ROLE = "highlights"


@pytest.fixture(scope="module")
def judge(tiny: HdrRecipe, lines: HdrMaterial) -> HdrJudge:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(validation, "CAPTURES", 3)
        made = PART.judge(tiny, ROLE, lines, None)
    assert isinstance(made, HdrJudge)
    return made


def test_the_kind_is_found_by_its_name() -> None:
    assert training_kind("hdr") is PART


def test_sample_i_is_a_function_of_recipe_seed_and_i(tiny: HdrRecipe, lines: HdrMaterial) -> None:
    makers = [PART.maker(tiny, ROLE, lines, None, seed) for seed in (1, 1, 2)]
    one, same, other = (maker.make(3) for maker in makers)
    assert torch.equal(one.target, same.target)
    assert torch.equal(one.inputs["lit"], same.inputs["lit"])
    assert not torch.equal(one.target, other.target)
    assert not torch.equal(one.target, makers[0].make(4).target)
    side = tiny.data.sample_px
    for port in LAYOUT.inputs:
        assert one.inputs[port.name].shape == (port.channels, side, side)
        assert torch.isfinite(one.inputs[port.name]).all()
    assert PART.samples_digest(tiny, ROLE, 1) != PART.samples_digest(tiny, ROLE, 2)
    assert PART.layout(tiny, ROLE) is LAYOUT


def test_the_stages_are_physics_and_then_the_network(tiny: HdrRecipe) -> None:
    design = PART.design(tiny)
    kinds = [type(stage) for stage in design.stages]
    assert kinds.index(Network) == kinds.index(Highlights) + 1
    network = design.stages[kinds.index(Network)]
    assert isinstance(network, Network)
    assert (network.role, network.takes, network.scale) == (ROLE, ("rgb", "lit"), tiny.scale)
    lights, colours = (design.stages[kinds.index(kind)] for kind in (Highlights, Demosaic))
    assert isinstance(lights, Highlights)
    assert isinstance(colours, Demosaic)
    assert lights.from_samples
    assert network.keeps_white
    assert lights.method == colours.method == DEMOSAIC
    assert design.object_distance_mm == tiny.object_distance_mm
    assert set(PART.camera_parts) >= {"sensor", "plate"}


def test_physics_is_judged_better_than_the_capture(judge: HdrJudge) -> None:
    found = judge.baselines()
    assert set(found) == {"capture", "physics"}
    assert found["physics"] > found["capture"] + 0.5
    assert 10 < found["capture"] < MOST_DB


def test_a_perfect_restoration_has_the_most_and_isos_are_told_apart(judge: HdrJudge) -> None:
    """What is restored is the truth in the domain of networks."""
    shots = iter(judge.shots)

    def perfect(planes: torch.Tensor) -> torch.Tensor:
        _, shot = next(shots)
        whole = sample_of(shot, (0, 0), judge.recipe, side_px=planes.shape[-1])
        return whole.target[None]

    score = judge.score(perfect)
    assert score.mean_db > 90
    assert set(score.parts["by_iso"]) == {"100", "800"}
    low, high = (
        judge.score(lambda planes, f=factor: f * planes[:, 3:]).mean_db for factor in (1.0, 1.5)
    )
    assert low > high


def test_the_judge_sees_what_is_never_trained_on_and_always_the_same(
    judge: HdrJudge, tiny: HdrRecipe, lines: HdrMaterial, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validation, "CAPTURES", 1)
    again = PART.judge(tiny, ROLE, lines, None)
    assert isinstance(again, HdrJudge)
    np.testing.assert_array_equal(again.shots[0][1].lit, judge.shots[0][1].lit)
    assert again.shots[0][0] == judge.shots[0][0]


def test_material_of_another_process_makes_the_same_samples(
    tiny: HdrRecipe, lines: HdrMaterial, tmp_path: Path
) -> None:
    lines.write(tmp_path)
    back = PART.read_material(tmp_path)
    one, other = (PART.maker(tiny, ROLE, m, None, 1).make(0) for m in (lines, back))
    assert torch.equal(one.inputs["lit"], other.inputs["lit"])


def test_two_steps_of_training_make_a_network_that_opens(
    tiny_text: str, lines: HdrMaterial, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(validation, "CAPTURES", 1)
    path = tmp_path / "tiny.toml"
    path.write_text(tiny_text, encoding="utf-8")
    options = TrainOptions(out_dir=tmp_path, size="S", workers=0, role=ROLE)
    result = train(path, options, material=lines)
    assert result.steps == 2
    assert set(result.baselines) == {"capture", "physics"}
    checkpoint = read_checkpoint(result.checkpoint)
    assert checkpoint.role == ROLE
    planes = torch.rand(1, 6, 32, 32)
    with torch.no_grad():
        made = load_network(checkpoint)(planes)
    assert made.shape == (1, 3, 32, 32)
    assert torch.isfinite(made).all()


def test_a_share_of_scenes_is_as_it_is(tiny: HdrRecipe, lines: HdrMaterial) -> None:
    """Without any share to saturate, scenes are darker."""
    usual = replace(tiny, data=replace(tiny.data, as_it_is_share=0.0))
    still = replace(tiny, data=replace(tiny.data, as_it_is_share=1.0))
    one, other = (PART.maker(r, ROLE, lines, None, 1).make(0) for r in (usual, still))
    assert not torch.equal(one.target, other.target)
