"""Steps are done once; other words are refused."""

from pathlib import Path

import pytest

from camkit.errors import ContractError
from camkit.report.making.work_folder import LASTING, RECORD, WorkFolder, remove_work


class Watch:
    """A stopwatch that the test turns."""

    def __init__(self) -> None:
        self.now_s = 5.0

    def cpu_s(self) -> float:
        return self.now_s


def test_a_step_is_done_once_and_its_seconds_are_kept(tmp_path: Path) -> None:
    watch, calls = Watch(), []

    def work() -> dict[str, object]:
        calls.append(1)
        watch.now_s += 2.0
        return {"found": 3}

    folder = WorkFolder(tmp_path / "work", {"a": 1}, watch)  # type: ignore[arg-type]
    assert not folder.is_done("first")
    # the start of the process counts to the first step
    assert folder.step("first", work) == {"found": 3, "cpu_s": 7.0}
    watch.now_s += 1.0
    assert folder.spent_s() == 8.0
    again = WorkFolder(tmp_path / "work", {"a": 1}, Watch())  # type: ignore[arg-type]
    assert again.step("first", work)["found"] == 3
    assert calls == [1]
    assert again.is_done("first")
    assert again.seconds() == {"first": 7.0}
    assert again.spent_s() == 12.0


def test_a_step_that_fails_is_not_done(tmp_path: Path) -> None:
    folder = WorkFolder(tmp_path, {}, Watch())  # type: ignore[arg-type]

    def fail() -> dict[str, object]:
        raise ContractError("no")

    with pytest.raises(ContractError):
        folder.step("first", fail)
    assert not WorkFolder(tmp_path, {}, Watch()).is_done("first")  # type: ignore[arg-type]


def test_a_folder_of_other_words_is_refused(tmp_path: Path) -> None:
    watch = Watch()
    begun = WorkFolder(tmp_path, {"a": 1, "b": (1.0, 2.0)}, watch)  # type: ignore[arg-type]
    begun.step(LASTING, dict)
    WorkFolder(tmp_path, {"a": 1, "b": [1.0, 2.0]}, watch)  # type: ignore[arg-type]
    with pytest.raises(ContractError, match="begun with another a, c: give the same, or begin"):
        WorkFolder(tmp_path, {"a": 2, "b": [1.0, 2.0], "c": 3}, watch)  # type: ignore[arg-type]


def test_only_the_folder_of_a_making_is_removed(tmp_path: Path) -> None:
    own, other = tmp_path / "mine.work", tmp_path / "photographs"
    WorkFolder(own, {}, Watch()).step("first", dict)  # type: ignore[arg-type]
    assert (own / RECORD).is_file()
    remove_work(own)
    assert not own.exists()
    remove_work(own)
    other.mkdir()
    (other / "one.jpg").write_bytes(b"light")
    with pytest.raises(ContractError, match="holds no steps of a camera"):
        remove_work(other)
    assert (other / "one.jpg").read_bytes() == b"light"


def test_steps_of_which_nothing_came_are_forgotten_for_other_words(tmp_path: Path) -> None:
    watch = Watch()
    WorkFolder(tmp_path, {"a": 1}, watch).step("described", dict)  # type: ignore[arg-type]
    assert WorkFolder(tmp_path, {"a": 1}, watch).is_done("described")  # type: ignore[arg-type]
    assert not WorkFolder(tmp_path, {"a": 2}, watch).is_done("described")  # type: ignore[arg-type]
