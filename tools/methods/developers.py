"""Programs that develop alone, beside camkit's own development: CPU-seconds of whole commands.

    DNG of two sizes --> camkit process --method develop | rawtherapee-cli | darktable-cli --> TIFF

Each on one thread, to 16 bits. Two sizes tell the price of a megapixel from that of starting. The
pictures differ, since tone and colours are each program's own, so no decibels are compared.
"""

import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from camkit.errors import ContractError
from tools.memory import Captures

MEGAPIXELS: Final = (1.5, 24.0)
NUMBER: Final = re.compile(r"\d+(\.\d+)+")
CAMKIT: Final = "camkit, developed only"

Words = Callable[[Captures, Path], list[str]]
"""A capture and the folder to write to -> the command."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Developer:
    """A program that develops.

    Attributes:
        program: Its command, which has to be installed.
        version: Words that make it print its version.
        words: The command for a capture.
    """

    program: str
    version: tuple[str, ...]
    words: Words


def _camkit(captures: Captures, folder: Path) -> list[str]:
    choices = ["--method", "develop", "--format", "tiff", "--threads", "1", "--out-dir", folder]
    words = ["-m", "camkit", "process", captures.photo, "--bundle", captures.bundle, *choices]
    return [sys.executable, *map(str, words)]


def _rawtherapee(captures: Captures, folder: Path) -> list[str]:
    return ["rawtherapee-cli", "-t", "-b16", "-o", f"{folder}/out.tif", "-c", str(captures.photo)]


def _darktable(captures: Captures, folder: Path) -> list[str]:
    sixteen = ["--conf", "plugins/imageio/format/tiff/bpp=16"]
    core = ["--core", "--configdir", f"{folder}/settings", "-t", "1", *sixteen]
    return ["darktable-cli", str(captures.photo), f"{folder}/out.tif", *core]


DEVELOPERS: Final[Mapping[str, Developer]] = {
    CAMKIT: Developer(program=sys.executable, version=("-m", "camkit", "--version"), words=_camkit),
    "RawTherapee": Developer(program="rawtherapee-cli", version=("-v",), words=_rawtherapee),
    "darktable": Developer(program="darktable-cli", version=("--version",), words=_darktable),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DevelopingTime:
    """CPU time of a program.

    Attributes:
        title: Of the program.
        version: Number that it prints.
        cpu_s_per_mp: CPU-seconds that a megapixel adds.
        start_s: CPU-seconds of a picture without pixels.
    """

    title: str
    version: str
    cpu_s_per_mp: float
    start_s: float


def time_developers(bundle: str, rounds: int, tell: Callable[[str], None]) -> list[DevelopingTime]:
    """Measure the programs that are installed, in turn; medians.

    Args:
        bundle: Name or path of the camera whose captures are developed.
        rounds: Times that every program develops every capture.
        tell: Told every round.

    Raises:
        ContractError: If a program fails.
    """
    installed = {title: one for title, one in DEVELOPERS.items() if shutil.which(one.program)}
    seconds: dict[tuple[str, float], list[float]] = {}
    with TemporaryDirectory() as folder:
        captures = {}
        for megapixels in MEGAPIXELS:
            place = Path(folder, f"{megapixels:g}")
            place.mkdir()
            captures[megapixels] = Captures(place, bundle, megapixels)
        for number in range(rounds):
            for title, developer in installed.items():
                for megapixels, capture in captures.items():
                    with TemporaryDirectory(dir=folder) as out:
                        words = developer.words(capture, Path(out))
                        seconds.setdefault((title, megapixels), []).append(_cpu_s(words))
            tell(f"developed, round {number + 1} of {rounds}")
    return [
        _time_of(title, one, [statistics.median(seconds[title, size]) for size in MEGAPIXELS])
        for title, one in installed.items()
    ]


def _time_of(title: str, developer: Developer, seconds: Sequence[float]) -> DevelopingTime:
    (small, large), (few_s, many_s) = MEGAPIXELS, seconds
    each_s = (many_s - few_s) / (large - small)
    question = [developer.program, *developer.version]
    printed = subprocess.run(question, capture_output=True, text=True, check=False).stdout
    return DevelopingTime(
        title=title,
        version=number[0] if (number := NUMBER.search(printed)) else "",
        cpu_s_per_mp=each_s,
        start_s=few_s - each_s * small,
    )


def _cpu_s(words: Sequence[str]) -> float:
    """Run a command; return the CPU-seconds of its process and of those that it waited for."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ended = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if ended.returncode:
        raise ContractError(f"{' '.join(words)} failed: {ended.stderr.strip()[-300:]}")
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
