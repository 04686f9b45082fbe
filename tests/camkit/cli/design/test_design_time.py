"""The commands that need torch: they say so, and otherwise hand their options on."""

import json
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load

import camkit
from camkit.bundle.psf_file import read_source
from camkit.cli.exit_code import ExitCode
from camkit.entry_points import install_text
from camkit.stopwatch import Stopwatch

RECIPE = Path(__file__).resolve().parents[4] / "models_def" / "recipes" / "duet.toml"
COMMANDS = {
    "freeze": ["lens.toml", "-o", "psf.safetensors"],
    "train": ["recipe.toml"],
    "fit-bank": ["recipe.toml", "-o", "with.toml"],
    "freeze-norms": ["recipe.toml", "one.pt", "-o", "two.pt"],
    "export": ["one.pt", "-o", "one.camkit"],
}


@pytest.mark.parametrize("command", COMMANDS)
def test_without_torch_a_design_command_says_how_to_get_it(
    command: str, camkit_command, monkeypatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    outcome = camkit_command(command, *COMMANDS[command])
    assert outcome.code == ExitCode.INPUT_FAILED
    assert f"camkit {command} needs torch" in outcome.err
    assert install_text("train") in outcome.err


@pytest.mark.parametrize("command", ["freeze", "freeze-norms", "export"])
def test_an_existing_output_is_refused_before_any_work(
    command: str, camkit_command, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / COMMANDS[command][-1]).write_bytes(b"precious")
    outcome = camkit_command(command, *COMMANDS[command])
    assert outcome.code == ExitCode.USAGE
    assert "--overwrite" in outcome.err


def test_export_without_a_frozen_psf_says_where_it_looked(
    camkit_command, tmp_path, monkeypatch
) -> None:
    monkeypatch.chdir(tmp_path)
    recipe = Path(camkit.__file__).parent / "models_def" / "recipes" / "duet.toml"
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "duet.toml").write_bytes(recipe.read_bytes())
    outcome = camkit_command("export", "runs/duet.toml", "--no-network", "-o", "one.camkit")
    assert outcome.code == ExitCode.USAGE
    assert "runs/psf.safetensors" in outcome.err
    assert "camkit freeze" in outcome.err


