from pathlib import Path

import pytest

from camkit.runtime.output.part_file import atomic_output, part_path


def test_file_appears_under_its_name_only_when_complete(tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    with atomic_output(target) as part:
        part.write_bytes(b"whole")
        assert part == part_path(target)
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


def test_stale_part_is_removed_before_writing(tmp_path: Path) -> None:
    target = tmp_path / "a.exr"
    part_path(target).write_bytes(b"stale")
    with atomic_output(target) as part:
        assert not part.exists()
        part.write_bytes(b"new")
    assert target.read_bytes() == b"new"


def test_block_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), atomic_output(tmp_path / "a.exr"):
        pass
    assert list(tmp_path.iterdir()) == []
