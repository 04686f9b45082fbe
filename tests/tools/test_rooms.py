"""The count of rooms sees code, not words about code."""

from pathlib import Path

from tools import rooms


def _tree(folder: Path, **files: str) -> Path:
    for name, text in files.items():
        path = folder / "runtime" / f"{name}.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return folder


def test_code_counts_and_words_about_it_do_not(tmp_path: Path) -> None:
    root = _tree(
        tmp_path,
        speaks='"""Says nothing."""\nsize = "M"\n',
        is_silent='"""A size is "M" for a Wiener bank."""\n# "S" too\nx = 1\n',
    )
    found = {path: rooms.code_of(path) for path in rooms.modules(root)}
    assert rooms.outside("S, M, L", found, root) == ["runtime/speaks.py"]
    assert rooms.outside("Wiener", found, root) == []


def test_blank_lines_comments_and_docstrings_are_no_lines_of_code(tmp_path: Path) -> None:
    root = _tree(
        tmp_path, long='"""Two\nlines."""\n\n\n# a word\ndef f():\n    """Doc."""\n    return 1\n'
    )
    (path,) = rooms.modules(root)
    assert rooms.code_of(path).count("\n") == 1


def test_a_room_may_speak_of_what_is_its_own(tmp_path: Path) -> None:
    root = _tree(tmp_path, wiener="wiener = 1\n", network="wiener = 1\n")
    found = {path: rooms.code_of(path) for path in rooms.modules(root)}
    assert rooms.outside("Wiener", found, root) == ["runtime/network.py"]


def test_this_tree_is_counted(capsys, monkeypatch) -> None:
    monkeypatch.setattr("sys.argv", ["rooms", "--list"])
    assert rooms.main() == 0
    assert "lines of code in" in capsys.readouterr().out
