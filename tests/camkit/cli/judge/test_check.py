"""`camkit check`: a sound bundle passes, a damaged one is refused with 3."""

import json
from pathlib import Path

import pytest

from camkit.cli.exit_code import ExitCode
from camkit.runtime.proof.check import LAYERS

EXAMPLE = Path(__file__).resolve().parents[3] / "data" / "example-1.0.camkit"

EXAMPLE_2 = EXAMPLE.with_name("example-2.0.camkit")


def test_the_example_of_format_1_0_passes_every_layer(camkit_command) -> None:
    outcome = camkit_command("check", EXAMPLE, "--json")
    report = json.loads(outcome.out)
    assert (outcome.code, report["passed"]) == (0, True), outcome.out
    assert [layer["name"] for layer in report["layers"]] == list(LAYERS)
    assert all(layer["status"] != "fail" for layer in report["layers"])


def test_a_level_runs_with_those_it_stands_on_only(captures, camkit_command) -> None:
    outcome = camkit_command("check", "tiny.camkit", "--level", "hash")
    assert outcome.code == 0
    assert [line.split()[:2] for line in outcome.out.splitlines()] == [
        ["pass", "schema"],
        ["pass", "hash"],
    ]


@pytest.mark.parametrize("where", [0.2, 0.5, 0.9])
def test_a_damaged_bundle_ends_with_3(captures, camkit_command, where: float) -> None:
    data = bytearray((captures / "tiny.camkit").read_bytes())
    data[int(where * len(data))] ^= 0xFF
    (captures / "bad.camkit").write_bytes(data)
    outcome = camkit_command("check", "bad.camkit")
    assert outcome.code == ExitCode.BUNDLE_REFUSED
    assert "fail" in outcome.out


def test_a_kind_that_is_not_installed_ends_with_3_wherever_it_is_used(
    captures, camkit_command
) -> None:
    for command in (
        ["check", EXAMPLE_2, "--level", "schema"],
        ["process", "shot.dng", "--bundle", EXAMPLE_2, "--out-dir", "out"],
        ["simulate", "procedural:1", "--bundle", EXAMPLE_2, "-o", "new.dng"],
    ):
        outcome = camkit_command(*command)
        assert outcome.code == ExitCode.BUNDLE_REFUSED, outcome
        assert "no kind of camera 'toy'" in outcome.out + outcome.err


def test_an_unknown_level_is_a_usage_error(captures, camkit_command) -> None:
    outcome = camkit_command("check", "tiny.camkit", "--level", "thorough")
    assert outcome.code == ExitCode.USAGE
    assert "golden" in outcome.err


def test_a_bundle_that_is_not_there_ends_with_3(camkit_command) -> None:
    assert camkit_command("check", "nobody").code == ExitCode.BUNDLE_REFUSED
