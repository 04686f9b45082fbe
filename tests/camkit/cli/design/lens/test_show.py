"""`camkit lens show` from a file to a page and one JSON object."""

import json
from pathlib import Path

import pytest

from camkit.cli.app import run
from camkit.cli.exit_code import ExitCode
from tests.zmx_factory import LA1131

LENS = Path(__file__).resolve().parents[5] / "models_def/prescriptions/cooke-triplet-f5.toml"


def test_json_is_one_object_on_stdout_and_nothing_is_written(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    options = ("--pupil", "chief", "--sampling", "hexapolar:6", "--json")
    assert run(["lens", "show", str(LENS), *options]) == ExitCode.DONE
    found = json.loads(capsys.readouterr().out)
    assert found["pupil"] == "chief"
    rms = {(f["field_angle_deg"], f["wavelength_um"]): f["spot_rms_mm"] for f in found["fields"]}
    assert rms[20.0, 0.55] == pytest.approx(0.0122945, abs=2e-8)
    assert not list(tmp_path.iterdir())


def test_page_is_not_replaced_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cooke-triplet-f5.html").write_text("mine", encoding="utf-8")
    assert run(["lens", "show", str(LENS), "-o", str(tmp_path)]) == ExitCode.USAGE
    assert "exists" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [("--pupil", "aimed", "paraxial, chief, stop"), ("--sampling", "six", "hexapolar:RINGS")],
)
def test_wrong_words_are_usage_errors_that_name_the_right_ones(
    option: str, value: str, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["lens", "show", str(LENS), option, value, "--json"]) == ExitCode.USAGE
    assert message in capsys.readouterr().err


def test_a_built_in_lens_is_shown_by_its_name(camkit_command) -> None:
    outcome = camkit_command("lens", "show", "al2550-a", "--json")
    assert outcome.code == 0, outcome.err
    assert json.loads(outcome.out)["f_number"] == pytest.approx(4.0, rel=1e-6)
    outcome = camkit_command("lens", "show", "al2551-a", "--json")
    assert outcome.code == 1
    assert "name one of" in outcome.err
    assert "al2550-a" in outcome.err


def test_what_was_left_out_of_a_file_stands_in_its_json(camkit_command, tmp_path: Path) -> None:
    path = tmp_path / "lens.zmx"
    path.write_text(LA1131.replace("VCYN 0 0", "VCYN 0 0.2"))
    outcome = camkit_command("lens", "show", path, "--json")
    assert "VCYN" in json.loads(outcome.out)["notes"][0]


@pytest.mark.parametrize(
    ("more", "page"),
    [
        ([], "cooke-triplet-f5.html"),
        (["-o", "out"], "out/cooke-triplet-f5.html"),
        (["-o", "out/mine.html"], "out/mine.html"),
        (["-o", "mine.HTML"], "mine.html"),
        (["-o", "mine.html", "--json"], "mine.html"),
    ],
)
def test_a_page_goes_where_it_is_asked_for_and_every_file_is_printed(
    more: list[str],
    page: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["lens", "show", str(LENS), *more]) == ExitCode.DONE
    there = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*.*")}
    assert page in there
    assert {Path(name).parent for name in there} == {Path(page).parent}
    assert all(name.startswith(page.removesuffix(".html")) for name in there)
    if "--json" not in more:
        assert set(capsys.readouterr().out.split()) == there


def test_a_lens_is_compared_on_the_page_alone(camkit_command) -> None:
    refused = camkit_command("lens", "show", LENS, "--compare", "duet", "--json")
    assert refused.code == ExitCode.USAGE
    assert "--out-dir" in refused.err
