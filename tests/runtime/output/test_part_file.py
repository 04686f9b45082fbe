from pathlib import Path

import pytest

from camkit.runtime.output.part_file import (
    atomic_output,
    atomic_outputs,
    part_path,
    stale_parts,
)


def test_file_appears_under_its_name_only_when_complete(tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    with atomic_output(target) as part:
        part.write_bytes(b"whole")
        assert part.parent == tmp_path
        assert not target.exists()
    assert target.read_bytes() == b"whole"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_after_an_error(tmp_path: Path, error: type[BaseException]) -> None:
    target = tmp_path / "a.exr"
    target.write_bytes(b"old")

    def interrupted() -> None:
        with atomic_output(target) as part:
            part.write_bytes(b"half")
            raise error

    with pytest.raises(error):
        interrupted()
    assert target.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_every_writer_has_a_part_of_its_own(tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    with atomic_output(target) as first, atomic_output(target) as second:
        assert first != second
        first.write_bytes(b"1")
        second.write_bytes(b"2")
    assert target.read_bytes() == b"1"


def test_stale_parts_are_those_of_this_file_alone(tmp_path: Path) -> None:
    mine = part_path(tmp_path / "a.exr")
    for path in (mine, part_path(tmp_path / "a.exr.exr"), tmp_path / "a.exr"):
        path.write_bytes(b"")
    assert stale_parts(tmp_path / "a.exr") == [mine]


def test_the_longest_name_of_a_file_system_has_a_part(tmp_path: Path) -> None:
    target = tmp_path / ("ä" * 125 + ".exr")
    with atomic_output(target) as part:
        part.write_bytes(b"new")
    assert target.read_bytes() == b"new"


@pytest.mark.parametrize("links", [True, False])
@pytest.mark.parametrize("failing", [0, 1])
def test_two_files_take_their_names_together_or_not_at_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failing: int, links: bool
) -> None:
    paths = tmp_path / "a.camkit.json", tmp_path / "a.exr"
    paths[1].write_bytes(b"older")
    replace = Path.replace
    calls = iter(range(9))

    def fail(self: Path, target: Path) -> Path:
        if next(calls) == failing:
            raise OSError(28, "No space left on device")
        return replace(self, target)

    def no_links(*_: object) -> None:
        raise OSError(95, "Operation not supported")

    monkeypatch.setattr(Path, "replace", fail)
    if not links:
        monkeypatch.setattr("os.link", no_links)

    def write() -> None:
        with atomic_outputs(*paths) as parts:
            for part in parts:
                part.write_bytes(b"newer")

    with pytest.raises(OSError, match="No space"):
        write()
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]
    assert paths[1].read_bytes() == b"older"


def test_block_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_output(tmp_path / "a.exr"):
        pass
    assert list(tmp_path.iterdir()) == []


def test_names_that_share_their_beginning_keep_their_own_parts(tmp_path: Path) -> None:
    one, other = (tmp_path / f"{'n' * 220}{last}.exr" for last in "ab")
    own = part_path(one)
    own.touch()
    assert stale_parts(one) == [own]
    assert stale_parts(other) == []
    assert len(own.name.encode()) <= 255
