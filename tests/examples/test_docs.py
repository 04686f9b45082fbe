"""The documents say what the program does: commands, options, keys, fields and links exist."""

import json
import re
import shlex
import subprocess
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import pytest
import typer
from rich.text import Text

import camkit
from camkit import errors
from camkit.bundle.manifest import Manifest
from camkit.cli.app import app
from camkit.cli.exit_code import ExitCode
from camkit.errors import CamkitError
from camkit.runtime.machine import limits as machine_limits
from camkit.runtime.machine.limits import Limit
from camkit.runtime.output.sidecar import sidecar_path
from tests.capture_factory import write_tiny_captures

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(DOCS.rglob("*.md"))]
CURRENT = [path for path in DOCUMENTS if path.name != "history.md"]
"""History names commands, options and files as they were."""
ENTRY_POINTS = {"stages"}
"""Groups of entry points that are no modules."""
MADE_BY_EXPORT = "camkit/bundles/duet.camkit"
TOOL = re.compile(r"(?<![A-Za-z_])(?:tests/)?tools(?:[./][a-z_0-9]+)+")
"""A module of the tools, as `python -m` takes it or as a path."""
COMMIT = re.compile(r"\bat ([0-9a-f]{8})\b")
EVERYWHERE = {"--help", "-h", "--debug"}
KEPT = {".md", ".json", ".jsonl", ".csv", ".png", ".toml"}
MADE_ANEW = {".html", ".svg"}  # of results, which git ignores
MOST_BYTES = 600_000
RESULTS = ROOT / "docs" / "results"


@cache
def _commands() -> dict[str, Any]:
    return dict(typer.main.get_command(app).commands)  # type: ignore[attr-defined]


def _command(words: Sequence[str]) -> Any:
    """Give the command that words begin with, in a group the one below it."""
    command = _commands()[words[0]]
    below = getattr(command, "commands", {})
    return below.get(words[1], command) if len(words) > 1 else command


def _options(command: Any) -> list[set[str]]:
    """Give the names of every option."""
    return [
        {*parameter.opts, *parameter.secondary_opts}
        for parameter in command.params
        if parameter.param_type_name == "option"
    ]


def _code_lines(text: str) -> list[str]:
    """Give the lines of indented and fenced code that call camkit."""
    lines = [line.strip() for line in text.splitlines() if line.startswith("    ")]
    for block in re.findall(r"^```sh[^\n]*\n(.*?)^```$", text, re.DOTALL | re.MULTILINE):
        lines += block.splitlines()
    lines = [re.sub(r"^\.venv/bin/", "", line) for line in lines]
    return [line for line in lines if line.startswith("camkit ")]


def _inline(text: str) -> list[str]:
    return [code for code in re.findall(r"`([^`\n]+)`", text) if code.startswith("camkit ")]


