"""What every command of `camkit calibrate` writes and says."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from camkit.cli.use.calibrate.outputs import Outputs
from camkit.errors import ContractError

RECORD: dict[str, Any] = {"rms_px": 0.25, "notes": ["small"]}


def _asked(folder: Path, *, page: bool = True, as_json: bool = False, overwrite: bool = False) -> Outputs:  # noqa: E501 # fmt: skip
    named = folder / "page.html" if page else None
    return Outputs.checked(folder / "found.toml", named, overwrite=overwrite, as_json=as_json)


def test_toml_page_and_lines_say_the_same(tmp_path: Path, capsys) -> None:
    folder = tmp_path / "new"
    _asked(folder).write(RECORD, ["rms 0.25 px"], lambda: "<html>")
    assert tomllib.loads((folder / "found.toml").read_text()) == RECORD
    assert (folder / "page.html").read_text() == "<html>"
    out, err = capsys.readouterr()
    assert out == f"{folder / 'found.toml'}, {folder / 'page.html'}:\nrms 0.25 px\n"
    assert err == "note: small\n"


def test_json_is_one_object_that_names_the_files(tmp_path: Path, capsys) -> None:
    _asked(tmp_path, as_json=True).write(RECORD, ["unsaid"], lambda: "")
    out, err = capsys.readouterr()
    names = {"out": str(tmp_path / "found.toml"), "page": str(tmp_path / "page.html")}
    assert json.loads(out) == RECORD | names
    assert err == ""


def test_a_page_that_nobody_asked_for_is_not_drawn(tmp_path: Path) -> None:
    _asked(tmp_path, page=False).write(RECORD, [], lambda: pytest.fail("drawn"))
    assert [path.name for path in tmp_path.iterdir()] == ["found.toml"]


@pytest.mark.parametrize("name", ["found.toml", "page.html"])
def test_what_exists_is_kept_unless_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("old")
    with pytest.raises(ContractError, match=f"{name} exists; add --overwrite"):
        _asked(tmp_path)
    _asked(tmp_path, overwrite=True).write(RECORD, [], lambda: "<html>")
    assert (tmp_path / name).read_text() != "old"


@pytest.mark.parametrize(("out", "page"), [("a.txt", None), ("a.toml", "b.pdf"), ("a", None)])
def test_names_of_other_kinds_are_refused(tmp_path: Path, out: str, page: str | None) -> None:
    named = None if page is None else tmp_path / page
    with pytest.raises(ContractError, match="expected a name in"):
        Outputs.checked(tmp_path / out, named, overwrite=False, as_json=False)


def test_a_page_that_fails_leaves_no_file(tmp_path: Path) -> None:
    def page() -> str:
        raise ContractError("no page")

    with pytest.raises(ContractError, match="no page"):
        _asked(tmp_path).write(RECORD, [], page)
    assert not list(tmp_path.iterdir())
