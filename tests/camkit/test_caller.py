"""Messages name options as the caller writes them: flags for people, parameters for programs."""

import ast
import re
import typing
from collections.abc import Callable
from functools import cache
from pathlib import Path

import click
import cv2
import numpy as np
import pytest
import typer

import camkit
from camkit.caller import (
    FLAGS,
    PARAMETERS,
    Language,
    language,
    option_text,
    speaking,
    speaking_here,
)
from camkit.cli.app import app, run
from camkit.runtime.options import Options
from camkit.runtime.output.dng import write_bayer_dng
from camkit.runtime.write_options import WriteOptions
from tests.capture_factory import write_tiny_captures
from tests.dng_factory import dng_tags, scene_mosaic

ROOT = Path(__file__).resolve().parents[2]
SOURCES = (
    *(ROOT / "runtime", ROOT / "export", ROOT / "models_def"),
    *(ROOT / "camkit" / name for name in ("bundle", "scenes", "calibrate", "calibration")),
    *(
        ROOT / "camkit" / f"{name}.py"
        for name in ("psf", "radial", "noise", "cfa", "haze", "kinds", "colorimetry", "streaks")
    ),
)
"""All that programs may call; `camkit.cli` and `camkit.report` speak to the command line alone."""
FLAG = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]+")
COMMAND = re.compile(r"`camkit [^`]*`")
NAMES_OF_FILES = {
    "runtime/kinds/spad/twin/scene.py": "arrays of an NPZ",
    "runtime/kinds/spad/twin/photon_twin.py": "arrays of an NPZ",
    "runtime/network/tiling.py": "for tests and measurements, no flag",
    "runtime/plan/planner.py": "a mistake of the caller in Python",
    "models_def/kinds/bayer/fine_tuning/pair_settings.py": "keys of a TOML",
    "camkit/bundle/sensor.py": "a key of the manifest",
}
"""Files in which a message names what has the name of an option and is none."""


@cache
def _modules() -> list[tuple[Path, ast.Module]]:
    files = (sorted(s.rglob("*.py")) if s.is_dir() else [s] for s in SOURCES)
    return [(p, ast.parse(p.read_text(encoding="utf-8"))) for inside in files for p in inside]


@cache
def _nodes(tree: ast.Module) -> list[ast.AST]:
    """Return what `ast.walk` gives, without its generators, which take most of the time."""
    nodes: list[ast.AST] = [tree]
    for node in nodes:
        for value in vars(node).values():
            if isinstance(value, ast.AST):
                nodes.append(value)
            elif isinstance(value, list):
                nodes += [part for part in value if isinstance(part, ast.AST)]
    return nodes


@cache
def _texts(tree: ast.Module) -> list[ast.Constant]:
    """Return the strings of a module that are no docstrings."""
    bodies = (getattr(node, "body", None) for node in _nodes(tree))
    documented = {
        id(statement.value)
        for body in bodies
        if isinstance(body, list)
        for statement in body
        if isinstance(statement, ast.Expr)
    }
    return [
        node
        for node in _nodes(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
        if id(node) not in documented
    ]


def _spoken() -> set[str]:
    """Return the names of all options that the source speaks of by a literal."""
    return {
        node.args[0].value
        for _, tree in _modules()
        for node in _nodes(tree)
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
        for node in _nodes(tree)
        if isinstance(node, ast.arg)
        or (isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name))
    }
    parameters |= {option.name for kind in camkit_kinds() for option in kind.options}
    missing = spoken - parameters
    assert not missing, "nothing in Python has such a parameter"


def camkit_kinds() -> list[typing.Any]:
    from camkit.kinds import all_kinds

    return all_kinds()


def test_options_are_spoken_where_messages_are_raised_and_not_when_modules_are_imported() -> None:
    for path, tree in _modules():
        waiting: list[ast.AST] = list(tree.body)
        while waiting:
            node = waiting.pop()
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
                continue
            is_call = isinstance(node, ast.Call) and getattr(node.func, "id", "") == "option_text"
            assert not is_call, f"{path}:{node.lineno}"
            waiting.extend(ast.iter_child_nodes(node))


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
    elsewhere = {"cfa", "times_s", "first", "darks", "flats", "photo", "before_file", "crops"}
    assert set(FLAGS) - elsewhere <= set(Options.__dataclass_fields__)
    assert set(PARAMETERS) == set(camkit.MosaicOptions.__dataclass_fields__)


