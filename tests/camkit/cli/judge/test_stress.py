"""`camkit stress`: the list may name a bundle, and wrong wishes are refused before any work."""

import pytest

from camkit.cli.exit_code import ExitCode
from camkit.report.stress.scenario import all_scenarios
from tests.hdr_bundle import write_hdr_bundle


def test_the_list_names_every_scenario_without_a_bundle(camkit_command) -> None:
    outcome = camkit_command("stress", "--list")
    assert outcome.code == 0, outcome.err
    listed = [line.split()[0] for line in outcome.out.splitlines()]
    assert listed == [scenario.name for scenario in all_scenarios()]


@pytest.mark.parametrize("bundle", [[], ["duet"]])
def test_the_list_names_only_the_scenarios_chosen(bundle: list[str], camkit_command) -> None:
    outcome = camkit_command("stress", *bundle, "--list", "--scenarios", "noise,bit_depth")
    assert outcome.code == 0, outcome.err
    assert {line.split()[0] for line in outcome.out.splitlines()} == {"noise", "bit_depth"}


def test_the_list_of_a_bundle_holds_the_scenarios_of_its_kind(tmp_path, camkit_command) -> None:
    bundle = write_hdr_bundle(tmp_path)
    outcome = camkit_command("stress", bundle.path, "--list", "--scenarios", "plate_rotation,noise")
    assert outcome.code == 0, outcome.err
    assert "Rotation of the plate" in outcome.out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ([], ExitCode.USAGE, "give a NAME or PATH, or --list"),
        (["--list", "--scenarios", "rain"], ExitCode.USAGE, "rain"),
        (["nobody"], ExitCode.BUNDLE_REFUSED, "nobody"),
        (["nobody", "--list"], ExitCode.BUNDLE_REFUSED, "nobody"),
        (["--list", "--scenarios", "plate_rotation"], ExitCode.USAGE, "plate_rotation"),
        (["nobody", "--write", "--quick"], ExitCode.USAGE, "leave out --quick"),
    ],
)
def test_a_wrong_wish_is_refused_before_any_work(
    arguments: list[str], code: ExitCode, words: str, camkit_command
) -> None:
    outcome = camkit_command("stress", *arguments)
    assert outcome.code == code
    assert words in outcome.err
