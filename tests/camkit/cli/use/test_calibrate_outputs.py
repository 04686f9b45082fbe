"""What every command of `camkit calibrate` prints."""

import json
from pathlib import Path
from typing import Any

from camkit.cli.use.calibrate.calibration_outputs import print_result, with_files

RECORD: dict[str, Any] = {"rms_px": 0.25, "notes": ["small"]}
OUT, PAGE = Path("facts.toml"), Path("page.html")


def test_people_read_notes_files_and_lines(capsys) -> None:
    print_result(with_files(RECORD, OUT, PAGE), ["rms 0.25 px"], as_json=False)
    assert capsys.readouterr() == ("facts.toml, page.html:\nrms 0.25 px\n", "note: small\n")
    print_result(with_files(RECORD, OUT, None), [], as_json=False, summary="one line")
    assert capsys.readouterr().out == "facts.toml: one line\n"


def test_json_is_one_object_that_names_the_files(capsys) -> None:
    print_result(with_files(RECORD, OUT, PAGE), ["unsaid"], as_json=True)
    out, err = capsys.readouterr()
    assert json.loads(out) == RECORD | {"out": "facts.toml", "page": "page.html"}
    assert err == ""
