from pathlib import Path

import pytest

from camkit.errors import ContractError, DecodeError
from camkit.runtime.merging.times import stated_times

FILES = [Path("b/two.png"), Path("a/one.png")]


def test_seconds_are_in_the_order_of_the_files_and_may_be_fractions() -> None:
    assert stated_times("0.5, 1/60", FILES) == (0.5, 1 / 60)


def test_a_list_goes_by_name_and_skips_what_is_not_asked_for(tmp_path: Path) -> None:
    lines = "# name seconds\none.png 32 0.03125 8 0 0\n\nother.png 16\ntwo.png\t1/4 # late\n"
    (tmp_path / "list.txt").write_text(lines)
    assert stated_times(str(tmp_path / "list.txt"), FILES) == (0.25, 32.0)


def test_dark_frames_come_after_the_files_and_are_counted_apart() -> None:
    assert stated_times("1,2,3", FILES, [Path("dark.png")]) == (1, 2, 3)
    with pytest.raises(ContractError, match="5 times for 2 files and 1 dark frames"):
        stated_times("1,2,3,4,5", FILES, [Path("dark.png")])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1,2,3", "3 times for 2 files"),
        ("1,0", "must be > 0 s; got 0"),
        ("1,nan", "must be > 0"),
        ("1,1/0", "seconds separated by commas, or a file"),
        ("1,soon", "seconds separated by commas, or a file"),
        ("no-such-file", "seconds separated by commas, or a file"),
    ],
)
def test_what_is_no_list_of_times_is_refused(text: str, told: str) -> None:
    with pytest.raises(ContractError, match=told):
        stated_times(text, FILES)


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        ("one.png 1\n", "no time for two.png"),
        ("one.png 1\none.png 2\n", "line 2: one.png is stated twice"),
        ("one.png\n", "line 1: expected NAME SECONDS"),
        ("one.png x\n", "line 1: expected NAME SECONDS"),
        ("one.png -1\n", "line 1: an exposure time must be > 0"),
    ],
)
def test_a_wrong_list_is_refused_with_its_line(tmp_path: Path, lines: str, told: str) -> None:
    path = tmp_path / "list.txt"
    path.write_text(lines)
    with pytest.raises(ContractError, match=told):
        stated_times(str(path), FILES)


def test_a_list_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "list.txt"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DecodeError, match="cannot be read as a list"):
        stated_times(str(path), FILES)
