"""The help is read by people who have never seen the code: groups, short lists, clear phrases."""

import re
from collections.abc import Iterator
from typing import Any, Final

import pytest
import typer

from camkit.cli.app import app
from camkit.cli.groups import JUDGE, MAKE, MEASURE, USE

ROOT: Final = typer.main.get_command(app)
LONGEST_PHRASE: Final = 90
LONGEST_SENTENCE: Final = 100
MOST_WORDS: Final = 6
BANNED: Final = (
    *(r"\bknobs?\b", r"\bwho\b", r"\bsay so\b", r"\bsa(?:y|ys|id)\b", r"\bto(?:ld|ells?)\b"),
    *(r"\btells?\b", r"\bknows?\b", r"\bbelieved?\b", r"\bveil\b", r"\bundo(?:es|ne)?\b"),
    *(r"\blikewise\b", r"\bso (?:long|large|far)\b", r"\bof yours\b", r"\bstand beside\b"),
    *(r"\bgo(?:es)? on\b", r"\bof them\b", r"(?<!-)\bhaze\b(?!\.safetensors)", r"\bthings?\b"),
)
"""Riddles and translated English of STYLE.md, "Language"; haze only as the name of an option."""


def _commands(command: Any, path: str = "camkit") -> Iterator[tuple[str, Any]]:
    """Yield every command below one, with the words that call it."""
    for name, below in getattr(command, "commands", {}).items():
        words = f"{path} {name}"
        yield words, below
        yield from _commands(below, words)


COMMANDS: Final = dict(_commands(ROOT))
PHRASES: Final = {
    f"{words} {parameter.opts[0]}": parameter.help
    for words, command in COMMANDS.items()
    for parameter in command.params
}
"""Every option and argument of every command, and its help."""
LISTED: Final = {words: command.short_help for words, command in COMMANDS.items()}


def _sentences(text: str) -> list[str]:
    """Return the paragraphs of a help, each on one line."""
    return [" ".join(part.split()) for part in re.split(r"\n\s*\n", text)]


def test_commands_are_grouped_by_what_a_person_wants() -> None:
    groups: dict[str, set[str]] = {}
    for name, command in ROOT.commands.items():  # type: ignore[attr-defined]
        groups.setdefault(command.rich_help_panel, set()).add(name)
    assert list(groups) == [USE, JUDGE, MAKE, MEASURE]
    assert {"process", "merge"} <= groups[USE]
    assert {"check", "doctor"} <= groups[JUDGE]
    assert {"train", "export"} <= groups[MAKE]
    assert groups[MEASURE] == {"calibrate", "psf"}


@pytest.mark.parametrize("words", sorted(LISTED))
def test_the_list_describes_a_command_in_about_five_words(words: str) -> None:
    text = LISTED[words]
    assert text, f"{words} has no line in the list"
    assert 3 <= len(text.split()) <= MOST_WORDS
    assert text[0].isupper()
    assert text.endswith(".")


def test_no_two_commands_of_a_list_share_a_description() -> None:
    assert len(set(LISTED.values())) == len(LISTED)


@pytest.mark.parametrize("words", sorted(PHRASES))
def test_the_help_of_an_option_is_one_short_phrase(words: str) -> None:
    text = PHRASES[words]
    assert text, f"{words} has no help"
    assert len(text) <= LONGEST_PHRASE, f"{len(text)} characters: {text}"
    assert text[0].isupper() or text.startswith("lensfun")
    assert text.endswith(".")
    assert ". " not in re.sub(r"\(\.\w", "(", text), f"two sentences: {text}"


@pytest.mark.parametrize("words", sorted(PHRASES))
def test_a_default_is_stated_in_one_way(words: str) -> None:
    text = PHRASES[words]
    assert len(re.findall("default", text, re.IGNORECASE)) == len(re.findall("; default: ", text))


def test_the_unit_of_an_option_is_in_its_help() -> None:
    units = {"-m": " m", "-mm": " mm", "-um": " um", "-px": " px", "-deg": " degrees"}
    for words, text in PHRASES.items():
        unit = next((u for end, u in units.items() if words.endswith(end)), None)
        assert unit is None or re.search(rf"{unit}\b", text), f"{words}: {text}"


@pytest.mark.parametrize("words", sorted(COMMANDS))
def test_the_help_of_a_command_begins_with_one_sentence(words: str) -> None:
    first, *_ = _sentences(COMMANDS[words].help)
    assert len(first) <= LONGEST_SENTENCE, first
    assert first.endswith(".")


def test_no_help_is_a_riddle() -> None:
    texts = [*PHRASES.values(), *LISTED.values(), *(c.help for c in COMMANDS.values())]
    riddles = [
        (found[0], text) for text in texts for word in BANNED if (found := re.search(word, text))
    ]
    assert not riddles
