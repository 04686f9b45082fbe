"""Messages name options as the caller writes them: flags for people, parameters for programs."""

import ast
import re
import typing
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
import pytest
import typer

import camkit
from camkit.caller import FLAGS, PARAMETERS, language, option_text, speaking, speaking_here
from camkit.cli.app import app
from camkit.runtime.development import WriteOptions
from camkit.runtime.options import Options
from tests.capture_factory import write_dng

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (
    *(ROOT / "runtime", ROOT / "export", ROOT / "models_def"),
    *(ROOT / "camkit" / name for name in ("bundle", "scenes", "streaks")),
    *(ROOT / "camkit" / f"{name}.py" for name in ("contracts", "haze", "kinds", "colorimetry")),
)
"""All that programs may call; `camkit.cli` and `camkit.report` speak to the command line alone."""
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]+")
COMMAND = re.compile(r"`camkit [^`]*`")
NAMES_OF_FILES = {
    "runtime/kinds/spad/twin/scene.py": "arrays of an NPZ",
    "runtime/kinds/spad/twin/simulate.py": "arrays of an NPZ",
    "runtime/network/tiling.py": "for tests and measurements, no flag",
    "runtime/plan/planner.py": "a mistake of the caller in Python",
    "models_def/kinds/bayer/fine_tuning/pairs.py": "keys of a TOML",
    "camkit/bundle/sensor.py": "a key of the manifest",
}
"""Where a message names what has the name of an option and is none."""


def _modules() -> Iterator[tuple[Path, ast.Module]]:
    for source in SOURCES:
        for path in sorted(source.rglob("*.py")) if source.is_dir() else [source]:
            yield path, ast.parse(path.read_text(encoding="utf-8"))


def _texts(tree: ast.Module) -> Iterator[ast.Constant]:
    """Yield the strings of a module that are no docstrings."""
    documented = (
        {
            id(statement.value)
            for node in ast.walk(tree)
            for statement in getattr(node, "body", None) or []
            if isinstance(statement, ast.Expr)
        }
        if tree.body
        else set()
    )
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            if id(node) not in documented:
                yield node


def _spoken() -> set[str]:
    """Return the names of all options that the source speaks of by a literal."""
    return {
        node.args[0].value
        for _, tree in _modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "option_text"
        and isinstance(node.args[0], ast.Constant)
    }


def _flags(command: click.Command) -> set[str]:
    own = {flag for p in command.params for flag in (*p.opts, *p.secondary_opts)}
    inner = getattr(command, "commands", {}).values()
    return own.union(*map(_flags, inner))


def test_no_message_of_the_source_writes_a_flag_by_itself() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {node.value}"
        for path, tree in _modules()
        for node in _texts(tree)
        if FLAG.search(COMMAND.sub("", node.value))
    ]
    assert not found, "say option_text(NAME) instead:\n" + "\n".join(found)


def test_no_message_of_the_source_names_an_option_as_programs_do() -> None:
    names = {*Options.__dataclass_fields__, *WriteOptions.__dataclass_fields__, "times_s"}
    names -= {"of_kind"}
    plain = re.compile(rf"(?<![\w.\[])({'|'.join(n for n in names if '_' in n)})(?![\w(])")
    found = [
        f"{path.relative_to(ROOT)}:{node.lineno}: {node.value}"
        for path, tree in _modules()
        for node in _texts(tree)
        if " " in node.value.strip() and plain.search(node.value)
        if path.relative_to(ROOT).as_posix() not in NAMES_OF_FILES
    ]
    assert not found, "say option_text(NAME) instead:\n" + "\n".join(found)


def test_every_option_that_a_message_names_is_one_in_both_languages() -> None:
    spoken = _spoken()
    assert {"max_mem_bytes", "assume", "origin_px", "times_s", "cfa"} <= spoken
    flags = _flags(typer.main.get_command(app))
    with speaking("command"):
        unknown = {name for name in spoken if option_text(name) not in flags}
    assert not unknown, "no command has such a flag"
    parameters = {
        node.arg if isinstance(node, ast.arg) else node.target.id
        for _, tree in _modules()
        for node in ast.walk(tree)
        if isinstance(node, ast.arg)
        or (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name))
    }
    parameters |= {option.name for kind in camkit_kinds() for option in kind.options}
    assert not spoken - parameters, "nothing in Python has such a parameter"


def camkit_kinds() -> list[typing.Any]:
    from camkit.kinds import all_kinds

    return all_kinds()


def test_options_are_spoken_where_messages_are_raised_and_not_when_modules_are_imported() -> None:
    for path, tree in _modules():
        inside = {
            id(node)
            for function in ast.walk(tree)
            if isinstance(function, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
            for node in ast.walk(function)
        }
        for node in ast.walk(tree):
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "option_text":
                assert id(node) in inside, f"{path}:{node.lineno}"


@pytest.mark.parametrize(
    ("name", "value", "flag", "parameter"),
    [
        ("on_unsafe", "warn", "--on-unsafe warn", 'on_unsafe="warn"'),
        ("max_mem_bytes", 2_692_696_320, "--max-mem 2693M", "max_mem_bytes=2_692_696_320"),
        ("vignetting", False, "--no-vignetting", "vignetting=False"),
        ("resume", True, "--resume", "resume=True"),
        ("white_level", 600.0, "--white-level 600", "MosaicOptions.white_level=600"),
        ("cfa", "RGGB", "--mosaic RGGB", 'MosaicOptions.cfa="RGGB"'),
        ("origin_px", (3, 4), "--origin-px 3,4", "origin_px=(3, 4)"),
        ("bundle", "none", "--bundle none", 'bundle="none"'),
        ("side_px", 65, "--side-px 65", "side_px=65"),
    ],
)
def test_an_option_with_its_value_is_what_the_caller_can_write(
    name: str, value: object, flag: str, parameter: str
) -> None:
    assert option_text(name, value) == parameter
    with speaking("command"):
        assert option_text(name, value) == flag
    assert option_text(name, value) == parameter


def test_names_of_the_two_languages_are_names_of_options() -> None:
    assert set(FLAGS) - {"cfa", "times_s"} <= set(Options.__dataclass_fields__)
    assert set(PARAMETERS) == set(camkit.MosaicOptions.__dataclass_fields__)


def test_a_thread_may_speak_another_language_than_its_process() -> None:
    with speaking("command"):
        with speaking_here("python"):
            assert language() == "python"
        assert language() == "command"
    assert language() == "python"


def _capture(folder: Path, **changes: object) -> Path:
    path = folder / "capture.dng"
    write_dng(path, np.full((48, 64), 900, np.uint16), **changes)  # type: ignore[arg-type]
    return path
