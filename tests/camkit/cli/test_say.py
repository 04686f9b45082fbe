from pathlib import Path
from typing import Any

import pytest

from camkit.cli.say import plain
from tests.capture_factory import write_tiny_captures

CLI = Path(__file__).parents[3] / "camkit" / "cli"


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b[31mred\x07", "\\x1b[31mred\\x07"),
        ("over\rwritten", "over\\rwritten"),
        ("exr\u202egnp", "exr\\u202egnp"),
        ("csi\x9b31m", "csi\\x9b31m"),
        ("name\udcff", "name\\udcff"),
        ("Größe\tµm\n[bold]", "Größe\tµm\n[bold]"),
    ],
)
def test_what_would_steer_a_terminal_is_shown_instead(text: str, shown: str) -> None:
    assert plain(text) == shown


def test_names_of_captures_do_not_steer_the_terminal(tmp_path: Path, camkit_command: Any) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    odd = (tmp_path / "a.dng").rename(tmp_path / "\x1b]0;gone\x07.dng")
    out = ("--bundle", bundle, "--out-dir", tmp_path / "out")
    for command in (("process", odd, *out), ("plan", odd, *out[:2]), ("info", odd)):
        done = camkit_command(*command)
        assert done.code == 0
        assert "\x1b" not in done.out + done.err
        assert "\\x1b]0;gone\\x07.dng" in done.out


def test_errors_do_not_steer_the_terminal(camkit_command: Any) -> None:
    done = camkit_command("info", "\x1b[2Jabsent")
    assert done.code != 0
    assert "\x1b" not in done.err


def test_nothing_else_in_the_command_line_prints() -> None:
    prints = [p.name for p in CLI.rglob("*.py") if "typer.echo(" in p.read_text(encoding="utf-8")]
    assert prints == ["say.py"]
