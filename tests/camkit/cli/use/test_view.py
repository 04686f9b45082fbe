"""`camkit view`: what it prints, and what it refuses in one line."""

import json
from pathlib import Path

from camkit.cli.exit_code import ExitCode
from tests.dng_factory import write_scene


def test_the_command_states_the_page_its_results_and_its_size(
    camkit_command, tmp_path: Path
) -> None:
    write_scene(tmp_path / "a.dng")
    out = tmp_path / "out"
    made = camkit_command(
        "process", str(tmp_path / "a.dng"), "--bundle", "none", "--out-dir", str(out)
    )
    assert made.code == 0
    page = tmp_path / "page.html"
    shown = camkit_command("view", str(out), "-o", str(page), "--crop", "9,9", "--json")
    facts = json.loads(shown.out)
    assert facts["results"] == [str(out / "a.exr")]
    assert 0 < facts["megabytes"] < 1
    assert "At 9, 9" in page.read_text(encoding="utf-8")
    again = camkit_command("view", str(out), "-o", str(page))
    assert again.code == ExitCode.USAGE
    assert "add --overwrite" in again.err
    write_scene(tmp_path / "other.dng", black=255)
    other = camkit_command(
        *("view", str(out), "--before", str(tmp_path / "other.dng"), "-o", str(page), "--overwrite")
    )
    assert other.code == 0
    assert "note: a.exr: other.dng is not the capture a.dng" in other.err
    gone = camkit_command("view", str(out / "b.exr"), "-o", str(tmp_path / "b.html"))
    assert gone.code == ExitCode.INPUT_FAILED
    assert "b.exr" in gone.err
