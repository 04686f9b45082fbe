"""Small files that unpack to gigabytes, or nest without an end, are refused in little memory."""

import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE, STDOUT, Popen

import pytest

from tests.runtime.kinds.spad.files.bulky import BULKY

CAP_BYTES = 400_000_000
READER = """
import os, resource, sys
from pathlib import Path
import h5py, numpy as np, scipy.io, tifffile
from camkit.errors import CamkitError
from camkit.runtime.kinds.spad.files.counts_file import Hints
from camkit.runtime.kinds.spad.files.open_counts import open_counts
for line in sys.stdin:
    if child := os.fork():
        print("ended", os.waitpid(child, 0)[1], flush=True)
        continue
    held = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (held + {cap},) * 2)
    try:
        with open_counts(Path(line.strip()), Hints(max_bytes={cap} // 4)) as file:
            file.rows(0, 1, np.arange(11.0))
    except CamkitError as error:
        print(type(error).__name__, error)
    else:
        print("read")
    sys.exit()
"""
TOLD = {
    "wide_texts.h5": "read",  # what states no times is never read
    "wide_attribute.h5": "read",
    "chunk_beyond_its_array.h5": "read",
    "wide_text.npz": "read",
    "large_chunk.h5": "packed in pieces of 1 GB",
    "large_cells.h5": "time stamps of one row of pixels take 4 GB",
    "cells_of_groups.h5": "a cell holds no array",
    "deep_groups.h5": "nests groups more than 32 deep",
    "group_in_itself.h5": "holds no data sets",
    "deep_cells.mat": "more than 8 deep",
    "long_name.mat": "is damaged",
    "large_matrix.mat": "takes 0.5 GB or more",
    "header_of_brackets.npz": "header is damaged",
}
SLOW = {"large_matrix.mat", "large_struct.mat"}


@pytest.fixture(scope="module")
def reader() -> Iterator[Popen[str]]:
    """A process that has imported all it needs, and reads each file in a fork of its own."""
    with Popen(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", READER.format(cap=CAP_BYTES)],
        stdin=PIPE,
        stdout=PIPE,
        stderr=STDOUT,
        text=True,
    ) as process:
        yield process
        process.communicate(timeout=60)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs a cap on memory")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] if n in SLOW else []) for n in BULKY]
)
def test_little_files_that_unpack_to_much_are_refused_in_one_line(
    name: str, tmp_path: Path, reader: Popen[str]
) -> None:
    BULKY[name](tmp_path / name)
    assert reader.stdin
    assert reader.stdout
    print(tmp_path / name, file=reader.stdin, flush=True)
    told, ended = reader.stdout.readline(), reader.stdout.readline()
    assert TOLD.get(name, "or more, and this version of MATLAB") in told
    assert ended == "ended 0\n", "one line, and nothing on stderr"
