"""A command that needs an extra is refused by its name, before it reads or computes anything."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest
import typer.main

from camkit.cli.app import app
from camkit.entry_points import JUDGE, install_text
from tests.data_folder import ROOT

BLOCKED: Final = (*JUDGE, "torch", "onnxscript")
FREE: Final = (
    "process a.dng",
    "view a.exr -o a.html",
    "plan a.dng",
    "simulate a.png --bundle duet -o a.dng",
    "merge a.dng -o a.exr",
    "info a.dng",
    "info duet",
    "portable gone -o a",
    "check gone",
    "doctor",
    "network inspect a.onnx",
    "calibrate psf a.dng -o a.safetensors",
    "calibrate blur a.dng -o a.safetensors",
    "calibrate noise --dark a.dng --flat a.dng -o a.toml",
    "calibrate flat a.dng -o a.toml",
    "calibrate geometry a.dng -o a.toml",
    "calibrate targets --screen 800x600 -o a",
    "calibrate tone a.dng --levels a.txt -o a.toml",
    "calibrate pairs a.dng --geometry a.toml -o a",
    "calibrate bundle gone -o a.camkit",
    "calibrate lensfun-in a.xml --lens a --focal-mm 50 --capture a.dng -o a.camkit",
    "calibrate lensfun-out gone -o a.xml",
    "psf import a.npz -o a.safetensors",
)
"""Lines that need no extra: every one ends without a word of one."""
JUDGING: Final = (
    "bench duet",
    "stress duet",
    "analyse field duet",
    "analyse hallucination duet --data a",
    "network add a.onnx --contract a.toml --to duet -o a.camkit",
    *(f"{line} --page a.html" for line in FREE if line.startswith(("calibrate", "psf"))),
)
DESIGNING: Final = (
    "make a.toml -o a.camkit --sensor 600x400@3.9um",
    "design a.toml",
    "recipe a.toml -o b.toml --sensor 600x400@3.9um",
    "freeze a.toml -o a.safetensors",
    "prepare a.toml",
    "train a.toml",
    "fit-bank a.toml -o a.pt",
    "freeze-norms a.pt a.toml -o b.pt",
    "export a.pt -o a.camkit",
    "lens show a.toml",
    "lens peak a.toml",
    "lens tolerance a.toml",
    "lens optimize a.toml -o b.toml",
    "lens thin a.toml -o b.toml",
    "lens convert a.zmx a.toml",
    "lens sag a.toml -o a.csv",
    "plate show a.toml",
    "plate design a.toml -o b",
    "plate match a.npz -o b",
    "plate masks a.toml -o b",
    "network inspect a.pt --module a:B",
    "calibrate distance a.dng --lens a.toml --focus-m 1 --object-m 2 --sharp-f-number 16",
)
NEEDS: Final = dict.fromkeys(JUDGING, "judge") | dict.fromkeys(DESIGNING, "train")


def _run(folder: Path, lines: list[str], blocked: tuple[str, ...]) -> dict[str, str]:
    """Return what a fresh process without these modules says on stderr, by line."""
    code = (
        "import contextlib, importlib.machinery, io, json, sys, traceback\n"
        f"sys.path.insert(0, {str(ROOT)!r})\n"
        "class Finder(importlib.machinery.PathFinder):\n"
        "    @classmethod\n"
        "    def find_spec(cls, name, *args):\n"
        f"        return None if name in {blocked!r} else super().find_spec(name, *args)\n"
        "sys.meta_path[sys.meta_path.index(importlib.machinery.PathFinder)] = Finder\n"
        "from camkit.cli.app import run\n"
        "said = {}\n"
        f"for line in {lines!r}:\n"
        "    with contextlib.redirect_stderr(io.StringIO()) as err:\n"
        "        with contextlib.redirect_stdout(io.StringIO()):\n"
        "            try:\n"
        "                run(line.split())\n"
        "            except Exception:\n"
        "                traceback.print_exc()\n"
        "    said[line] = err.getvalue()\n"
        "print(json.dumps(said))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=True
    )
    return dict(json.loads(done.stdout))


@pytest.fixture(scope="module")
def said(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    return _run(tmp_path_factory.mktemp("bare"), [*FREE, *NEEDS], BLOCKED)


def _commands(group: object, names: tuple[str, ...] = ()) -> set[str]:
    inner = getattr(group, "commands", None)
    if inner is None:
        return {" ".join(names)}
    return set().union(*(_commands(one, (*names, name)) for name, one in inner.items()))


def test_every_command_is_tried() -> None:
    lines = [*FREE, *NEEDS]
    missing = {
        command
        for command in _commands(typer.main.get_command(app))
        if not any(f"{line} ".startswith(f"{command} ") for line in lines)
    }
    assert not missing


@pytest.mark.parametrize("line", NEEDS)
def test_the_extra_that_is_missing_is_named_first(line: str, said: dict[str, str]) -> None:
    assert install_text(NEEDS[line]) in said[line]
    assert len(said[line].splitlines()) == 1


@pytest.mark.parametrize("line", FREE)
def test_what_needs_no_extra_works_without_any(line: str, said: dict[str, str]) -> None:
    assert "camkit[" not in said[line]
    assert "Traceback" not in said[line]
    assert "No module named" not in said[line]


def test_charts_are_refused_beside_torch_alone(tmp_path: Path) -> None:
    """A torch that was installed by hand brings neither matplotlib nor onnxscript."""
    charts = "matplotlib and scikit-image"
    wanting = {
        "export a.pt -o a.camkit": "matplotlib and onnxscript",
        "make a.toml -o a.camkit --sensor 600x400@3.9um": f"onnxscript and {charts}",
        "design a.toml --pictures 5": charts,
        "lens show a.toml": charts,
        "lens tolerance a.toml": charts,
        "plate show a.toml": charts,
    }
    said = _run(tmp_path, [*wanting], (*JUDGE, "onnxscript"))
    assert {line: wanting[line] in text for line, text in said.items()} == dict.fromkeys(
        wanting, True
    )