def test_a_thread_may_speak_another_language_than_its_process() -> None:
    with speaking("command"):
        with speaking_here("python"):
            assert language() == "python"
        assert language() == "command"
    assert language() == "python"


def _refused(folder: Path) -> dict[str, Callable[[], object]]:
    """Return calls that are refused, by the arguments of the command that is refused alike."""
    tiny, crop = folder / "tiny.camkit", folder / "crop.png"
    a = folder / "a.dng"
    cv2.imwrite(str(crop), np.full((16, 24, 3), 90, np.uint8))
    out = folder / "out"
    white = camkit.MosaicOptions(white_level=520.0)
    return {
        f"{crop} --bundle {tiny}": lambda: camkit.load(tiny).process(crop),
        f"{a} --bundle {tiny} --white-level 520": lambda: camkit.load(tiny).process(
            a, mosaic=white
        ),
        f"{a} --bundle none --depth-m 1": lambda: camkit.load(None, depth_m=1.0),
        f"{a} --bundle none --wb 0,1,1": lambda: camkit.load(None, white_balance=(0.0, 1.0, 1.0)),
        f"{a} --bundle {tiny} --origin-px 1,2 --assume centre": lambda: camkit.load(
            tiny, origin_px=(1, 2), assume="centre"
        ),
        f"{a} --bundle {tiny} --max-mem 9M": lambda: camkit.load(tiny, max_mem_bytes=9_000_000),
        f"{a} --bundle {tiny} --max-seconds 0": lambda: camkit.load(tiny, max_seconds=0.0),
        f"{a} --bundle {tiny} --method develop --on-unsafe fail": lambda: camkit.process(
            a, bundle=tiny, method="develop", on_unsafe="fail", out_dir=out
        ),
        f"{a} --bundle none --format exr --linear": lambda: camkit.process(
            a, bundle="none", format="exr", linear=True, out_dir=out
        ),
        f"{crop}": lambda: camkit.process(crop, out_dir=out),
        f"{a} --bundle {tiny} --timing x.toml": lambda: camkit.load(tiny, timing="x.toml"),
        f"{a} --bundle {tiny} --size Q": lambda: camkit.load(tiny, size="Q"),
    }


PROGRAMS = re.compile(r"(?<![\w./-])[a-z]+_[a-z_]+|MosaicOptions|=\"")


def test_each_refusal_is_in_the_language_of_its_caller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_tiny_captures(tmp_path, ["a"])
    monkeypatch.chdir(tmp_path)
    for words, call in _refused(tmp_path).items():
        with pytest.raises(camkit.CamkitError) as caught:
            call()
        assert not FLAG.search(str(caught.value)), caught.value
        assert run(["process", *words.split(), "--out-dir", "out"]) != 0
        said = capsys.readouterr().err.replace(str(tmp_path), "")
        assert not PROGRAMS.search(said), said


def test_notes_of_results_are_in_the_language_of_their_caller(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    dark = tmp_path / "dark.dng"
    write_bayer_dng(dark, scene_mosaic(96, 128) // 8, tags=dng_tags(black=0, white=65_000))
    found = camkit.process(dark, bundle="none", out_dir=tmp_path / "python")[0]
    assert any("set it with MosaicOptions.white_level" in note for note in found.warnings)
    told = (tmp_path / "python" / "dark.camkit.json").read_text()
    assert "--white-level" not in told
    out = tmp_path / "command"
    assert run(["process", str(dark), "--bundle", "none", "--out-dir", str(out), "--json"]) == 0
    assert "(set it with --white-level)" in capsys.readouterr().out
    assert "MosaicOptions" not in (out / "dark.camkit.json").read_text()


def test_a_worker_of_a_cluster_speaks_as_the_caller_of_its_run() -> None:
    from camkit.runtime.batch.cluster.remote import Needs, look

    class Worker:
        """As much of a dask worker as `look` asks for: one without memory."""

        local_directory = "nowhere"
        state = type("State", (), {"nthreads": 1})
        memory_manager = type("Manager", (), {"memory_limit": 1})

    told = {}
    for spoken in typing.get_args(Language):
        needs = Needs(
            run="r",
            bundles=(),
            file_bytes=10**9,
            token=Path("token"),
            sources=(),
            language=spoken,
        )
        told[spoken], _ = look(needs, Worker())  # type: ignore[arg-type]
    assert str(told["command"]).endswith("lower --max-mem")
    assert str(told["python"]).endswith("lower max_mem_bytes")
