"""`camkit network` on the command line, and messages that point to it."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
import torch

from camkit.bundle.reader import open_bundle
from camkit.cli.app import run
from camkit.cli.design.network.network_add import cost_text
from camkit.export.foreign import adding, doors
from camkit.progress import Board, Task, listening
from tests.bundle_factory import write_tiny_bundle
from tests.foreign_networks import DnCNN, Mdta, NAFNet, exported, seeded

CONTRACT = '[input]\nplanes = "rgb"\nspace = "srgb"\n\n[output]\nresidual = "subtracted"\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("contract.toml").write_text(CONTRACT)
    Path("dncnn.onnx").write_bytes(exported(seeded(DnCNN), "legacy", opset=11))
    torch.save(seeded(DnCNN).state_dict(), "dncnn.pth")
    write_tiny_bundle(tmp_path)
    return tmp_path


def test_a_network_without_obstacles_is_described(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["network", "inspect", "dncnn.onnx", "--as", "contract.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["obstacles"] == []
    assert (found["opset"], found["reach_px"], found["stride_px"]) == (11, 4, 1)
    assert found["needed_mb_24mp"] < 930
    assert found["tiles_24mp"]["windows"] >= 1


def test_all_obstacles_are_listed_and_the_command_fails(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("attention.onnx").write_bytes(exported(seeded(Mdta)))
    assert run(["network", "inspect", "attention.onnx"]) == 1
    lines = capsys.readouterr().out.splitlines()
    obstacles = [line for line in lines if line.startswith("  obstacle")]
    assert len(obstacles) == 4
    Path("naf.onnx").write_bytes(exported(seeded(NAFNet), "legacy", opset=17))
    assert run(["network", "inspect", "naf.onnx"]) == 1
    assert 'mode = "constants", "local:N" or "whole"' in capsys.readouterr().out
    planes = CONTRACT.partition("[output]")[0]
    Path("local.toml").write_text(planes + '[global]\nmode = "local:64"\n')
    assert run(["network", "inspect", "naf.onnx", "--as", "local.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["obstacles"] == found["global_operators"] == []
    assert found["reach_px"] > 12


def test_a_network_is_added_by_one_command(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["network", "add", "dncnn.pth", "--contract", "contract.toml", "--to", "tiny.camkit"]
    assert run([*words, "-o", "mine.camkit", "--licence", "MIT", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["check 4"].startswith("pass  tiling")
    manifest = open_bundle("mine.camkit").manifest
    assert (manifest.name, manifest.licence, manifest.format_version) == ("mine", "MIT", "2.11")
    assert run([*words, "-o", "mine.camkit"]) == 2
    assert "exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["export", "dncnn.onnx", "-o", "x.camkit"],
        ["export", "dncnn.pth", "-o", "x.camkit"],
        ["check", "dncnn.onnx"],
        ["process", "shot.dng", "--bundle", "dncnn.pth"],
    ],
)
def test_commands_that_take_no_network_point_to_the_one_that_does(
    folder: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(words) != 0
    captured = capsys.readouterr()
    assert "camkit network add" in captured.err + captured.out


def test_a_start_that_is_no_checkpoint_points_there_too(folder: Path) -> None:
    from camkit.errors import ContractError
    from camkit.models_def.training.checkpoint import read_table

    with pytest.raises(ContractError, match="camkit network add"):
        read_table(Path("dncnn.pth"))


def test_a_config_without_a_key_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["network", "inspect", "dncnn.pth", "--module", "a:B", "--config", "width"]
    assert run(words) == 2
    assert "--config takes KEY=VALUE" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("cost_db", "text"),
    [(-0.021, "-0.02 dB: no loss"), (0.0, "0.00 dB: no loss"), (0.089, "0.09 dB lost")],
)
def test_a_negative_cost_reads_as_no_loss(cost_db: float, text: str) -> None:
    assert cost_text(cost_db) == text


def test_every_step_and_what_is_loaded_are_shown(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[str] = []
    monkeypatch.setattr(Task, "__setattr__", _recorder(seen))
    lines: list[str] = []
    with listening(Board(note=lines.append)):
        doors.add_network(
            "dncnn.pth",
            "mine.camkit",
            contract="contract.toml",
            camera="tiny.camkit",
            module="tests.foreign_networks:DnCNN",
        )
    steps = [text for text in seen if text in adding.STEPS]
    assert steps == list(adding.STEPS)
    assert "loading torch for dncnn.pth" in seen
    assert "loading tests.foreign_networks:DnCNN" in seen
    assert "turning DnCNN into ONNX" in seen
    (line,) = lines
    assert line.endswith("weights of tests.foreign_networks:DnCNN")


def _recorder(seen: list[str]) -> Callable[[Task, str, object], None]:
    """Return a setter that keeps every text of a task."""

    def set_value(task: Task, name: str, value: object) -> None:
        if name == "what":
            seen.append(str(value))
        object.__setattr__(task, name, value)

    return set_value