def _id(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def _help_texts(command: Any) -> Iterator[str]:
    yield from (text for text in (command.help, *(p.help for p in command.params)) if text)
    for part in getattr(command, "commands", {}).values():
        yield from _help_texts(part)


def test_no_word_of_the_help_is_taken_for_markup() -> None:
    texts = list(_help_texts(typer.main.get_command(app)))
    assert len(texts) > 100
    for text in texts:
        assert Text.from_markup(text).plain == text.replace("\\[", "["), text


@pytest.mark.parametrize("document", CURRENT, ids=_id)
def test_every_command_line_parses(document: Path) -> None:
    for line in _code_lines(document.read_text(encoding="utf-8")):
        words = shlex.split(line, comments=True)[1:]
        assert words[0] in _commands(), line
        try:
            _commands()[words[0]].make_context(words[0], words[1:])
        except Exception as error:  # noqa: BLE001 - the line is told with whatever is wrong
            pytest.fail(f"{line}: {error}")


@pytest.mark.parametrize("document", CURRENT, ids=_id)
def test_every_command_in_a_sentence_exists_with_its_options(document: Path) -> None:
    for code in _inline(document.read_text(encoding="utf-8")):
        words = code.split()[1:]
        if words[0].startswith("-") or words[0] == "COMMAND":
            continue
        assert words[0] in _commands(), code
        known = EVERYWHERE.union(*_options(_command(words)))
        assert not {w for w in words if w.startswith("--")} - known, code


@pytest.mark.parametrize("document", DOCUMENTS, ids=_id)
def test_every_link_leads_to_a_file_and_a_heading(document: Path) -> None:
    """In docs, to a file of docs: the site has nothing else."""
    for target in re.findall(r"\]\(([^)\s]+)\)", _prose(document)):
        if target.startswith(("http:", "https:")):
            continue
        name, _, anchor = target.partition("#")
        path = (document.parent / name).resolve() if name else document
        assert path.exists(), target
        if DOCS in document.parents:
            assert path.is_file(), f"{target}: name folders as code"
            assert DOCS in path.parents, f"{target}: name files outside docs as code"
        assert not anchor or anchor in _anchors(path), target


def _prose(path: Path) -> str:
    """Return a page without its blocks of code."""
    text = path.read_text(encoding="utf-8")
    return re.sub(r"^(```+)[^\n]*\n.*?^\1$", "", text, flags=re.DOTALL | re.MULTILINE)


@cache
def _anchors(path: Path) -> set[str]:
    """Return the anchors of a page's headings, as git hosts and the site make them."""
    anchors: set[str] = set()
    for heading in re.findall(r"^#+ +(.+?) *#*$", _prose(path), re.MULTILINE):
        text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", heading)
        anchors.add(re.sub(r"[^\w\- ]", "", text.lower()).replace(" ", "-"))
    return anchors


@pytest.mark.parametrize("document", CURRENT, ids=_id)
def test_every_file_and_module_named_exists(document: Path) -> None:
    text = document.read_text(encoding="utf-8")
    tops = "camkit|runtime|export|models_def|tests|tools|docs"
    for name in re.findall(rf"`((?:{tops})/[A-Za-z0-9_./-]+)`(?! at [0-9a-f]{{8}})", text):
        assert name == MADE_BY_EXPORT or (ROOT / name).exists(), name
    for module in re.findall(r"`camkit((?:\.[a-z_]+)+)\b[^`]*`", text):
        parts = module.strip(".").split(".")
        here = parts[0] in {*camkit.__all__, *ENTRY_POINTS}
        places = [Path("camkit", *parts[:n]) for n in range(1, len(parts) + 1)]
        files = [ROOT / p.with_suffix(".py") for p in places] + [ROOT / p for p in places[-1:]]
        assert here or any(f.exists() for f in files), module


@pytest.mark.parametrize("document", CURRENT, ids=_id)
def test_every_tool_that_is_named_is_there_or_stands_beside_the_commit_that_has_it(
    document: Path,
) -> None:
    text = document.read_text(encoding="utf-8").replace("\\\n", " ")
    for line in text.splitlines():
        for tool in TOOL.finditer(line):
            place = tool.group().removesuffix(".py").replace(".", "/")
            if (ROOT / f"{place}.py").is_file() or (ROOT / place).is_dir():
                continue
            commit = COMMIT.search(line[tool.end() :])
            assert commit is not None, f"{tool.group()} is not there: {line}"
            assert f"{place}.py" in (_tools_at(commit[1]) or (f"{place}.py",)), line


@cache
def _tools_at(commit: str) -> tuple[str, ...]:
    """Return the files of the tools of a commit; none where there is no history to ask."""
    asked = ("git", "ls-tree", "-r", "--name-only", commit, "tools/", "tests/tools/")
    answer = subprocess.run(asked, cwd=ROOT, capture_output=True, text=True, check=False)
    return tuple(answer.stdout.split())


def test_every_result_is_named_beside_what_made_it() -> None:
    table = (RESULTS / "README.md").read_text(encoding="utf-8").partition("## What made them")[2]
    places = re.findall(r"^\| `([^`]+)` \| [^|]+ \|$", table, re.MULTILINE)
    for path in RESULTS.rglob("*"):
        name = path.relative_to(RESULTS).as_posix()
        if path.suffix in KEPT - {".md"}:
            assert any(name == place or name.startswith(place) for place in places), name
    for place in places:
        assert [*RESULTS.glob(f"{place}*")], place


def test_results_are_data_and_pictures_of_no_great_size() -> None:
    files = [path for path in RESULTS.rglob("*") if path.is_file()]
    kept = [path for path in files if path.suffix not in MADE_ANEW]
    assert kept
    assert {path.suffix for path in kept} <= KEPT
    assert not [path for path in kept if path.stat().st_size > MOST_BYTES]


def _reference(page: str) -> str:
    return (ROOT / "docs" / "reference" / f"{page}.md").read_text(encoding="utf-8")


def test_the_page_of_errors_names_every_exit_code_error_and_limit() -> None:
    text = _reference("errors")
    codes = re.findall(r"^\| ([0-9]+) \|", text, re.MULTILINE)
    assert list(map(int, codes)) == [code.value for code in ExitCode]
    kinds = {
        name: kind for name in camkit.__all__ if isinstance(kind := getattr(camkit, name), type)
    }
    tree = {name for name, kind in kinds.items() if issubclass(kind, CamkitError)}
    assert tree >= {name for name in vars(errors) if name.endswith("Error")}
    assert tree <= set(re.findall(r"`(?:camkit\.)?([A-Z][A-Za-z]+)`", text))
    limits = {v.variable for v in vars(machine_limits).values() if isinstance(v, Limit)}
    assert set(re.findall(r"`(CAMKIT_MAX_[A-Z_]+)`", text)) == limits


def test_the_page_of_output_lists_the_keys_of_sidecar_and_json(tmp_path: Path) -> None:
    bundle = write_tiny_captures(tmp_path, ["a"])
    (result,) = camkit.process(tmp_path / "a.dng", bundle=bundle, out_dir=tmp_path / "out")
    assert result.output is not None, result.error
    before, _, sidecar = _reference("output").partition("## The sidecar")
    assert set(result.to_json()) <= _keys(before.partition("## JSON of process")[2])
    assert _keys(sidecar.partition("\n## ")[0]) == set(
        json.loads(sidecar_path(result.output).read_text())
    )


def _keys(text: str) -> set[str]:
    """Return what the first column of a table names."""
    return set(re.findall(r"`([a-z0-9_]+)`", "".join(re.findall(r"^\|(.*?)\|", text, re.M))))


def test_the_format_lists_every_field_of_the_manifest() -> None:
    text = (ROOT / "docs" / "reference" / "bundle-format.md").read_text(encoding="utf-8")
    named = set(re.findall(r"`([a-z0-9_]+)`", text))
    schema = Manifest.model_json_schema()
    fields = set(schema["properties"])
    for part in schema["$defs"].values():
        fields |= set(part.get("properties", ()))
    said_in_words = {"type", "member", "input_name", "output_name"}
    assert not fields - said_in_words - named
