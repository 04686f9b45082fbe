"""Entries are made once; a hash tells parts apart."""

from pathlib import Path

import pytest

from tools.tables.journal import Journal, digest


def test_an_entry_is_made_once_and_read_again(tmp_path: Path) -> None:
    path = tmp_path / "journal.jsonl"
    first = Journal(path).entry("a", lambda: {"db": (1.0, 2.0)})
    again = Journal(path).entry("a", lambda: pytest.fail("made again"))
    assert first == again == {"key": "a", "db": [1.0, 2.0]}
    assert len(path.read_text(encoding="utf-8").splitlines()) == 1


def test_every_part_counts_and_so_does_where_it_ends() -> None:
    assert digest("a", b"b") == digest("a", b"b")
    assert len({digest("a", "b"), digest("ab"), digest("b", "a"), digest(1, None)}) == 4
