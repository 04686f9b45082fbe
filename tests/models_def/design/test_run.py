import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from camkit.errors import ContractError
from camkit.models_def.design import starts
from camkit.models_def.design.design_recipe import DesignRecipe
from camkit.models_def.design.run import DesignOptions, DesignRun
from camkit.models_def.design.starts import Starts
from camkit.models_def.optics.lens_file.lens_file import read_lens
from camkit.models_def.optics.paraxial import paraxial_data


def finish(recipe: DesignRecipe, options: DesignOptions, last_step: int | None = None) -> DesignRun:
    run = DesignRun(recipe, options)
    list(run.go(last_step))
    return run


def test_a_stopped_run_goes_on_and_leaves_lens_log_and_checkpoint(
    recipe: DesignRecipe, tmp_path: Path
) -> None:
    whole = finish(recipe, DesignOptions(out_dir=tmp_path / "a"))
    options = DesignOptions(out_dir=tmp_path / "b")
    finish(recipe, options, last_step=3)
    resumed = finish(recipe, replace(options, resume=True))
    assert torch.equal(resumed.loop.parts.lens.moves, whole.loop.parts.lens.moves)
    report = resumed.finish()
    lens = read_lens(Path(report["lens"]))
    assert (lens.name, lens.note) == (
        recipe.name,
        f"camkit design, recipe {recipe.name}, from duet",
    )
    assert paraxial_data(lens).efl_mm == pytest.approx(50, abs=2)
    entries = [json.loads(line) for line in resumed.files.log.read_text().splitlines()]
    assert [entry["step"] for entry in entries] == [0, 3, 6]
    assert [entry["valid_rays"] for entry in entries] == [1, 1, 1]
    assert report["best_db"] >= report["begin_db"]


def test_a_resumed_run_takes_its_start_from_the_checkpoint(
    recipe: DesignRecipe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    searching = replace(recipe, starts=Starts(count=4, spread=0.3, scout_steps=1, dls_steps=1))
    whole = finish(searching, DesignOptions(out_dir=tmp_path / "a"))
    assert whole.searched_s > 0
    options = DesignOptions(out_dir=tmp_path / "b")
    finish(searching, options, last_step=3)
    monkeypatch.setattr(starts, "improve", pytest.fail)
    resumed = finish(searching, replace(options, resume=True))
    assert resumed.searched_s == 0
    ends = (run.loop.parts.lens.scaled() for run in (whole, resumed))
    assert torch.equal(*ends)


def test_an_earlier_run_is_not_lost_by_mistake(recipe: DesignRecipe, tmp_path: Path) -> None:
    options = DesignOptions(out_dir=tmp_path)
    finish(recipe, options, last_step=3)
    with pytest.raises(ContractError, match="resume"):
        DesignRun(recipe, options)
    other = replace(recipe, schedule=replace(recipe.schedule, seed=9))
    with pytest.raises(ContractError, match="another recipe"):
        DesignRun(other, replace(options, resume=True))
    (tmp_path / "small.pt").write_bytes(b"nothing")
    with pytest.raises(ContractError, match="no checkpoint"):
        DesignRun(recipe, replace(options, resume=True))


def test_a_start_without_light_is_refused_by_its_keys(recipe: DesignRecipe, tmp_path: Path) -> None:
    pixels = replace(recipe.pixels, pitch_um=0.006)
    with pytest.raises(ContractError, match=r"kernel_px\) of 0\.006 um \(pixels\.pitch_um\)"):
        finish(replace(recipe, pixels=pixels), DesignOptions(out_dir=tmp_path))
    assert not any(tmp_path.iterdir())


def test_the_view_shows_fixed_patches(recipe: DesignRecipe, tmp_path: Path) -> None:
    view = finish(recipe, DesignOptions(out_dir=tmp_path), last_step=3).view()
    assert view.kernels.shape == (1, 3, 3, 33, 33)
    assert {tuple(p.shape) for p in view.patches} == {(2, 3, 24, 24)}


WORKER = """
import json, sys, tomllib
from pathlib import Path
from camkit.models_def.design.design_recipe import to_design
from camkit.models_def.design.run import DesignOptions, DesignRun
table = json.loads(Path(sys.argv[1]).read_text())
run = DesignRun(to_design(table), DesignOptions(out_dir=Path(sys.argv[2])))
list(run.go())
rank = __import__("torch").distributed.get_rank()
weights = [p.sum().item() for p in run.loop.parts.network.parameters()]
print("RESULT", rank, json.dumps([run.loop.parts.lens.moves.tolist(), weights]))
"""


@pytest.mark.slow
def test_two_processes_share_every_step(table: dict[str, object], tmp_path: Path) -> None:
    (tmp_path / "table.json").write_text(json.dumps(table))
    (tmp_path / "worker.py").write_text(WORKER)
    command = [
        *(sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node=2"),
        *(str(tmp_path / "worker.py"), str(tmp_path / "table.json"), str(tmp_path / "out")),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, check=True)
    lines = [line.split(" ", 2) for line in done.stdout.splitlines() if "RESULT" in line]
    ranks = {line[1]: json.loads(line[2]) for line in lines}
    assert set(ranks) == {"0", "1"}
    assert ranks["0"] == ranks["1"]
    assert len(list((tmp_path / "out").glob("*.jsonl"))) == 1
