"""The files of a measurement: all or none, and refused before any work."""

from pathlib import Path

import pytest

from camkit.calibrate.result_files import check_results, paths_of, write_results
from camkit.errors import ContractError

Files = tuple[Path | None, Path | None]


def _checked(folder: Path, *, page: bool = True, overwrite: bool = False) -> Files:
    page_file = folder / "page.html" if page else None
    return check_results(folder / "facts.toml", ".toml", page_file, overwrite=overwrite)


def test_result_and_page_are_written_into_a_new_folder(tmp_path: Path) -> None:
    folder = tmp_path / "new"
    write_results(_checked(folder), lambda: b"a = 1\n", lambda: "<html>")
    assert (folder / "facts.toml").read_text() == "a = 1\n"
    assert (folder / "page.html").read_text() == "<html>"


def test_what_is_not_named_is_neither_made_nor_written(tmp_path: Path) -> None:
    write_results((None, None), lambda: pytest.fail("made"), lambda: pytest.fail("drawn"))
    write_results(_checked(tmp_path, page=False), lambda: b"", lambda: pytest.fail("drawn"))
    assert [path.name for path in tmp_path.iterdir()] == ["facts.toml"]


@pytest.mark.parametrize("name", ["facts.toml", "page.html"])
def test_what_exists_is_kept_unless_overwritten(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("old")
    with pytest.raises(ContractError, match=f"{name} exists; add overwrite=True"):
        _checked(tmp_path)
    write_results(_checked(tmp_path, overwrite=True), lambda: b"new", lambda: "<html>")
    assert (tmp_path / name).read_text() != "old"


@pytest.mark.parametrize(("out", "page"), [("a.txt", None), ("a.toml", "b.pdf"), ("a", None)])
def test_names_of_other_kinds_are_refused(tmp_path: Path, out: str, page: str | None) -> None:
    page_file = None if page is None else tmp_path / page
    with pytest.raises(ContractError, match="expected a name in"):
        check_results(tmp_path / out, ".toml", page_file, overwrite=False)


def test_a_page_that_fails_leaves_no_file(tmp_path: Path) -> None:
    def page() -> str:
        raise ContractError("no page")

    with pytest.raises(ContractError, match="no page"):
        write_results(_checked(tmp_path), lambda: b"", page)
    assert not list(tmp_path.iterdir())


def test_one_file_may_stand_for_several(tmp_path: Path) -> None:
    assert paths_of("a.dng") == paths_of(Path("a.dng")) == paths_of(["a.dng"]) == [Path("a.dng")]
    assert paths_of(()) == []
