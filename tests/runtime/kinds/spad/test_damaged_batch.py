"""Damaged files of every type in one batch: a line each, little memory, the rest is made."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from tests.runtime.kinds.spad.files.bombs import BOMBS
from tests.runtime.kinds.spad.files.bulky import BULKY
from tests.runtime.kinds.spad.files.test_bulky import SLOW
from tests.spad_files import STAMPS, WRITERS, small_cube, write_npz

CAP_MB = 400
TIMING = (
    '[timing]\norientation = "histogram"\ntime_bin_ps = 20\nbins = 40\n[laser]\nfwhm_ps = 100\n'
)
CHILD = """
import json, sys
from pathlib import Path
import camkit
folder = Path(sys.argv[1])
found = camkit.process(
    sorted(p for p in folder.iterdir() if p.name != "out"), bundle="none", out_dir=folder / "out",
    timing=sys.argv[2], max_mem_bytes={cap} * 10**6, product="depth", keep_folders=True,
)
status = Path("/proc/self/status").read_text().split("VmHWM:")[1]
told = [[str(r.input), r.status, r.error] for r in found]
print(json.dumps([int(status.split()[0]) // 1000, told]))
"""


def _cut(data: bytearray, rng: np.random.Generator) -> bytes:
    return bytes(data[: int(rng.integers(1, len(data) * 2 // 3))])


def _zeros(data: bytearray, rng: np.random.Generator) -> bytes:
    start = int(rng.integers(0, min(len(data), 600)))
    data[start : start + 200] = bytes(len(data[start : start + 200]))
    return bytes(data)


def _noise(data: bytearray, rng: np.random.Generator) -> bytes:
    for place in rng.integers(0, min(len(data), 3000), 40):
        data[place] = int(rng.integers(256))
    return bytes(data)


def _largest(data: bytearray, rng: np.random.Generator) -> bytes:
    start = int(rng.integers(0, min(len(data), 800)))
    data[start : start + 8] = b"\xff" * 8
    return bytes(data)


def _other(data: bytearray, rng: np.random.Generator) -> bytes:
    return rng.bytes(len(data))


def _turned(data: bytearray, rng: np.random.Generator) -> bytes:
    half = len(data) // 2 + int(rng.integers(9))
    return bytes(data[half:] + data[:half])


def _empty(_data: bytearray, _rng: np.random.Generator) -> bytes:
    return b""


UNREADABLE: dict[str, Callable[[Path], None]] = {
    "pipe": os.mkfifo,
    "device": lambda path: path.symlink_to("/dev/zero"),
    "loop": lambda path: path.symlink_to(path),
    "nowhere": lambda path: path.symlink_to("no such file"),
}
SUFFIXES = (".npz", ".h5", ".mat", ".tif", ".ptu", ".sdt", ".spc", ".zip")
DAMAGES: tuple[Callable[[bytearray, np.random.Generator], bytes], ...] = (
    *(_cut, _zeros, _noise, _largest, _other, _turned, _empty, _cut, _noise),
)


def _fill(folder: Path, count: int, seed: int) -> None:
    rng, every = np.random.default_rng(seed), {**WRITERS, **STAMPS}
    names = list(every)
    for number in range(count):
        name = names[number % len(names)]
        path = folder / f"{number:03d}_{name}"
        every[name](path, small_cube())
        path.write_bytes(
            DAMAGES[number // len(names) % len(DAMAGES)](bytearray(path.read_bytes()), rng)
        )
    for name, write in BULKY.items():
        if name not in SLOW:
            write(folder / name)
    for name, suffix in product(UNREADABLE, SUFFIXES):
        UNREADABLE[name](folder / f"{name}{suffix}")
    write_npz(folder / "zz_sound.npz", small_cube())


def _run(folder: Path, timing: Path) -> list[tuple[str, str, str]]:
    """Return name, status and error of every file of a batch; hold what must hold of all."""
    timing.write_text(TIMING, encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", CHILD.format(cap=CAP_MB), str(folder), str(timing)],
        capture_output=True,
        text=True,
        timeout=500,
        check=True,
    )
    peak_mb, found = json.loads(done.stdout.splitlines()[-1])
    failed = [one for one in found if one[1] == "failed"]
    print(f"{len(found)} files, {len(failed)} refused, peak {peak_mb} MB under {CAP_MB} MB")
    assert peak_mb < CAP_MB
    assert not done.stderr
    assert len(found) == len([p for p in folder.iterdir() if p.name != "out"])
    for name, _, error in failed:
        assert "\n" not in error, name
        assert "unexpected" not in error, name
    return [tuple(one) for one in found]


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
@pytest.mark.parametrize(("count", "seed"), [(24, 1), pytest.param(120, 2, marks=pytest.mark.slow)])
def test_damaged_files_end_no_batch_and_keep_to_the_memory(
    count: int, seed: int, tmp_path: Path
) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    _fill(folder, count, seed)
    found = _run(folder, tmp_path / "t.toml")
    assert found[-1][1] == "ok"
    unreadable = [status for name, status, _ in found if Path(name).stem in UNREADABLE]
    assert unreadable == ["failed"] * len(UNREADABLE) * len(SUFFIXES)


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads /proc")
def test_bombs_are_refused_in_one_line_and_keep_to_the_memory(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    for name, write in {**BOMBS, **BULKY}.items():
        write(folder / name)
    write_npz(folder / "zz_sound.npz", small_cube())
    found = {Path(name).name: status for name, status, _ in _run(folder, tmp_path / "t.toml")}
    assert found.pop("zz_sound.npz") == "ok"
    assert {found[name] for name in BOMBS} == {"failed"}