def test_export_names_a_checkpoint_that_is_not_there(camkit_command, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = camkit_command("export", "runs/one.pt", "-o", "one.camkit")
    assert outcome.code == ExitCode.USAGE
    assert "runs/one.pt" in outcome.err


def test_train_hands_every_option_on(camkit_command, tmp_path, monkeypatch) -> None:
    from camkit.models_def.training import trainer
    from camkit.models_def.training.refinement import Refinement

    seen = []

    def fake(
        recipe: Path,
        options: trainer.TrainOptions,
        *,
        refinement: Refinement | None,
        stopwatch: Stopwatch,
    ) -> trainer.TrainResult:
        assert refinement is None
        assert stopwatch.cpu_s() > 0, "budgets count from the start of the command"
        seen.append((recipe, options))
        return trainer.TrainResult(
            checkpoint=options.out_dir / "x.pt",
            log=options.out_dir / "x.jsonl",
            steps=3,
            elapsed_s=1.0,
            cpu_s=1.0,
            baselines={"capture": 20.0, "wiener": 22.0},
            valid_db=24.0,
        )

    monkeypatch.setattr(trainer, "train", fake)
    outcome = camkit_command(
        *(
            "train",
            RECIPE,
            "--size",
            "S",
            "--role",
            "restore",
            "--data",
            "pictures",
            "--valid",
            "few",
            "--resume",
        ),
        *(
            "--max-minutes",
            "2.5",
            "--max-cpu-minutes",
            "3",
            "--out-dir",
            tmp_path,
            "--threads",
            "2",
            "--workers",
            "0",
            "--sharp",
            "many",
            "--pairs",
            "shown",
        ),
        "--json",
    )
    assert outcome.code == 0, outcome.err
    told = json.loads(outcome.out)
    assert (told["capture_db"], told["wiener_db"], told["valid_db"]) == (20.0, 22.0, 24.0)
    assert seen == [
        (
            RECIPE,
            trainer.TrainOptions(
                out_dir=tmp_path,
                size="S",
                role="restore",
                data_folder=Path("pictures"),
                valid_folder=Path("few"),
                max_minutes=2.5,
                max_cpu_minutes=3.0,
                resume=True,
                threads=2,
                workers=0,
                sharp_folder=Path("many"),
                pairs=Path("shown"),
            ),
        )
    ]


def test_train_says_that_features_are_a_substitute_where_its_loss_looks_at_any(
    camkit_command, tmp_path
) -> None:
    recipe = RECIPE.with_name("duet_losses.toml")
    begun = tmp_path / "duet_losses_{}.pt"
    for size, said in (("perceptual", True), ("adversarial", False)):
        Path(str(begun).format(size)).write_bytes(b"precious")
        outcome = camkit_command("train", recipe, "--size", size, "--out-dir", tmp_path)
        assert outcome.code == ExitCode.USAGE
        assert "give --resume to go on or --overwrite" in outcome.err
        assert ("random weights in place of VGG-19" in outcome.err) == said


def test_a_missing_recipe_is_a_usage_error(camkit_command, tmp_path) -> None:
    outcome = camkit_command("train", tmp_path / "absent.toml", "--out-dir", tmp_path)
    assert outcome.code == ExitCode.USAGE
    assert "absent.toml" in outcome.err


def test_freeze_writes_psf_stress_psf_and_report(camkit_command, tmp_path, monkeypatch) -> None:
    from camkit.bundle.frozen_optics import FrozenOptics
    from camkit.models_def.optics import freezer as module
    from camkit.models_def.optics import optics_file
    from camkit.models_def.optics.frozen import Frozen
    from tests.bundle_factory import tiny_psf

    seen = {}

    def fake(optics: object, **options: object) -> tuple[FrozenOptics, dict[str, int]]:
        assert optics == Path("lens.toml")
        seen.update(options)
        return FrozenOptics(psf=tiny_psf()), {"block_px": 512}

    monkeypatch.setattr(module, "freeze_samples", fake)
    monkeypatch.setattr(module, "freeze_stress", lambda *_: Frozen(psf=tiny_psf(), energy_kept=1.0))
    monkeypatch.setattr(optics_file, "read_optics", lambda path, *_: path)
    folder = tmp_path / "new"
    outcome = camkit_command(
        *("freeze", "lens.toml", "-o", folder / "psf.safetensors"),
        *("--stress-out", folder / "stress.safetensors", "--report", folder / "freeze.json"),
        *("--depths-mm", "500,1e3,inf", "--max-side-px", 201, "--limit-db", 0.1, "--json"),
    )
    assert outcome.code == 0, outcome.err
    assert seen["grid"].depths_mm == (500.0, 1000.0, math.inf)
    assert (seen["grid"].max_side_px, seen["limit_db"]) == (201, 0.1)
    assert json.loads(outcome.out) == json.loads((folder / "freeze.json").read_text())
    assert json.loads(outcome.out) == {"block_px": 512}
    frozen = (folder / "psf.safetensors").read_bytes()
    assert read_source(frozen) == "camkit freeze of lens.toml"
    plain, stress = load(frozen), load((folder / "stress.safetensors").read_bytes())
    assert plain.keys() == stress.keys()
    assert all(np.array_equal(plain[name], stress[name]) for name in plain)
    assert seen["sensor"].width_px == 6000, "the camera of the default recipe"
    assert seen["settings"].clip_iterations == 3, "its Wiener bank measures the loss"


def test_export_finds_what_lies_beside_the_checkpoint(
    camkit_command, tmp_path, monkeypatch
) -> None:
    from camkit.export import assemble
    from camkit.export.parts import Parts
    from camkit.models_def.training.checkpoint import Checkpoint, write_checkpoint

    checkpoint = Checkpoint(
        recipe_toml=RECIPE.read_text(encoding="utf-8"),
        size="M",
        network="lean_m",
        config={},
        bank_digest="",
        training_data="",
        step=0,
        elapsed_s=0.0,
        cpu_s=0.0,
        valid_db=None,
        weights={},
        average={},
        optimizer={},
    )
    write_checkpoint(tmp_path / "one.pt", checkpoint)
    stress = ("stress_psf.safetensors", "stress_haze.safetensors")
    beside = ("psf.safetensors", "haze.safetensors", *stress)
    for name in (*beside, "freeze.json", "plan.json"):
        (tmp_path / name).write_bytes(b"{}")
    elsewhere = tmp_path / "other"
    elsewhere.mkdir()
    for name in ("psf.safetensors", stress[0]):
        (elsewhere / name).write_bytes(b"{}")
    seen = []

    def fake(parts: Parts, out: Path) -> dict[str, str]:
        seen.append(parts)
        return {"bundle": str(out)}

    monkeypatch.setattr(assemble, "export_bundle", fake)
    call = ("export", tmp_path / "one.pt", "-o", tmp_path / "one.camkit")
    plates = (("--plate", "streak-4"), ("--plate", "none"))
    optics = ("--psf", elsewhere / "psf.safetensors")
    nearer = ("--stress-psf", elsewhere / stress[0])
    for chosen in ((), ("--plan", tmp_path / "other.json"), *plates, optics, nearer):
        outcome = camkit_command(*call, *chosen)
        assert outcome.code == 0, outcome.err
    parts, other, named, without, apart, near = seen
    assert parts.haze == tmp_path / "haze.safetensors"
    assert apart.haze is None, "the haze of other optics lies beside them"
    assert (parts.psf, parts.freeze) == (tmp_path / "psf.safetensors", tmp_path / "freeze.json")
    assert (parts.plan, other.plan) == (tmp_path / "plan.json", tmp_path / "other.json")
    assert (parts.stress_psf, parts.stress_haze) == tuple(tmp_path / name for name in stress)
    assert (near.stress_psf, near.stress_haze) == (elsewhere / stress[0], None)
    assert parts.prescription is None, "the lens of the checkpoint"
    assert (parts.plate, parts.without_plate) == (None, False), "its plate"
    assert (named.plate, named.without_plate) == (Path("streak-4"), False)
    assert (without.plate, without.without_plate) == (None, True)


def test_files_of_fine_tuning_need_a_checkpoint_to_start_from(camkit_command) -> None:
    outcome = camkit_command("train", RECIPE, "--vgg", "vgg19.pth")
    assert outcome.code == ExitCode.USAGE
    assert "add --fine-tune too" in outcome.err


def test_depths_that_are_no_numbers_are_a_usage_error(camkit_command, tmp_path) -> None:
    out = tmp_path / "psf.safetensors"
    outcome = camkit_command("freeze", "lens.toml", "-o", out, "--depths-mm", "near,far")
    assert outcome.code == ExitCode.USAGE
    assert "--depths-mm takes distances" in outcome.err
